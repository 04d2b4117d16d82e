"""The line of the safety relay on a chip that is not there: gpiod's own functions and names, without its hardware."""

from __future__ import annotations

import enum
import sys
from types import SimpleNamespace

import pytest

from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.watchdog import RelayLine, WatchdogConfig
from canbase_watchdog.ladder import Step
from canbase_watchdog.relay import Relay, RelayError
from unit.watchdog_story import FakeDrive, Story

LINE = RelayLine("/dev/gpiochip7", 5)


class Direction(enum.Enum):
    INPUT, OUTPUT = 2, 3


class Value(enum.Enum):
    INACTIVE, ACTIVE = 0, 1


class FakeChip:
    """One chip with 8 lines. `written`: what was set, in order; `gone`: it was unplugged."""

    def __init__(self) -> None:
        self.written: list[tuple[int, Value]] = []
        self.outputs: list[int] = []
        self.released = self.gone = False

    def request_lines(self, path: str, consumer: str, config: dict[int, SimpleNamespace]) -> FakeChip:
        if path != "/dev/gpiochip7":
            raise FileNotFoundError(2, "No such file or directory", path)
        self.outputs = [offset for offset, settings in config.items() if settings.direction is Direction.OUTPUT]
        if any(offset >= 8 for offset in config):
            raise ValueError("invalid line config")
        return self

    def set_value(self, line: int, value: Value) -> None:
        if self.gone:
            raise OSError(19, "No such device")
        self.written.append((line, value))

    def release(self) -> None:
        self.released = True


@pytest.fixture
def chip(monkeypatch: pytest.MonkeyPatch) -> FakeChip:
    it = FakeChip()
    names = SimpleNamespace(Direction=Direction, Value=Value)
    module = SimpleNamespace(request_lines=it.request_lines, LineSettings=SimpleNamespace, line=names)
    monkeypatch.setitem(sys.modules, "gpiod", module)
    return it


def test_the_line_is_toggled_and_left_inactive(chip: FakeChip) -> None:
    with Relay(LINE) as relay:
        for _ in range(3):
            relay.toggle()
        assert not chip.released
    assert chip.outputs == [5]
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
def test_a_line_that_cannot_be_had_says_where_to_look(chip: FakeChip, line: RelayLine) -> None:
    with pytest.raises(RelayError, match=r"cannot be had: .* Check watchdog\.relay \(gpioinfo"):
        Relay(line)


def test_without_the_package_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gpiod", None)
    with pytest.raises(RelayError, match=r"'gpiod>=2\.1'"):
        Relay(LINE)


def test_the_relay_opens_on_the_last_rung_alone() -> None:
    drive = FakeDrive(1)
    story = Story(drive)
    story.drive_at(300)
    drive.hears_pdo = drive.hears_sdo = drive.hears_nmt = story.filter = False
    kept = []
    for _ in range(100):
        story.run(0.01)
        kept.append((story.watchdog.status.step, story.watchdog.keeps_relay))
    assert {(step, keeps) for step, keeps in kept if keeps} == {(step, True) for step in list(Step)[:4]}
    assert kept[-1] == (Step.HEARTBEAT_WITHHELD, False)


def test_it_comes_from_robot_yaml_and_survives_the_command_line() -> None:
    values = load_robot(sample("bench")).robot.model_dump()
    values["watchdog"]["relay"] = {"chip": "/dev/gpiochip7", "line": 5}
    config = watchdog_config(Robot.model_validate(values))
    assert config.relay == LINE
    assert WatchdogConfig.from_json(config.to_json()) == config
