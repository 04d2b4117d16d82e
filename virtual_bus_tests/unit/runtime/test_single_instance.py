"""One process for each task: who comes second is refused, with the name of the first."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest

from canbase_runtime.latch_file import hold
from canbase_runtime.single_instance import TakenError, bus_name, check, take
from canbase_watchdog import single_instance as sole

Take = Callable[[str], AbstractContextManager[Any]]


def _bus(name: str) -> dict[str, Any]:
    return {"interface": "socketcan", "channel": name}


TAKES: Mapping[str, tuple[Take, type[Exception], str]] = {
    "driver": (
        lambda name: take("driver", bus_name(_bus(name))),
        TakenError,
        "from canbase_runtime.single_instance import bus_name, take; held = take('driver', bus_name({bus}))",
    ),
    "watchdog": (
        lambda name: sole.hold_bus(_bus(name)),
        sole.TakenError,
        "from canbase_watchdog.single_instance import hold_bus; held = hold_bus({bus})",
    ),
}


@pytest.fixture(params=list(TAKES))
def kind(request: pytest.FixtureRequest) -> tuple[Take, type[Exception], str]:
    return TAKES[request.param]


@pytest.mark.parametrize("length", [1, 200])
def test_it_is_free_again_when_it_is_closed(kind: tuple[Take, type[Exception], str], length: int) -> None:
    name = f"{os.getpid()}-closed-" + "x" * length
    for _ in range(2):
        with kind[0](name):
            with pytest.raises(kind[1], match=f"process {os.getpid()} of user {os.geteuid()}"):
                kind[0](name)
            with kind[0](name + "y"):
                pass


# held by another process ── SIGKILL ── free at once
def test_the_kernel_frees_it_whatever_ends_its_process(kind: tuple[Take, type[Exception], str]) -> None:
    name = f"{os.getpid()}-killed"
    code = kind[2].format(bus=_bus(name)) + "; print('held', flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        env=os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"},
    ) as child:  # fmt: skip
        assert child.stdout is not None
        assert child.stdout.readline() == b"held\n"
        with pytest.raises(kind[1], match=f"process {child.pid} of user"):
            kind[0](name)
        child.send_signal(signal.SIGKILL)
        child.wait(5.0)
    with kind[0](name):
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


def test_whoever_comes_second_is_told_who_holds_it_also_after_many_have_asked(
    kind: tuple[Take, type[Exception], str],
) -> None:
    """As systemd does that starts it again and again: nobody takes these calls."""
    name = f"{os.getpid()}-asked"
    with kind[0](name):
        for _ in range(200):
            with pytest.raises(kind[1], match=f"process {os.getpid()} of user"):
                kind[0](name)


RECORDS: Mapping[str, tuple[Take, type[Exception]]] = {
    "driver": (lambda folder: hold(Path(folder), "driver"), TakenError),
    "watchdog": (lambda folder: sole.hold_record(Path(folder) / "watchdog.latch"), sole.TakenError),
}


@pytest.mark.parametrize("part", list(RECORDS))
def test_two_robots_of_one_name_on_two_buses_do_not_write_one_record(tmp_path: Path, part: str) -> None:
    """One that is reset or ends in order would make the other forget its latched stop. A link is the same folder."""
    take_record, taken = RECORDS[part]
    (tmp_path / "carl").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "carl")
    with take_record(str(tmp_path / "carl")), take_record(str(tmp_path / "rosa")):
        for same in ("carl", "link"):
            with pytest.raises(taken, match="Two robots on one computer need two names") as refused:
                take_record(str(tmp_path / same))
            assert f"process {os.getpid()} of user" in str(refused.value)
            assert f"{part}.latch" in str(refused.value)
    with take_record(str(tmp_path / "carl")):
        pass
