"""A safety relay on a GPIO line: the watchdog's service may open the chip, and it alone."""

from __future__ import annotations

import sys
from pathlib import Path, PurePosixPath

import pytest

from canbase_config.load import load_robot, sample
from canbase_config.watchdog_section import Relay
from canbase_deploy import host
from canbase_deploy.actions import Action, Remove, Run, WriteFile
from canbase_deploy.host import read_templates, rehearse
from canbase_deploy.plan import HARDENING, InstallError, Request, install_plan

TEMPLATES = Path(__file__).parents[3] / "deploy" / "systemd"
RULE = PurePosixPath("/etc/udev/rules.d/80-canbase-example-relay.rules")
APPLY = Run(("udevadm", "trigger", "--subsystem-match=gpio", "--action=change"))


def plan(chip: str | None, manifest: str = "") -> list[Action]:
    path = sample("example_can0")
    robot = load_robot(path).robot
    relay = Relay(chip=chip, line=3) if chip else None
    robot = robot.model_copy(update={"watchdog": robot.watchdog.model_copy(update={"relay": relay})})
    request = Request("example", robot, path.read_text(), "/opt/python", read_templates(TEMPLATES))
    return install_plan(request, {"example": manifest} if manifest else {})


def texts(actions: list[Action]) -> dict[PurePosixPath, str]:
    return {action.path: action.text for action in actions if isinstance(action, WriteFile)}


@pytest.mark.parametrize(
    ("chip", "device"),
    [
        ("/dev/gpiochip0", 'KERNEL=="gpiochip0"'),
        ("/dev/gpiochip12", 'KERNEL=="gpiochip12"'),
        ("/dev/gpio/relay-1", 'SYMLINK=="gpio/relay-1"'),
    ],
)
def test_the_services_group_may_open_the_chip_and_nobody_else(chip: str, device: str) -> None:
    assert texts(plan(chip))[RULE] == f'SUBSYSTEM=="gpio", {device}, GROUP="canbase", MODE="0660"\n'


def test_the_rule_comes_into_force_without_a_boot() -> None:
    actions = plan("/dev/gpiochip0")

    assert actions.index(APPLY) == actions.index(Run(("udevadm", "control", "--reload"))) + 1
    made = actions.index(Run(("systemd-sysusers", "/etc/sysusers.d/canbase.conf")))
    assert made < [getattr(action, "path", None) for action in actions].index(RULE)  # udev has to know the group


def test_of_the_services_the_watchdog_alone_sees_it() -> None:
    files = texts(plan("/dev/gpiochip0"))
    folder = PurePosixPath("/etc/systemd/system")

    assert [
        path.parent.name for path, text in files.items() if "DeviceAllow" in text or "PrivateDevices=no" in text
    ] == ["canbase-watchdog@example.service.d"]
    assert "\nPrivateDevices=yes\n" in files[folder / HARDENING]
    assert "\nGroup=canbase\n" in files[folder / "canbase-watchdog@.service"]


def test_a_robot_without_relay_gets_none_of_it_and_loses_what_it_had() -> None:
    actions = plan(None, f"{RULE}\n")

    assert RULE not in texts(actions)
    assert APPLY not in actions
    assert Remove(RULE) in actions


@pytest.mark.parametrize(
    "chip", ["gpiochip0", "/sys/x", '/dev/gpiochip0", RUN+="x', "/dev/gpiochip0 rw\nUser=root", "/dev/../x", "/dev/*"]
)
def test_what_is_no_device_is_refused(chip: str) -> None:
    with pytest.raises(InstallError, match=r"watchdog.relay.chip is .*expected a device such as /dev/gpiochip0"):
        plan(chip)


def test_a_python_without_gpiod_is_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(host, "HIDDEN", ("/nowhere/",))  # a checkout may be below /home
    (tmp_path / "gpiod.py").write_text("raise ModuleNotFoundError(\"No module named 'gpiod'\")\n")
    environment = {"PYTHONPATH": str(tmp_path)}

    rehearse(sys.executable, environment)
    with pytest.raises(InstallError, match=r"No module named 'gpiod'\. watchdog.relay needs it: .*pip install"):
        rehearse(sys.executable, environment, relay=True)
    rehearse(sys.executable, {}, relay=True)
