"""An upgrade to a version that needs a key more: refused while the robot drives; then done, and taken back.

The new version is the installed one with another model of robot.yaml, in a folder of its own (an overlay).
"""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Final

from canbase.msg import DriverStatus

from vm.guest.integrator import CANBASE, OPTIONS
from vm.guest.robot import SPEED_MPS, Robot
from vm.guest.scenario import Row
from vm.guest.system import LIMIT_S, ROBOT_YAML, TARGET, BrokenPromiseError, pids, run, show, unit

NEXT: Final = Path("/opt/canbase-next")
LAYERS: Final = Path("/run/canbase-next")
NEW_CANBASE: Final = (str(NEXT / "bin/python"), "-m", "canbase_cli")
ANCHOR: Final = "    base: Base\n"
KEY: Final = "payload_kg"
NEW_YAML: Final = Path("/run/new_robot.yaml")
OLD_YAML: Final = ROBOT_YAML.with_name("robot.yaml.old")
ONLINE: Final = "network-online.target"


def upgraded(robot: Robot) -> Row:
    """Nothing notices the refusal. With the key written the new version drives, and then the old one again."""
    robot.make_ready()
    before, text = pids(), ROBOT_YAML.read_text()
    _new_version()
    try:
        robot.drive()
        for more in (("--dry-run",), ()):
            _is_refused(*more)
        robot.spin(0.2)
        if robot.state != DriverStatus.ENABLED or robot.truth().linear_mps < 0.97 * SPEED_MPS or pids() != before:
            raise BrokenPromiseError(f"the robot noticed the refused upgrade: {robot.told()}")
        robot.order(None)
        NEW_YAML.write_text(f"{text}{KEY}: 30.0\n")
        run(*NEW_CANBASE, "setup", "install", "--config", str(NEW_YAML), "--network", "lan", *OPTIONS)
        if pids() != before:
            raise BrokenPromiseError("an installation has started a part again")
        _runs_by(robot, NEXT)
        if ONLINE not in show(unit("driver"), "After")[0] or ONLINE in show(unit("watchdog"), "After")[0]:
            raise BrokenPromiseError(f"with --network lan the driver, and it alone, waits for {ONLINE}")
        run(*CANBASE, "setup", "install", "--config", str(OLD_YAML), *OPTIONS)
        _runs_by(robot, Path("/opt/canbase"))
        if ONLINE in show(unit("driver"), "After")[0] or ROBOT_YAML.read_text() != text:
            raise BrokenPromiseError("the way back does not lead back")
    finally:
        robot.order(None)
        run("umount", "--lazy", str(NEXT), check=False)
    return Row(
        "canbase setup install", "an upgrade that needs a key more", then="refused at speed, unnoticed; done; undone"
    )


def _new_version() -> None:
    for folder in (NEXT, LAYERS / "new", LAYERS / "work"):
        folder.mkdir(parents=True)
    layers = f"lowerdir=/opt/canbase,upperdir={LAYERS / 'new'},workdir={LAYERS / 'work'}"
    run("mount", "-t", "overlay", "-o", layers, "overlay", str(NEXT))
    (module,) = NEXT.glob("lib/python*/site-packages/canbase_config/robot.py")
    for compiled in module.parent.glob("robot.*.so"):
        compiled.unlink()
    text = module.read_text()
    if ANCHOR not in text:
        raise BrokenPromiseError(f"no {ANCHOR!r} in {module}")
    module.write_text(text.replace(ANCHOR, f"    {KEY}: float\n{ANCHOR}"))


def _is_refused(*more: str) -> None:
    words = (*NEW_CANBASE, "setup", "install", *OPTIONS, *more)
    done = subprocess.run(words, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    wanted = (f"{KEY}: missing", "Nothing was changed", "canbase setup install --config COPY")
    if done.returncode != 2 or not all(each in done.stderr for each in wanted):
        raise BrokenPromiseError(f"{words}: exit code {done.returncode}: {done.stderr}{done.stdout}")


def _runs_by(robot: Robot, folder: Path) -> None:
    """After the restart that `canbase setup install` asks for, every part is of this version, and the robot is
    ready."""
    run("systemctl", "restart", TARGET)
    robot.make_ready()
    for pid in pids():
        words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
        if words[0] != str(folder / "bin/python"):
            raise BrokenPromiseError(f"process {pid} runs by {words[0]}, not by {folder}")
