"""A robot to be installed, for tests: the sample for can0, its plan, and the plan carried out below a folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_deploy.actions import Action, WriteFile
from canbase_deploy.execute import Executor
from canbase_deploy.host import read_templates
from canbase_deploy.plan import Request

TEMPLATES = Path(__file__).parents[2] / "deploy" / "systemd"
EXAMPLE = sample("example_can0")
UNITS = "/etc/systemd/system"


def request(**changes: object) -> Request:
    """The sample as the robot `example`, with other fields of Request."""
    wanted = Request(
        name="example",
        robot=load_robot(EXAMPLE).robot,
        yaml=EXAMPLE.read_text(),
        python="/opt/canbase/bin/python",
        templates=read_templates(TEMPLATES),
    )
    return replace(wanted, **changes)  # type: ignore[arg-type]


def changed(**changes: object) -> Robot:
    """The sample with other sections."""
    return load_robot(EXAMPLE).robot.model_copy(update=changes)


def texts(actions: list[Action]) -> dict[str, str]:
    """Path and text of each file that is written."""
    return {str(action.path): action.text for action in actions if isinstance(action, WriteFile)}


def carried_out(root: Path, actions: list[Action]) -> list[str]:
    """The output while the actions are carried out below `root`."""
    said: list[str] = []
    Executor(root, said.append).carry_out(actions)
    return said


def files_below(root: Path) -> list[str]:
    """Files and links, as paths from `root`."""
    return sorted(f"/{path.relative_to(root)}" for path in root.rglob("*") if not path.is_dir())


def on_bus(**changes: str) -> Robot:
    """The sample with other keys in its section bus."""
    return changed(bus=load_robot(EXAMPLE).robot.bus.model_copy(update=changes))
