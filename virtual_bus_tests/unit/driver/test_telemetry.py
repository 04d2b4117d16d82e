"""Voltage, current, temperature: asked for now and then, one at a time, and never in the way of anything."""

from __future__ import annotations

import math

import pytest

from canbase_config.drive import Drive
from canbase_driver.cia301.frame import Frame
from canbase_driver.drives.telemetry import PERIOD_S, Measures
from support.fake_drive import FakeDrive, Key, u16


def drives(profile: str) -> tuple[Drive, ...]:
    wheel = {"node_id": 1, "side": "left", "gear_ratio": 20.0, "counts_per_motor_rev": 4096, "profile": profile}
    count = 2 if profile == "roboteq" else 1
    return tuple(Drive.model_validate(wheel | {"joint": f"wheel_{i}", "axis": i}) for i in range(count))


EPOS4: dict[Key, bytes] = {
    (0x2200, 1): u16(481),
    (0x30D1, 1): (-1250).to_bytes(4, "little", signed=True),
    (0x3201, 1): (315).to_bytes(2, "little", signed=True),
}


class Story:
    """A node that is asked every 10 ms whether it wants to ask."""

    def __init__(self, objects: dict[Key, bytes], profile: str = "epos4") -> None:
        self.drive = FakeDrive(objects=objects)
        self.measures = Measures(1, drives(profile), 0.3)
        self.now_s = 10.0
        self.sent = 0

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            self.now_s += 0.01
            frames = self.measures.tick(self.now_s)
            assert len(frames) <= 1
            self.sent += len(frames)
            for frame in frames:
                for answer in self.drive.on_frame(frame):
                    self.measures.on_frame(answer, self.now_s)


def test_everything_is_known_after_one_round() -> None:
    story = Story(EPOS4)
    story.run(3 * PERIOD_S + 0.02)
    values = story.measures.values(0, story.now_s)
    assert (values.voltage_v, values.current_a, values.temperature_c) == pytest.approx((48.1, -1.25, 31.5))
    assert story.sent == 3


def test_what_a_drive_does_not_have_is_asked_for_once() -> None:
    story = Story({(0x2200, 1): u16(240)})
    story.run(5.0)
    values = story.measures.values(0, story.now_s)
    assert values.voltage_v == pytest.approx(24.0)
    assert math.isnan(values.current_a)
    assert story.drive.transfers == pytest.approx(5.0 / PERIOD_S, abs=1)


def test_a_silent_drive_is_not_hammered_and_its_values_age() -> None:
    story = Story(EPOS4)
    story.run(1.0)
    story.drive.powered = False
    before = story.sent
    story.run(12.0)
    assert math.isnan(story.measures.values(0, story.now_s).voltage_v)
    assert story.sent - before <= 2 * 12.0 / 0.3  # a request and its abort
    story.drive.powered = True
    story.run(1.5)
    assert story.measures.values(0, story.now_s).voltage_v == pytest.approx(48.1)


def test_the_second_motor_is_the_next_sub_index() -> None:
    story = Story({(0x2100, 1): u16(10), (0x2100, 2): u16(25), (0x210D, 2): u16(480), (0x210F, 2): u16(40)}, "roboteq")
    story.run(2.0)
    assert story.measures.values(0, story.now_s).current_a == pytest.approx(1.0)
    assert story.measures.values(1, story.now_s).current_a == pytest.approx(2.5)
    assert story.measures.values(1, story.now_s).voltage_v == pytest.approx(48.0)


def test_answers_to_somebody_elses_requests_are_no_values() -> None:
    story = Story({})
    story.measures.on_frame(Frame(0x581, bytes.fromhex("4b 00 22 01 ff ff 00 00")), story.now_s)
    assert math.isnan(story.measures.values(0, story.now_s).voltage_v)


def test_a_drive_without_any_is_never_asked() -> None:
    story = Story({}, "generic")
    story.run(2.0)
    assert story.sent == 0
