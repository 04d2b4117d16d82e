"""What the velocity process notes of the inputs of mux and filter, and when a file is due."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from canbase_campaign.robots import campaign_robot
from canbase_runtime.driver_state import DriverState
from canbase_velocity import input_ring
from canbase_velocity.core_state import plain
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.input_ring import CHECKPOINT_S, InputRing, Stop, StopWatch, head, lines
from canbase_velocity.mux import Mux
from canbase_velocity.safety_filter import FilterConfig
from canbase_velocity.scan import Scan

ROBOT = campaign_robot()
LATCHED, ENABLED, STOPPING = DriverState.LATCHED, DriverState.ENABLED, DriverState.STOPPING


def cores() -> tuple[Mux, SafetyFilter]:
    return Mux(ROBOT.mux.sources), SafetyFilter(FilterConfig.of(ROBOT))


def scan(beams: int) -> Scan:
    return Scan(np.full(beams, 2.0, np.float32), -1.0, 2.0 / beams, 0.1, 10.0)


def test_what_is_older_than_the_recording_and_a_checkpoint_is_forgotten() -> None:
    ring, (mux, safety) = InputRing(10.0), cores()
    for tenth in range(400):
        ring.note("obey", tenth / 10, tenth / 10)
        ring.keep_recent(mux, safety, tenth / 10)
    kept = ring.cut()
    assert kept[0][1] == pytest.approx(39.9 - 10.0 - CHECKPOINT_S, abs=0.11)
    states = [each[1] for each in kept if each[0] == "state"]
    assert states == pytest.approx([25.0, 30.0, 35.0], abs=0.1)


def test_large_scans_make_it_shorter_and_not_larger() -> None:
    ring, (mux, safety) = InputRing(10.0), cores()
    for number in range(100):
        ring.note("scan", number / 100, "scan", scan(50_000), None)
        ring.keep_recent(mux, safety, number / 100)
    assert len([each for each in ring.cut() if each[0] == "scan"]) == input_ring.MAX_SCAN_BYTES // 200_000


def test_a_flood_of_messages_makes_it_shorter_and_not_larger(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(input_ring, "MAX_INPUTS", 100)
    ring, (mux, safety) = InputRing(10.0), cores()
    for number in range(500):
        ring.note("obey", 1.0, float(number))
    ring.keep_recent(mux, safety, 1.0)
    assert len(ring.cut()) == 100


def test_a_file_begins_with_the_first_state_and_has_no_other_one() -> None:
    ring, (mux, safety) = InputRing(10.0), cores()
    ring.note("obey", 0.5, 0.5)
    for now_s in (1.0, 6.5):
        ring.keep_recent(mux, safety, now_s)
        ring.note("scan", now_s, "scan", scan(3), None)
    first = head(ROBOT, FilterConfig.of(ROBOT), Stop(6.0, "estop"), 1.79e9)
    told = [json.loads(line) for line in lines(first, ring.cut())]
    assert [each[0] for each in told[1:]] == ["state", "scan", "scan"]
    assert (told[0]["part"], told[0]["stop"]) == ("velocity", {"at_s": 6.0, "cause": "estop"})
    assert told[2][3]["ranges_m"]["kind"] == "<f4"


def test_of_a_state_that_has_a_function_in_it_nothing_is_written() -> None:
    with pytest.raises(TypeError, match="function is no state of a core"):
        plain({"do": lambda: None})
    assert plain([math.inf, b"a", (1, None)]) == [{"float": "inf"}, {"bytes": "YQ=="}, {"tuple": [1, None]}]


# driver LATCHED ── 1 s ── due; LATCHED until the reset is one stop
def test_a_latched_driver_is_one_stop() -> None:
    watch = StopWatch()
    assert watch.due_stop(DriverState.OFFLINE, True, 0.0) is None
    assert watch.due_stop(ENABLED, True, 1.0) is None
    assert watch.due_stop(LATCHED, True, 2.0) is None
    assert watch.due_stop(LATCHED, True, 2.9) is None
    assert watch.due_stop(LATCHED, True, 3.0) == Stop(2.0, "driver")
    assert watch.due_stop(LATCHED, True, 9.0) is None
    assert watch.due_stop(ENABLED, True, 10.0) is None
    assert watch.due_stop(LATCHED, True, 11.0) is None
    assert watch.due_stop(STOPPING, True, 12.0) == Stop(11.0, "driver")


def test_the_button_is_a_stop_and_what_follows_is_the_same_one() -> None:
    watch = StopWatch()
    watch.due_stop(ENABLED, True, 1.0)
    watch.due_stop(ENABLED, False, 2.0)
    watch.due_stop(LATCHED, False, 2.5)
    assert watch.due_stop(LATCHED, False, 3.0) == Stop(2.0, "estop")
    assert watch.due_stop(LATCHED, False, 9.0) is None


def test_what_was_latched_at_the_start_is_no_new_stop() -> None:
    watch = StopWatch()
    for now_s in (0.0, 1.0, 2.0):
        assert watch.due_stop(LATCHED, False, now_s) is None
