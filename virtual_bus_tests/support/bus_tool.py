"""The commissioning commands as processes, and simulated drives for them, on a multicast bus of their own."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from canbase_config.load import sample
from canbase_sim.control import ControlError, SimControl

ENVIRONMENT = os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1", "COLUMNS": "160", "PYTHONUNBUFFERED": "1"}

HEARTBEAT_S = 0.6
"""1016h of the drives [s], twice the default: these tests are not about a computer that runs a tool late."""
STANDS_S = HEARTBEAT_S + 1.4
"""A wheel stands by then [s], its tool killed or not: the ramp takes 0.25 s, the rest is for a loaded computer."""


def write_robot(folder: Path, port: int, name: str = "robot.yaml", **drives: Any) -> Path:
    """The bench sample with its comments, on a port of its own; `drives`: keys for both drives."""
    yaml = YAML()
    values = yaml.load(sample("bench"))
    values["bus"]["extra"]["port"] = port
    values["lease"]["socket"] = str(folder / "lease.sock")
    values["timeouts"] = {"drive_heartbeat_s": HEARTBEAT_S, "feedback_s": 0.3}
    for drive in values["drives"]:
        drive.update(drives)
    file = folder / name
    with file.open("w", encoding="utf-8") as stream:
        yaml.dump(values, stream)
    return file


@contextmanager
def drives(config: Path, *options: str) -> Iterator[SimControl]:
    """`canbase serve sim` as a process, and its control socket."""
    argv = [sys.executable, "-m", "canbase_sim", str(config), *options]
    process = subprocess.Popen(argv, stderr=subprocess.DEVNULL, env=ENVIRONMENT)
    try:
        with _connect(config.parent / "sim.sock") as control:
            time.sleep(0.3)  # they boot
            yield control
    finally:
        process.kill()
        process.wait(10.0)


def _connect(path: Path) -> SimControl:
    end = time.monotonic() + 20.0
    while True:
        with contextlib.suppress(ControlError):
            return SimControl(path)
        assert time.monotonic() < end, "the simulator does not come up"
        time.sleep(0.05)


def argv(*words: str) -> list[str]:
    """Command line of a canbase command."""
    return [sys.executable, "-m", "canbase_cli", *words]


def canbase(*words: str, timeout_s: float = 50.0) -> subprocess.CompletedProcess[str]:
    """A canbase command, run to its end."""
    return subprocess.run(
        argv(*words), input="", capture_output=True, text=True, env=ENVIRONMENT, timeout=timeout_s, check=False
    )


def wheel_stands(control: SimControl, within_s: float) -> None:
    """Fails when the left wheel still turns after that time."""
    end = time.monotonic() + within_s
    while abs(control.truth().v_left_mps) > 0.001:
        assert time.monotonic() < end, "the wheel still turns"
        time.sleep(0.01)
