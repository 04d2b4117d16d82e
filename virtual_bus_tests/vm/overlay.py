"""What the guest has besides its system: the robot as `canbase setup install` makes it, and the test's own units."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from canbase_config.commissioned import mark
from canbase_config.load import load_robot
from vm import independent_stacks

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
EXAMPLE = ROOT / "can_config/canbase_config/robots/example_can0.yaml"
SLOW = "rates: {control_hz: 50.0, odometry_hz: 25.0, command_hz: 25.0}\naction: {control_hz: 20.0}\n"
"""The guest's processor is: a billion instructions a second, and no other one. All timeouts are those of a robot."""
HARDWARE_WATCHDOG_S = 5
ALIGNED = 4
"""Where a further archive in a ramdisk has to begin, or the kernel does not see it."""


def robot_yaml(channel: str, lease: str) -> str:
    """The example robot on an interface of the guest, without scanner and button, which it does not have, and without
    a proof of its drives, which nobody commissions here. That its units fit is marked, or it would be slower than
    the scenarios: they are those of the simulation."""
    text = EXAMPLE.read_text(encoding="utf-8")
    text = text.replace("required: true", "required: false").replace("name: example", "name: robot")
    text = text.replace("require_self_stop: true", "require_self_stop: false")
    text = text.replace("channel: can0", f"channel: {channel}").replace("/run/canbase/lease.sock", lease)
    return f"{text}{SLOW}commissioned: {{scale: {mark(load_robot(EXAMPLE).robot, 'scale')}}}\n"


def overlay(folder: Path) -> None:
    """`overlay` in `folder`: laid over the guest's root file system at each of its boots."""
    config = folder / "robot.yaml"
    config.write_text(robot_yaml("can0", "/run/canbase/robot/lease.sock"), encoding="utf-8")
    tree = folder / "overlay"
    options = ["--python", "/opt/canbase/bin/python", "--hardware-watchdog", str(HARDWARE_WATCHDOG_S)]
    command = [
        sys.executable,
        "-m",
        "canbase_cli",
        "setup",
        "install",
        "--config",
        str(config),
        "--prefix",
        str(tree),
        *options,
    ]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=_without_ros(os.environ))
    _drives(tree / "etc")
    _system(tree / "etc")
    ours, ignored = tree / "usr/lib/canbase-vm", shutil.ignore_patterns("__pycache__")
    shutil.copytree(HERE / "guest", ours / "vm/guest", ignore=ignored)
    shutil.copytree(HERE.parent / "exit_matrix", ours / "exit_matrix", ignore=ignored)
    (ours / "support").mkdir()
    independent_stacks.copy_to(independent_stacks.folder(), ours / "stacks")
    shutil.copy(HERE.parent / "support/bare_node.py", ours / "support")


def _without_ros(environment: Mapping[str, str]) -> dict[str, str]:
    """The guest's ROS is its own: `canbase setup install` would take over the domain of whoever runs this, where the
    scenarios would not find the robot."""
    return {name: value for name, value in environment.items() if not name.startswith(("ROS_", "RMW_"))}


def _drives(etc: Path) -> None:
    """The simulated drives on can1, and what runs the scenarios."""
    (etc / "canbase/drives.yaml").write_text(robot_yaml("can1", "/run/lease.sock"), encoding="utf-8")
    (etc / "canbase/can/can1.env").write_text("BITRATE=500000\nRESTART_MS=100\nTXQUEUELEN=100\n", encoding="utf-8")
    for name in ("job.service", "canbase-sim.service"):
        shutil.copy(HERE / "guest" / name, etc / "systemd/system")
        (etc / "systemd/system/multi-user.target.wants" / name).symlink_to(f"../{name}")


def _system(etc: Path) -> None:
    (etc / "systemd/journald.conf.d").mkdir()
    (etc / "systemd/journald.conf.d/vm.conf").write_text("[Journal]\nStorage=volatile\nRateLimitIntervalSec=0\n")
    (etc / "sysctl.d").mkdir()
    (etc / "sysctl.d/vm.conf").write_text(
        "kernel.sched_rt_runtime_us = -1\n"
    )  # real time may have all of one processor


def ramdisk(folder: Path, initrd: Path) -> Path:
    """`initrd` with the overlay behind it: the kernel unpacks both."""
    made = folder / "initrd.gz"
    listed = subprocess.run(["find", "overlay"], cwd=folder, check=True, capture_output=True).stdout
    command = ["cpio", "-o", "-H", "newc", "--quiet", "--owner=0:0"]
    archive = subprocess.run(command, cwd=folder, input=listed, check=True, capture_output=True).stdout
    first = initrd.read_bytes()
    made.write_bytes(first + bytes(-len(first) % ALIGNED) + archive)
    return made
