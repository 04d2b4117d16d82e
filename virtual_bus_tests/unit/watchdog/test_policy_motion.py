"""The checks of motion, drives, other masters and the bus: each trips just beyond its limit, and tells the values."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from canbase_config.watchdog import WatchedDrive
from canbase_watchdog.envelope import Bounds
from canbase_watchdog.frames import DriveState
from canbase_watchdog.motion_evidence import Evidence
from canbase_watchdog.plausibility import Feedback
from canbase_watchdog.policy import CHECKS, clears_on, decide, stands
from canbase_watchdog.second_master import Sign
from canbase_watchdog.torque_evidence import TorqueEvidence
from canbase_watchdog.trip_cause import FINE, TripCause, Verdict
from canbase_watchdog.view import Axis
from support.watchdog_views import AT_REST, CONFIG, LEFT, NOW, OFF, RIGHT, STANDING, cause, of, well

# Tolerance of a target: 0.03 m/s + one bit of 0.001 m/s + 3 % of the allowed speed. Track 0.4 m.
STRAIGHT = Bounds(-0.1, 0.4, 0.0, 0.0)  # + 0.03 + 0.001 + 0.012


def detail(*axes: Axis, **changes: Any) -> str:
    return decide(of(*axes, **changes), CONFIG, NOW).detail


# --- target outside the envelope


@pytest.mark.parametrize(
    ("target_mps", "trips"),
    [(0.4, 0), (0.4429, 0), (0.4431, 4), (0.0, 0), (-0.1, 0), (-0.1429, 0), (-0.1431, 4), (5.0, 4), (-5.0, 4)],
)
def test_a_target_may_leave_what_the_leases_allow_by_its_tolerance(target_mps: float, trips: int) -> None:
    assert cause(of(replace(AT_REST, target_mps=target_mps), bounds=STRAIGHT)) == trips


@pytest.mark.parametrize(("target_mps", "trips"), [(0.0309, 0), (0.0311, 4), (-0.0309, 0), (-0.0311, 4)])
def test_while_zero_is_ordered_little_is_left(target_mps: float, trips: int) -> None:
    assert cause(of(replace(AT_REST, target_mps=target_mps), bounds=Bounds(0.0, 0.0, 0.0, 0.0))) == trips


def test_the_share_counts_backward_too() -> None:
    backward = Bounds(-0.9, 0.0, 0.0, 0.0)  # + 0.03 + 0.001 + 0.027
    assert cause(of(replace(AT_REST, target_mps=-0.9579), bounds=backward)) == 0
    assert cause(of(replace(AT_REST, target_mps=-0.9581), bounds=backward)) == 4


def test_one_coarse_bit_is_no_reason() -> None:
    coarse = replace(LEFT.drive, mps_per_bit=-0.02)
    axis = replace(AT_REST, drive=coarse, target_mps=0.0499)
    assert cause(of(axis, bounds=Bounds(0.0, 0.0, 0.0, 0.0))) == 0
    assert cause(of(replace(axis, target_mps=0.0501), bounds=Bounds(0.0, 0.0, 0.0, 0.0))) == 4


def test_a_turn_to_the_left_allows_the_right_wheel_forward_and_the_left_one_backward() -> None:
    turn = Bounds(0.0, 0.0, 0.0, 1.0)  # ± 0.2 m/s at the rims, + 0.03 + 0.001 + 0.006
    right = replace(RIGHT, velocity_mps=0.0, target_mps=0.2)
    left = replace(AT_REST, target_mps=-0.2)
    assert cause(of(left, right, bounds=turn)) == 0
    assert cause(of(replace(left, target_mps=-0.2369), replace(right, target_mps=0.2369), bounds=turn)) == 0
    assert cause(of(replace(left, target_mps=-0.2371), right, bounds=turn)) == 4
    assert cause(of(replace(left, target_mps=0.0371), right, bounds=turn)) == 4
    assert cause(of(AT_REST, replace(right, target_mps=0.2371), bounds=turn)) == 4
    assert cause(of(AT_REST, replace(right, target_mps=-0.0371), bounds=turn)) == 4


@pytest.mark.parametrize(("sign", "bounds"), [(1, Bounds(0.0, 1.0, 0.0, 4.0)), (-1, Bounds(-1.0, 0.0, 0.0, 4.0))])
def test_no_wheel_is_allowed_more_than_the_driver_lets_any_wheel_turn(sign: int, bounds: Bounds) -> None:
    axis = replace(STANDING if sign > 0 else AT_REST, drive=RIGHT.drive if sign > 0 else LEFT.drive)
    within, beyond = replace(axis, target_mps=sign * 1.0609), replace(axis, target_mps=sign * 1.0611)
    assert cause(of(within, replace(STANDING, drive=LEFT.drive), bounds=bounds)) == 0  # 1.0 + 0.031 + 0.03
    assert cause(of(beyond, replace(STANDING, drive=LEFT.drive), bounds=bounds)) == 4


@pytest.mark.parametrize(
    ("state", "asks", "counts"),
    [
        (DriveState.OPERATION_ENABLED, True, True),
        (DriveState.OPERATION_ENABLED, False, True),
        (DriveState.SWITCHED_ON, True, True),  # it would begin with this target
        (DriveState.SWITCHED_ON, False, False),
        (None, True, True),
    ],
)
def test_a_target_counts_for_a_drive_that_is_enabled_or_told_to_be(
    state: DriveState | None, asks: bool, counts: bool
) -> None:
    axis = replace(AT_REST, state=state, asks_for_power=asks, target_mps=0.9)
    assert (cause(of(axis)) == 4) is counts


def test_the_sentence_about_a_target_has_the_values() -> None:
    assert detail(replace(AT_REST, target_mps=0.8), bounds=STRAIGHT) == (
        "wheel_1_0 is ordered 0.800 m/s, the leases allow -0.100 to 0.400 m/s (tolerance 0.043 m/s)"
    )
    verdict = decide(of(AT_REST, replace(STANDING, target_mps=0.8), bounds=STRAIGHT), CONFIG, NOW)
    assert (verdict.cause, verdict.node_id) == (TripCause.TARGET_OUTSIDE, 2)


def test_setpoints_that_do_not_go_together_are_about_no_single_node() -> None:
    verdict = decide(of(AT_REST, skew="2.000 rad/s together"), CONFIG, NOW)
    assert verdict == Verdict(TripCause.TARGET_OUTSIDE, 0, "left and right wheels are ordered 2.000 rad/s together")


# --- feedback: so many samples in a row

COUNTS = [
    ("outside_samples", TripCause.MOTION_OUTSIDE),
    ("overspeed_samples", TripCause.OVERSPEED),
    ("implausible_samples", TripCause.FEEDBACK_IMPLAUSIBLE),
]


@pytest.mark.parametrize(("count", "found"), COUNTS)
@pytest.mark.parametrize(("samples", "trips"), [(0, False), (4, False), (5, True), (6, True)])
def test_feedback_counts_after_five_bad_samples_in_a_row(
    count: str, found: TripCause, samples: int, trips: bool
) -> None:
    bad = Feedback(**{count: samples})
    assert (cause(of(replace(AT_REST, feedback=bad))) is found) is trips
    assert (cause(of(AT_REST, replace(STANDING, feedback=bad))) is found) is trips
    unpowered = replace(OFF, drive=RIGHT.drive)
    assert cause(of(replace(OFF, feedback=bad), unpowered)) == 0
    assert (cause(of(replace(AT_REST, state=DriveState.QUICK_STOP_ACTIVE, feedback=bad), unpowered)) is found) is trips


def test_the_sentences_about_feedback_have_the_values() -> None:
    fast = replace(LEFT, velocity_mps=1.3)
    slow = replace(CONFIG, max_wheel_mps=0.5)
    assert decide(of(replace(AT_REST, feedback=Feedback(overspeed_samples=5))), slow, NOW).detail.endswith(
        "(allowed 0.600 m/s)"
    )
    right = replace(STANDING, target_mps=0.3)
    assert detail(replace(fast, feedback=Feedback(-0.1, 0.5, outside_samples=5)), right) == (
        "wheel_1_0 turns at 1.300 m/s, its setpoints allow -0.100 to 0.500 m/s (watchdog.drive_lag_s 0.1 s)"
    )
    for setpoint_mps, against in ((0.3, False), (0.0, False), (-0.001, True)):
        outside = replace(fast, setpoint_mps=setpoint_mps, feedback=Feedback(-0.1, 0.5, outside_samples=5))
        assert detail(outside, right).endswith(
            "; by 606Ch it turns the other way: see `direction` in robot.yaml, motor phases, encoder"
        ) is (against)
    assert detail(replace(fast, feedback=Feedback(overspeed_samples=5)), right) == (
        "wheel_1_0 turns at 1.300 m/s (allowed 1.200 m/s)"
    )
    assert detail(replace(fast, feedback=Feedback(implausible_samples=5, drift_m=-0.06)), right) == (
        "wheel_1_0 reports 1.300 m/s, and its encoder contradicts it: -0.060 m apart (allowed 0.050 m)"
    )
    verdicts = [
        decide(of(AT_REST, replace(STANDING, feedback=Feedback(**{count: 5}))), CONFIG, NOW) for count, _ in COUNTS
    ]
    assert [verdict.node_id for verdict in verdicts] == [2, 2, 2]


# --- sensors that show what no wheel can do, and wheels that do not show their orders

EVIDENCE = [
    (Evidence(halted_samples=5, setpoint_mps=0.3), TripCause.FEEDBACK_IMPLAUSIBLE),
    (Evidence(velocity_jumps=5), TripCause.FEEDBACK_IMPLAUSIBLE),
    (Evidence(unseen=True, both_s=0.3, both_m=0.09, setpoint_mps=0.3), TripCause.MOTION_MISSING),
    (Evidence(behind_s=0.5, ordered_mps=0.3), TripCause.MOTION_MISSING),
    (Evidence(strained_s=0.25, setpoint_mps=0.3), TripCause.MOTION_MISSING),
]


@pytest.mark.parametrize(("evidence", "found"), EVIDENCE)
def test_evidence_against_a_wheel_trips(evidence: Evidence, found: TripCause) -> None:
    verdict = decide(of(AT_REST, replace(STANDING, evidence=evidence)), CONFIG, NOW)
    assert (verdict.cause, verdict.node_id) == (found, 2)
    assert verdict.detail.startswith("wheel_2_0 ")
    assert cause(of(replace(AT_REST, evidence=evidence))) is found
    unpowered = replace(OFF, drive=RIGHT.drive)
    assert cause(of(replace(OFF, evidence=evidence), unpowered)) == 0
    stopping = of(replace(AT_REST, state=DriveState.QUICK_STOP_ACTIVE, evidence=evidence), unpowered)
    assert cause(stopping) is (found if found is TripCause.FEEDBACK_IMPLAUSIBLE else TripCause.NONE)
    assert not stands(verdict, of(replace(OFF, evidence=evidence)), CONFIG, NOW)


@pytest.mark.parametrize(
    "evidence",
    [
        Evidence(halted_samples=4),
        Evidence(velocity_jumps=4),
        Evidence(unseen_s=9.0, unseen_m=9.0),
        Evidence(behind_s=0.499),
        Evidence(strained_s=0.249),
    ],
)
def test_a_little_less_does_not(evidence: Evidence) -> None:
    assert cause(of(replace(AT_REST, evidence=evidence))) == 0


def test_the_sentences_about_evidence_have_the_values() -> None:
    slow = replace(AT_REST, velocity_mps=0.1, target_mps=0.3)
    said = [detail(replace(slow, evidence=evidence), replace(RIGHT, target_mps=0.3)) for evidence, _ in EVIDENCE]
    assert said == [
        "wheel_1_0 reports standstill at once, and no motion since, with 0.300 m/s ordered: "
        "no wheel stops so fast (watchdog.jolt_mps2 20 m/s²)",
        "wheel_1_0 reports 0.100 m/s, and 5 changes of speed that no wheel can do (watchdog.jolt_mps2 20 m/s²)",
        "wheel_1_0 is ordered 0.300 m/s, and its encoder has not moved for 0.300 s and 0.090 m of its orders "
        "(allowed 0.250 s and 0.010 m, to and fro 2 times that way: watchdog.motion_missing_m); it reports 0.100 m/s: "
        "see encoder, motor, wheel, or a brake that opens late (watchdog.motion_missing_s)",
        "wheel_1_0 turns at 0.100 m/s, its setpoints order 0.300 m/s for 0.500 s "
        "(allowed 0.500 s; slow ramps: watchdog.slowest_ramp_mps2)",
        "wheel_1_0 is pushed with a torque that the drive does not report and gets no faster than 0.100 m/s for "
        "0.250 s (allowed 0.250 s), ordered 0.300 m/s: its encoder may lose counts, or its load is too heavy",
    ]


# --- a drive that pushes at a stand


@pytest.mark.parametrize(("overdue_s", "trips"), [(0.199, 0), (0.2, 17), (0.5, 17)])
def test_a_drive_that_pushes_at_a_stand_and_does_not_let_go_trips(overdue_s: float, trips: int) -> None:
    held = replace(AT_REST, torque=TorqueEvidence(0.4, 0.05, release_due=True, overdue_s=overdue_s))
    assert cause(of(held)) == trips
    assert cause(of(replace(held, state=DriveState.SWITCH_ON_DISABLED), replace(OFF, drive=RIGHT.drive))) == 0


def test_the_sentence_about_power_at_a_stand_has_the_values() -> None:
    verdict = decide(of(AT_REST, replace(STANDING, torque=TorqueEvidence(0.4, overdue_s=0.3))), CONFIG, NOW)
    assert (verdict.cause, verdict.node_id) == (TripCause.POWER_AT_STAND, 2)
    assert verdict.detail == (
        "wheel_2_0 is ordered 0.000 m/s, reports 0.000 m/s and has been held with 40% of the rated torque for "
        "0.300 s (allowed 0.200 s) without release of the wheel: its encoder may be dead "
        "(watchdog.stand_proof, watchdog.stand_answer_s)"
    )
    untold = replace(AT_REST, torque=TorqueEvidence(None, overdue_s=0.3))
    assert "held with a torque that the drive does not report for 0.300 s" in detail(untold)


def test_the_sentence_about_a_push_in_vain_has_the_torque() -> None:
    assert detail(replace(AT_REST, torque=TorqueEvidence(0.7, vain_s=CONFIG.motion_missing_s))) == (
        "wheel_1_0 is pushed with 70% of the rated torque and shows no motion for 0.250 s (allowed 0.250 s), "
        "ordered 0.000 m/s: see encoder, motor, wheel, or a brake that opens late (watchdog.motion_missing_s)"
    )


def test_a_base_that_moves_otherwise_trips_without_a_node() -> None:
    verdict = decide(of(AT_REST, twist="1.000 rad/s together"), CONFIG, NOW)
    assert verdict == Verdict(TripCause.TWIST_OUTSIDE, 0, "the base does not move as ordered: 1.000 rad/s together")


# --- frames of one axis: 0.1 s at 100 Hz are 10 SYNCs


@pytest.mark.parametrize(
    ("count", "found"),
    [("missed_setpoints", TripCause.SETPOINT_MISSING), ("double_answers", TripCause.ANSWERED_TWICE)],
)
@pytest.mark.parametrize(("syncs", "trips"), [(0.0, False), (9.5, False), (10.0, True), (10.5, True)])
def test_ten_bad_syncs_are_enough(count: str, found: TripCause, syncs: float, trips: bool) -> None:
    bad: dict[str, Any] = {count: syncs}
    verdict = decide(of(AT_REST, replace(STANDING, **bad)), CONFIG, NOW)
    assert ((verdict.cause, verdict.node_id) == (found, 2)) is trips
    assert (cause(of(replace(AT_REST, **bad))) is found) is trips
    assert cause(of(replace(OFF, **bad), replace(OFF, drive=RIGHT.drive, **bad))) == 0
    assert not stands(verdict, of(replace(OFF, **bad)), CONFIG, NOW)


def test_the_sentences_about_frames_have_the_values() -> None:
    assert detail(replace(AT_REST, missed_setpoints=10.0, setpoint_at=99.9)) == (
        "wheel_1_0 is enabled, and SYNCs come without setpoints for it: the last one is 0.100 s old (allowed 0.100 s)"
    )
    assert detail(replace(AT_REST, double_answers=10.0)) == (
        "two drives answer as node 1, that of wheel_1_0: give each its own id (canbase bus scan names "
        "them). If there is "
        "one alone, a gateway, a bridge or a second interface sends its frames again: take it out"
    )
    assert detail(replace(AT_REST, double_answers=10.0, copied_at=NOW)) == (
        "node 1, that of wheel_1_0, answers twice, with the same data within 2 ms: take out the gateway, the "
        "bridge or the second interface that sends its frames again. If there is none, two drives have this id "
        "(canbase bus scan names them): give each its own"
    )


# --- a drive that is down while another one moves: the driver has 0.1 s


@pytest.mark.parametrize(
    "state",
    [state for state in DriveState if state is not DriveState.OPERATION_ENABLED] + [None],
)
@pytest.mark.parametrize(("since_s", "trips"), [(0.099, 0), (0.101, 7), (math.inf, 7)])
def test_a_drive_is_down_while_the_other_one_turns(state: DriveState | None, since_s: float, trips: int) -> None:
    down = replace(AT_REST, state=state, disabled_since=NOW - since_s)
    assert cause(of(down, RIGHT)) == trips
    assert cause(of(replace(LEFT, velocity_mps=0.0), replace(down, drive=RIGHT.drive))) == trips  # ordered to turn
    assert cause(of(replace(LEFT, target_mps=0.0), replace(down, drive=RIGHT.drive))) == trips  # turns
    assert cause(of(down, STANDING)) == 0
    assert cause(of(down, replace(RIGHT, state=DriveState.QUICK_STOP_ACTIVE))) == 0  # is being stopped


def test_a_drive_that_comes_last_has_as_long() -> None:
    assert cause(of(replace(OFF, disabled_since=90.0), replace(RIGHT, enabled_since=99.901))) == 0
    assert cause(of(replace(OFF, disabled_since=90.0), replace(RIGHT, enabled_since=99.899))) == 7


def test_the_drive_that_is_down_is_named() -> None:
    verdict = decide(of(replace(OFF, state=DriveState.FAULT), RIGHT), CONFIG, NOW)
    assert (verdict.cause, verdict.node_id) == (TripCause.DRIVE_DOWN, 1)
    assert verdict.detail == (
        "wheel_1_0 is not enabled (state: fault) while wheel_2_0 turns at 0.300 m/s, ordered 0.300 m/s"
    )
    assert "(state: unknown)" in detail(replace(OFF, state=None), RIGHT)
    assert "(state: switch on disabled)" in detail(OFF, RIGHT)


# --- another master


@pytest.mark.parametrize(("age_s", "trips"), [(0.0, 8), (0.999, 8), (1.001, 0)])
def test_a_sign_of_another_master_counts_for_a_second_while_a_drive_is_enabled(age_s: float, trips: int) -> None:
    sign = Sign(NOW - age_s, 2, "NMT command 1")
    assert cause(of(AT_REST, foreign=sign)) == trips
    assert cause(of(OFF, replace(OFF, drive=RIGHT.drive), foreign=sign)) == 0
    assert stands(Verdict(TripCause.FOREIGN_MASTER, 2), of(OFF, foreign=sign), CONFIG, NOW) is (trips == 8)


def test_the_sign_is_told() -> None:
    verdict = decide(of(AT_REST, foreign=Sign(NOW, 2, "NMT command 1")), CONFIG, NOW)
    assert verdict == Verdict(
        TripCause.FOREIGN_MASTER, 2, "another master or process commands the drives: NMT command 1"
    )
    assert not stands(verdict, of(OFF), CONFIG, NOW)


@pytest.mark.parametrize(
    ("copied", "first", "then"),
    [
        (
            True,
            "frames come twice, or another master is on the bus: S. ",
            "If there is none, stop the other master",
        ),
        (
            False,
            "another master is on the bus, or frames are sent again: S. ",
            "If there is none, take out the gateway",
        ),
    ],
)
def test_frames_that_come_twice_trip_whatever_the_reason_and_the_likelier_one_comes_first(
    copied: bool, first: str, then: str
) -> None:
    verdict = decide(of(AT_REST, foreign=Sign(NOW, 0, "S", copied)), CONFIG, NOW)
    assert verdict.cause is TripCause.FOREIGN_MASTER
    assert verdict.detail.startswith(first)
    assert then in verdict.detail
    assert "canbase bus scan" in verdict.detail or "candump" in verdict.detail
    longest = decide(of(AT_REST, foreign=Sign(NOW, 0, "S" * 120, copied)), CONFIG, NOW)
    assert len(longest.detail.encode()) < 512, "the record of a trip keeps 512 bytes"


# --- the bus


@pytest.mark.parametrize(("failed_s", "trips"), [(0.0, 0), (0.099, 0), (0.101, 9), (-math.inf, 0)])
def test_a_bus_that_takes_no_frames_for_a_moment_while_a_drive_is_enabled(failed_s: float, trips: int) -> None:
    since = NOW - failed_s
    assert cause(of(AT_REST, bus_failed_since=since)) == trips
    assert cause(of(OFF, replace(OFF, drive=RIGHT.drive), bus_failed_since=since)) == 0
    assert stands(Verdict(TripCause.BUS_FAILED), of(OFF, bus_failed_since=since), CONFIG, NOW) is (trips == 9)


def test_the_sentence_about_the_bus_has_the_values() -> None:
    assert detail(AT_REST, bus_failed_since=99.5) == "the bus takes no frames for 0.500 s (allowed 0.100 s)"


# --- the very moment, in binary fractions

EXACT = replace(
    CONFIG, feedback_timeout_s=0.125, bus_failed_s=0.125, target_tolerance_mps=0.125, target_tolerance_share=0.0
)


def exact_drive(drive: WatchedDrive) -> WatchedDrive:
    return replace(drive, mps_per_bit=0.0)


def test_at_the_very_moment_it_trips() -> None:
    down = replace(OFF, disabled_since=99.875)
    assert decide(of(down, RIGHT), EXACT, NOW).cause is TripCause.DRIVE_DOWN
    assert decide(of(AT_REST, bus_failed_since=99.875), EXACT, NOW).cause is TripCause.BUS_FAILED
    assert decide(of(AT_REST, foreign=Sign(99.0, 0, "")), EXACT, NOW) == FINE
    assert not stands(Verdict(TripCause.FOREIGN_MASTER), of(OFF, foreign=Sign(99.0, 0, "")), EXACT, NOW)


@pytest.mark.parametrize("target_mps", [0.625, -0.375])
def test_at_the_very_tolerance_it_does_not_trip(target_mps: float) -> None:
    axis = replace(AT_REST, drive=exact_drive(LEFT.drive), target_mps=target_mps)
    view = of(axis, replace(STANDING, drive=exact_drive(RIGHT.drive)), bounds=Bounds(-0.25, 0.5, 0.0, 0.0))
    assert decide(view, EXACT, NOW) == FINE


# --- what clears it


def test_each_cause_says_what_a_reset_needs() -> None:
    words = {check.cause: check.clears_on for check in CHECKS}
    assert {cause: clears_on(Verdict(cause)) for cause in words} == words
    assert clears_on(Verdict(TripCause.ENDED)) == "nothing else"
    assert words[TripCause.FOREIGN_MASTER] == "no such frame has come for 1 s"
    assert words[TripCause.BUS_FAILED] == "the bus takes frames again"


@pytest.mark.parametrize(
    "tripped_by",
    [
        TripCause.TARGET_OUTSIDE,
        TripCause.MOTION_OUTSIDE,
        TripCause.OVERSPEED,
        TripCause.DRIVE_DOWN,
        TripCause.FEEDBACK_IMPLAUSIBLE,
        TripCause.TWIST_OUTSIDE,
    ],
)
def test_of_motion_nothing_is_left_when_the_wheels_stand(tripped_by: TripCause) -> None:
    """A drive in fault must not keep the reset away: the driver resets the fault only after it."""
    fault = replace(
        OFF, state=DriveState.FAULT, feedback=Feedback(outside_samples=9, overspeed_samples=9, implausible_samples=9)
    )
    assert not stands(Verdict(tripped_by, 1), of(fault), CONFIG, NOW)


# --- of several causes the one that explains the others


def test_the_order_of_the_table() -> None:
    assert [check.cause for check in CHECKS] == [9, 10, 8, 1, 2, 18, 3, 16, 15, 7, 12, 13, 17, 4, 6, 5, 14]


def test_what_is_about_the_whole_robot_names_no_node() -> None:
    views = (
        well(lease_at=90.0),
        of(AT_REST, driver_at=90.0),
        of(AT_REST, bus_failed_since=90.0),
        of(AT_REST, tick_gap_s=1.0),
    )
    verdicts = [decide(view, CONFIG, NOW) for view in views]
    assert [(verdict.cause, verdict.node_id) for verdict in verdicts] == [(1, 0), (2, 0), (9, 0), (10, 0)]
    assert (FINE.cause, FINE.node_id, FINE.detail) == (0, 0, "")


def test_a_bus_that_failed_explains_the_silence() -> None:
    everything = well(bus_failed_since=99.0, tick_gap_s=1.0, driver_at=90.0, lease_at=90.0, foreign=Sign(NOW, 1, ""))
    assert cause(everything) is TripCause.BUS_FAILED
    assert cause(replace(everything, bus_failed_since=math.inf)) is TripCause.LOOP_LATE
    assert cause(replace(everything, bus_failed_since=math.inf, tick_gap_s=0.0)) is TripCause.FOREIGN_MASTER
