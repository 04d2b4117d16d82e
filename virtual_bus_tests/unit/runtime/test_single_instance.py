"""One process for each task: who comes second is refused, with the name of the first."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest

from canbase_base.single_instance import TakenError, bus_name, check, hold_record, take


def _bus(name: str) -> dict[str, Any]:
    return {"interface": "socketcan", "channel": name}


def hold(name: str) -> AbstractContextManager[Any]:
    return take("driver", bus_name(_bus(name)))


@pytest.mark.parametrize("length", [1, 200])
def test_it_is_free_again_when_it_is_closed(length: int) -> None:
    name = f"{os.getpid()}-closed-" + "x" * length
    for _ in range(2):
        with hold(name):
            with pytest.raises(TakenError, match=f"process {os.getpid()} of user {os.geteuid()}"):
                hold(name)
            with hold(name + "y"):
                pass


# held by another process ── SIGKILL ── free at once
def test_the_kernel_frees_it_whatever_ends_its_process() -> None:
    name = f"{os.getpid()}-killed"
    code = "from canbase_base.single_instance import bus_name, take; "
    code += f"held = take('driver', bus_name({_bus(name)})); print('held', flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        env=os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"},
    ) as child:  # fmt: skip
        assert child.stdout is not None
        assert child.stdout.readline() == b"held\n"
        with pytest.raises(TakenError, match=f"process {child.pid} of user"):
            hold(name)
        child.send_signal(signal.SIGKILL)
        child.wait(5.0)
    with hold(name):
        pass


def test_each_task_has_its_own_name_and_looking_takes_nothing() -> None:
    name = f"{os.getpid()}-tasks"
    check("driver", name)
    both = (take("driver", name), take("velocity process", name))
    with both[0], both[1], pytest.raises(TakenError, match="another driver has"):
        check("driver", name)
    check("driver", name)


def test_buses_are_told_apart_by_interface_channel_and_port() -> None:
    one = {"interface": "udp_multicast", "channel": "239.74.163.2", "port": 1, "hop_limit": 0}
    names = {bus_name(one), bus_name(one | {"port": 2}), bus_name(_bus("can0")), bus_name(_bus("can1"))}
    assert len(names) == 4
    assert bus_name(one | {"hop_limit": 1}) in names


def test_whoever_comes_second_is_told_who_holds_it_also_after_many_have_asked() -> None:
    """As systemd does that starts it again and again: nobody takes these calls."""
    name = f"{os.getpid()}-asked"
    with hold(name):
        for _ in range(200):
            with pytest.raises(TakenError, match=f"process {os.getpid()} of user"):
                hold(name)


def test_two_robots_of_one_name_on_two_buses_do_not_write_one_record(tmp_path: Path) -> None:
    """One that is reset or ends in order would make the other forget its latched stop. A link is the same folder."""
    (tmp_path / "carl").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "carl")
    with hold_record(tmp_path / "carl" / "driver.latch"), hold_record(tmp_path / "rosa" / "driver.latch"):
        for same in ("carl", "link"):
            with pytest.raises(TakenError, match="Two robots on one computer need two names") as refused:
                hold_record(tmp_path / same / "driver.latch")
            assert f"process {os.getpid()} of user" in str(refused.value)
            assert "driver.latch" in str(refused.value)
    with hold_record(tmp_path / "carl" / "driver.latch"):
        pass
