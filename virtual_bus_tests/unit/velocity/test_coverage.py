"""What a command needs must be covered by fresh scanners: fields that are lost, narrower, shorter, coarser, unread.

Footprint 0.3 m to all sides, 0.8 m/s at most, stop distance 0.15 m, blind_mps 0.15 m/s.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from canbase_config.safety import LimitZone
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.clearance import GAP_M, NOWHERE, Field
from canbase_velocity.coverage import Why, is_seen, uncovered, zone_factor
from canbase_velocity.decision import Decision
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.obstacle import Geometry, Sight
from canbase_velocity.placement import Placement
from canbase_velocity.safety_filter import FilterConfig
from canbase_velocity.scan import Scan
from canbase_velocity.sweep import fastest_mps
from canbase_velocity.twist import ZERO, Twist
from support.filter_inputs import BOX, HOLD_S, LIMITS, config
from support.filter_world import robot_with

INF, NAN = math.inf, math.nan
DEG = math.pi / 180.0
AHEAD, BACK = Twist(0.8, 0.0), Twist(-0.8, 0.0)
ZONE = {"front_m": 1.5, "rear_m": 1.0, "left_m": 1.0, "right_m": 1.0, "linear_mps": 0.25, "angular_radps": 0.5}


def scan(first_deg: float, last_deg: float, step_deg: float = 1.0, range_m: float = 10.0) -> Scan:
    """Nothing in range, from one angle to another."""
    count = round((last_deg - first_deg) / step_deg) + 1
    return Scan(np.full(count, INF), first_deg * DEG, step_deg * DEG, 0.05, range_m)


def unread(made: Scan, *beams: int) -> Scan:
    ranges_m = np.array(made.ranges_m)
    ranges_m[list(beams)] = NAN
    return dataclasses.replace(made, ranges_m=ranges_m)


class Two:
    """A required scanner in the middle of the base on `scan`, and one that is optional on `second`."""

    def __init__(self, blind_mps: float = 0.15, **safety: object) -> None:
        second = {"required": False, "topic": "second"}
        robot = robot_with(blind_mps=blind_mps, more_scans=[second], **safety)
        self.config = FilterConfig.of(robot)
        self.filter = SafetyFilter(self.config)
        self.place = Placement.of(robot.safety.scan)
        self.now_s = 100.0

    def after(
        self, command: Twist, first: Scan | None, second: Scan | None = None, duration_s: float = 1.0
    ) -> Decision:
        """The decision after this time, in which the scanners publish what is not None."""
        for step in range(round(duration_s / 0.1)):
            self.now_s += 0.1
            for topic, sent in (("scan", first), ("second", second)):
                if sent is not None:
                    stamped = dataclasses.replace(sent, stamp_ns=round(self.now_s * 1e9) + step)
                    self.filter.on_laser_scan(topic, stamped, self.place, self.now_s, self.now_s)
            self.filter.accept_command(command, self.now_s)
            decision = self.filter.decide(self.now_s)
        return decision


def speed(decision: Decision) -> float:
    return 0.0 if decision.twist == ZERO else fastest_mps(BOX, decision.twist)


FRONT, REAR = scan(-90, 90), scan(90, 270)
ALL = scan(-180, 179)


def test_the_side_that_only_the_lost_scanner_covers_is_not_free() -> None:
    two = Two()
    for command in (AHEAD, BACK):
        assert two.after(command, REAR, FRONT).twist == command
    ended = two.after(AHEAD, REAR)
    assert ended.cause is StopCause.BLIND
    assert speed(ended) == pytest.approx(0.15)
    assert "second looked where the command leads, and does not any more" in ended.detail
    assert two.after(BACK, REAR).twist == BACK
    assert two.after(AHEAD, REAR, FRONT).twist == AHEAD
    forbidden = Two(blind_mps=0.0)
    forbidden.after(AHEAD, REAR, FRONT)
    assert forbidden.after(AHEAD, REAR).twist == ZERO


@pytest.mark.parametrize("half_deg", [1, 3, 8, 20])
def test_a_wedge_that_only_the_lost_scanner_covers_is_not_free_however_narrow_its_share_is(half_deg: int) -> None:
    """The first scanner looks everywhere but ahead; 1° to each side is 0.05 m wide at the end of the path."""
    two = Two()
    rest, wedge = scan(half_deg, 360 - half_deg), scan(-half_deg - 1, half_deg + 1)
    assert two.after(AHEAD, rest, wedge).twist == AHEAD
    assert speed(two.after(AHEAD, rest)) == pytest.approx(0.15)


def test_an_optional_scanner_that_ended_is_missed_where_another_one_looks_too() -> None:
    """The other one may be mounted higher: what it does not see is not free."""
    two = Two()
    assert two.after(AHEAD, ALL, FRONT).twist == AHEAD
    assert speed(two.after(AHEAD, ALL, duration_s=0.2)) == pytest.approx(0.8)  # within its timeout
    assert speed(two.after(AHEAD, ALL, duration_s=0.2)) == pytest.approx(0.15)
    assert two.after(BACK, ALL).twist == BACK
    assert two.after(AHEAD, ALL, FRONT).twist == AHEAD


def test_an_optional_scanner_that_never_came_is_not_missed() -> None:
    assert Two().after(AHEAD, ALL).twist == AHEAD


def test_an_optional_scanner_of_which_no_scan_ever_counted_makes_nothing_free() -> None:
    two = Two(scan={"required": False})
    assert two.after(AHEAD, None).twist == AHEAD
    blind = two.after(AHEAD, None, dataclasses.replace(ALL, ranges_m=np.full(360, NAN)))
    assert blind.cause is StopCause.BLIND
    assert speed(blind) == pytest.approx(0.15)
    assert "no scanner has scans that count" in blind.detail


@pytest.mark.parametrize(
    ("later", "is_free"),
    [
        (ALL, True),
        (scan(-180, 177), True),  # two beams fewer, behind
        (scan(-179.5, 178.5), True),  # half a beam beside
        (scan(-170, 170), True),  # narrower behind, where the command does not lead
        (scan(-180, 179, 0.5), True),  # twice the beams
        (scan(-180, 178, 2.0), True),  # no place is farther from a beam than the beams were apart
        (scan(-180, 177, 3.0), True),  # nor than 0.03 m
        (scan(-180, 175, 5.0), False),
        (scan(-180, 170, 10.0), False),
        (scan(-20, 20), False),
        (scan(0, 179), False),
        (scan(10, 350), False),
        (scan(90, 270), False),
        (scan(-180, 179, range_m=20.0), True),
        (scan(-180, 179, range_m=3.0), True),
        (scan(-180, 179, range_m=0.5), False),
    ],
)
def test_a_later_scan_narrows_the_field_of_the_first_one_nowhere_silently(later: Scan, is_free: bool) -> None:
    two = Two()
    assert two.after(AHEAD, ALL).twist == AHEAD
    decision = two.after(AHEAD, later)
    assert speed(decision) == pytest.approx(0.8 if is_free else 0.15)
    assert (decision.cause is StopCause.BLIND) is not is_free


def test_what_a_narrower_scan_leaves_out_is_lost_though_another_scanner_looks_there() -> None:
    two = Two()
    assert two.after(AHEAD, FRONT, ALL).twist == AHEAD
    decision = two.after(AHEAD, FRONT, REAR)
    assert speed(decision) == pytest.approx(0.15)
    assert "second looked where the command leads" in decision.detail


@pytest.mark.parametrize(("missing", "is_free"), [((), True), ((180,), True), ((180, 181), True)])
def test_single_beams_without_a_reading_hide_nothing(missing: tuple[int, ...], is_free: bool) -> None:
    assert (Two().after(AHEAD, unread(ALL, *missing)).twist == AHEAD) is is_free


def test_a_leg_that_reflects_nothing_is_not_free() -> None:
    """10 cm wide, 0.6 m ahead: 3 % of the places of the path."""
    decision = Two().after(AHEAD, unread(ALL, *range(175, 186)))
    assert decision.cause is StopCause.SCAN_BLIND
    assert speed(decision) == pytest.approx(0.15)
    assert "scan looks at the rest, and has no readings there" in decision.detail


GEOMETRY = Geometry.of(LIMITS, config().safety, 1.0 / HOLD_S)
HERE = Placement(0.0, 0.0, (1.0, 0.0), (0.0, 1.0))


def looking(first_deg: float, last_deg: float, range_m: float = 10.0, topic: str = "scan") -> Field:
    return Field(HERE, first_deg * DEG, (last_deg - first_deg) * DEG, 0.0, range_m, topic=topic)


def test_why_a_path_is_not_covered_and_by_whom() -> None:
    ahead, back = looking(-90, 90, topic="ahead"), looking(90, 270, topic="back")
    assert uncovered(AHEAD, Sight(NOWHERE, (ahead,)), GEOMETRY) is None
    assert uncovered(AHEAD, Sight(NOWHERE), GEOMETRY) is None
    nothing = uncovered(AHEAD, Sight(NOWHERE, everywhere=False), GEOMETRY)
    assert nothing is not None
    assert (nothing.why, nothing.share, nothing.topics) == (Why.UNSEEN, 0.0, ())
    lost = uncovered(AHEAD, Sight(NOWHERE, (back,), lost=(ahead,)), GEOMETRY)
    assert lost is not None
    assert (lost.why, lost.topics) == (Why.LOST, ("ahead",))
    assert uncovered(AHEAD, Sight(NOWHERE, (ahead,), lost=(back,)), GEOMETRY) is None
    mute = dataclasses.replace(ahead, increment_rad=DEG, says=np.array([0, 180]))
    unsaid = uncovered(AHEAD, Sight(NOWHERE, (back, mute)), GEOMETRY)
    assert unsaid is not None
    assert (unsaid.why, unsaid.topics) == (Why.UNREAD, ("ahead",))


@pytest.mark.parametrize(("beyond_m", "is_free"), [(-0.005, True), (0.02, False)])
def test_what_swings_out_by_less_than_a_leg_needs_no_cover(beyond_m: float, is_free: bool) -> None:
    """A scanner that looks ahead from the front edge: in a turn the rear corner leaves the footprint sideways."""
    front = Field(dataclasses.replace(HERE, x_m=BOX.front_m), -math.pi / 2, math.pi, 0.0, 10.0)
    out_m = GAP_M + beyond_m
    # hypot(rear, R + side) = R + side + out, for the centre of the turn at R
    radius_m = (BOX.rear_m**2 - out_m**2) / (2.0 * out_m) - BOX.right_m
    gap = uncovered(Twist(0.5, 0.5 / radius_m), Sight(NOWHERE, (front,)), GEOMETRY)
    assert (gap is None) is is_free


@pytest.mark.parametrize(
    ("field", "seen"),
    [
        (looking(-180, 180), True),
        (looking(-180, 180, math.hypot(1.5, 1.0) + 0.001), True),
        (looking(-180, 180, math.hypot(1.5, 1.0) - 0.001), False),  # its corner ahead
        (looking(-90, 90), False),
        (looking(-150, 150), False),
    ],
)
def test_a_limit_zone_that_is_not_seen_counts_as_occupied(field: Field, seen: bool) -> None:
    zone, sight = LimitZone.model_validate(ZONE), Sight(NOWHERE, (field,))
    assert is_seen(zone, sight, GEOMETRY) is seen
    assert zone_factor(Twist(0.5, 0.0), zone, sight, GEOMETRY) == (1.0 if seen else 0.5)
    assert not is_seen(zone, dataclasses.replace(sight, lost=(looking(-10, 10),)), GEOMETRY)
    occupied = Sight(np.array([(1.4, 0.9)]), (field,))
    assert zone_factor(Twist(0.5, 0.0), zone, occupied, GEOMETRY) == 0.5


def test_a_limit_zone_limits_before_any_scan_and_after_the_last_one() -> None:
    two = Two(limit_zones=[ZONE], scan={"required": False})
    never = two.after(AHEAD, None)
    assert (never.cause, never.twist) == (StopCause.ZONE, Twist(0.25, 0.0))
    assert two.after(AHEAD, ALL).twist == AHEAD
    assert speed(two.after(AHEAD, FRONT)) == pytest.approx(0.25)
    assert speed(two.after(AHEAD, None)) == pytest.approx(0.15)
