"""The line of the safety relay: gpiod as it is, on a chip whose kernel side alone is made up."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import gpiod
import pytest
from gpiod.line import Value

from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.watchdog import RelayLine, WatchdogConfig
from canbase_watchdog.ladder import Step
from canbase_watchdog.relay import Relay, RelayError
from support.watchdog_story import FakeDrive, Story

LINE = RelayLine("/dev/gpiochip7", 5)


class FakeChip:
    """What the kernel has of one chip with 8 lines. `written`: what was set, in order; `gone`: it was unplugged."""

    chip_name, offsets = "gpiochip7", [5]

    def __init__(self) -> None:
        self.written: list[tuple[int, Value]] = []
        self.consumer = ""
        self.released = self.gone = False

    def open(self, path: str) -> FakeChip:
        if path != "/dev/gpiochip7":
            raise FileNotFoundError(2, "No such file or directory", path)
        return self

    def close(self) -> None:
        """Only the chip: the request stays."""

    def get_info(self) -> SimpleNamespace:
        return SimpleNamespace(num_lines=8)

    def get_line_name(self, _offset: int) -> str:
        return ""

    def request_lines(self, _config: object, consumer: str, _events: None) -> FakeChip:
        self.consumer = consumer
        return self

    def set_values(self, values: dict[int, Value]) -> None:
        if self.gone:
            raise OSError(19, "No such device")
        self.written += values.items()

    def release(self) -> None:
        self.released = True


@pytest.fixture
def chip(monkeypatch: pytest.MonkeyPatch) -> FakeChip:
    it = FakeChip()
    monkeypatch.setattr("gpiod.chip._ext.Chip", it.open)
    return it


def test_the_line_is_an_output_that_begins_inactive(chip: FakeChip, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[gpiod.LineSettings] = []
    plain = gpiod.LineSettings

    def settings(**keys: object) -> gpiod.LineSettings:
        asked.append(plain(**keys))  # type: ignore[arg-type]
        return asked[-1]

    monkeypatch.setattr("gpiod.LineSettings", settings)
    with Relay(LINE):
        assert chip.consumer == "canbase serve watchdog"
    assert [(each.direction, each.output_value, each.active_low) for each in asked] == [
        (gpiod.line.Direction.OUTPUT, Value.INACTIVE, False)
    ]


def test_the_line_is_toggled_and_left_inactive(chip: FakeChip) -> None:
    with Relay(LINE) as relay:
        for _ in range(3):
            relay.toggle()
        assert not chip.released
    assert chip.written == [(5, Value.ACTIVE), (5, Value.INACTIVE), (5, Value.ACTIVE), (5, Value.INACTIVE)]
    assert chip.released


def test_an_exception_leaves_it_inactive_too(chip: FakeChip) -> None:
    def fail_after(relay: Relay) -> None:
        relay.toggle()
        raise KeyError

    with pytest.raises(KeyError), Relay(LINE) as relay:
        fail_after(relay)
    assert (chip.written[-1], chip.released) == ((5, Value.INACTIVE), True)


def unplugged(chip: FakeChip, relay: Relay) -> None:
    chip.gone = True
    relay.toggle()


def test_a_line_that_is_gone_is_told_and_released(chip: FakeChip) -> None:
    with (
        pytest.raises(RelayError, match=r"line 5 of /dev/gpiochip7 cannot be set: .*No such device"),
        Relay(LINE) as relay,
    ):
        unplugged(chip, relay)
    assert chip.released


@pytest.mark.parametrize("line", [RelayLine("/dev/gpiochip8", 5), RelayLine("/dev/gpiochip7", 8)])
@pytest.mark.usefixtures("chip")
def test_a_line_that_cannot_be_had_says_where_to_look(line: RelayLine) -> None:
    with pytest.raises(RelayError, match=r"cannot be had: .* Check watchdog\.relay \(gpioinfo"):
        Relay(line)


@pytest.mark.parametrize("path", ["/dev/gpiochip-that-is-not-there", "/dev/null", "/proc/self/environ", ""])
def test_so_does_the_kernel_of_this_computer_for_what_is_no_chip(path: str) -> None:
    with pytest.raises(RelayError, match=rf"line 5 of {path} cannot be had: "):
        Relay(RelayLine(path, 5))


def test_without_the_package_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gpiod", None)
    with pytest.raises(RelayError, match=r"'gpiod>=2\.1'"):
        Relay(LINE)


def test_the_relay_opens_on_the_last_rungs_alone() -> None:
    drive = FakeDrive(1)
    story = Story(drive)
    story.drive_at(300)
    drive.hears_pdo = drive.hears_sdo = drive.hears_nmt = story.filter = False
    kept = []
    for _ in range(100):
        story.run(0.01)
        kept.append((story.watchdog.status.step, story.watchdog.keeps_relay))
    assert {(step, keeps) for step, keeps in kept if keeps} == {(step, True) for step in list(Step)[:4]}
    assert {(step, keeps) for step, keeps in kept if not keeps} == {(step, False) for step in list(Step)[4:]}


def test_it_comes_from_robot_yaml_and_survives_the_command_line() -> None:
    values = load_robot(sample("bench")).robot.model_dump()
    values["watchdog"]["relay"] = {"chip": "/dev/gpiochip7", "line": 5}
    config = watchdog_config(Robot.model_validate(values))
    assert config.relay == LINE
    assert WatchdogConfig.from_json(config.to_json()) == config
