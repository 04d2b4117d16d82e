"""`canbase config check`: whether this computer has the bus of robot.yaml, and what --quiet leaves out."""

from __future__ import annotations

from pathlib import Path

import pytest
from can import VALID_INTERFACES
from typer.testing import CliRunner

from canbase_cli.bus_here import bus_warnings, unknown_options
from canbase_cli.main import app
from canbase_config.load import sample
from canbase_config.robot import Bus


@pytest.fixture
def network(tmp_path: Path) -> Path:
    """/sys/class/net of a computer with lo, can0 that is up, and can1 that is down."""
    for name, kind, flags in (("lo", 772, 0x9), ("can0", 280, 0x40081), ("can1", 280, 0x40080)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(f"{kind}\n")
        (tmp_path / name / "flags").write_text(f"{flags:#x}\n")
    return tmp_path


def warnings(interface: str, channel: str, network: Path) -> list[str]:
    bus = Bus(interface=interface, channel=channel, extra={})
    return list(bus_warnings(bus, VALID_INTERFACES, network))


def test_a_bus_that_is_there_gives_no_warning(network: Path) -> None:
    assert warnings("socketcan", "can0", network) == []
    assert warnings("udp_multicast", "239.74.163.2", network) == []
    assert warnings("slcan", "/dev/null", network) == []


@pytest.mark.parametrize(
    ("channel", "told"),
    [
        ("can7", "bus.channel 'can7' is no network interface of this computer; CAN interfaces here: can0, can1"),
        ("lo", "bus.channel 'lo' is no CAN interface; CAN interfaces here: can0, can1"),
        ("can1", "bus.channel can1 is down: sudo ip link set can1 up type can bitrate 500000"),
    ],
)
def test_a_socketcan_channel_that_cannot_be_used_is_named(channel: str, told: str, network: Path) -> None:
    (warning,) = warnings("socketcan", channel, network)
    assert warning.startswith(told)


def test_a_computer_without_can_says_so(tmp_path: Path) -> None:
    (warning,) = warnings("socketcan", "can0", tmp_path)
    assert warning.endswith("CAN interfaces here: none")


def test_an_adapter_that_is_not_plugged_in_and_an_unknown_interface_are_named(network: Path) -> None:
    assert "no such device" in warnings("slcan", "/dev/no_such_adapter", network)[0]
    (warning,) = warnings("socketcam", "can0", network)
    assert warning.startswith("bus.interface is 'socketcam', expected one of ")
    assert "socketcan" in warning


def test_an_option_that_the_adapter_does_not_have_is_named_with_the_nearest() -> None:
    bus = Bus(interface="udp_multicast", channel="239.74.163.2", extra={"prot": 5, "hop_limit": 0, "auto_reset": 1})
    told = "bus.extra.prot is no option of python-can's udp_multicast: did you mean port?"
    assert list(unknown_options(bus, {"port", "hop_limit"})) == [told]


@pytest.mark.parametrize(("interface", "told"), [("udp_multicast", "bus.extra.prot is no option"), ("socketcam", "")])
def test_the_options_are_those_of_the_class_in_python_can(tmp_path: Path, interface: str, told: str) -> None:
    file = tmp_path / "robot.yaml"
    text = sample("bench").read_text().replace("interface: udp_multicast", f"interface: {interface}")
    file.write_text(text.replace("hop_limit:", "prot: 3\n    hop_limit:"))
    done = CliRunner().invoke(app, ["config", "check", str(file)])
    assert done.exit_code == 0
    assert ("bus.extra.prot" in done.stderr) is bool(told)
    assert told in done.stderr


def test_a_missing_channel_is_a_warning_and_quiet_prints_nothing(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(sample("example_can0").read_text().replace("can0", "can_none"))
    loud = CliRunner().invoke(app, ["config", "check", str(file)])
    assert loud.exit_code == 0
    assert "warning: bus.channel 'can_none' is no network interface" in loud.stderr

    for option in ("--quiet", "-q"):
        quiet = CliRunner().invoke(app, ["config", "check", option, str(file)])
        assert (quiet.exit_code, quiet.output) == (0, "")

    file.write_text("name: 3\n")
    wrong = CliRunner().invoke(app, ["config", "check", "--quiet", str(file)])
    assert wrong.exit_code == 2
    assert "cannot be used" in wrong.stderr
