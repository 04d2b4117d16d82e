"""learners.yaml: what the product learns from data has a bound, and hostile data do not move it. Times in s."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import numpy as np
import pytest
from ruamel.yaml import YAML

import canbase_hazards
from canbase_commissioning import calibration
from canbase_driver.drives import canopen_node, release_test
from canbase_driver.drives.stopping_distance import StoppingDistance
from canbase_driver.motion.odometry import WheelTravel
from canbase_driver.motion.slip import SideSlip
from canbase_velocity.clearance import Points
from canbase_velocity.delay import Delay, Sent
from canbase_velocity.glitch import GlitchFilter
from canbase_velocity.placement import HeldPlacement, Placement, PlacementError
from canbase_watchdog import counts, overshoot, stopping_distance, twist
from canbase_watchdog.envelope import DirectionBounds
from support.chain_world import bench_robot
from support.watchdog_story import config

ROOT = Path(__file__).parents[3]
PROCESSES = ("driver", "velocity_mux", "watchdog", "action_server", "runtime")
TABLE = YAML(typ="safe").load((Path(canbase_hazards.__file__).parent / "learners.yaml").read_text("utf-8"))
RANDOM = Random(1)
OFTEN = 2000


def assigned(node: ast.Assign) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Target and value, one by one."""
    for target in node.targets:
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            yield from zip(target.elts, node.value.elts, strict=True)
        else:
            yield target, node.value


def with_memory(source: str, name: str) -> set[str]:
    """Attributes whose greatest or least value ever decides about the next one."""
    return {
        f"{name} {cls.name}.{target.attr}"
        for cls in ast.walk(ast.parse(source)) if isinstance(cls, ast.ClassDef)
        for node in ast.walk(cls) if isinstance(node, ast.Assign)
        for target, value in assigned(node)
        if isinstance(target, ast.Attribute) and ast.unparse(target.value) == "self"
        for call in ast.walk(value)
        if isinstance(call, ast.Call) and ast.unparse(call.func) in ("min", "max")
        and any(ast.unparse(part) == ast.unparse(target) for part in ast.walk(call))
    }  # fmt: skip


def test_a_new_value_with_a_memory_is_in_the_table() -> None:
    files = [file for folder in PROCESSES for file in sorted((ROOT / folder).rglob("*.py"))]
    in_code = set().union(*(with_memory(file.read_text("utf-8"), file.name) for file in files))
    rows = {f"{path.rsplit('/', 1)[-1]} {name}" for row in TABLE["learners"]
            for path, *names in [row["where"].split()] for name in names}  # fmt: skip
    named = {name.strip() for row in TABLE["counts"] for name in row["where"].split(" / ")}
    assert len(files) > 150
    assert in_code - rows - named == set()
    assert not rows & named


def test_a_memory_is_found() -> None:
    source = (
        "class A:\n    def on(self, x):\n        self.low, self.high, self.x = min(self.low, x), max(x, self.high), x"
    )
    assert with_memory(source, "a.py") == {"a.py A.low", "a.py A.high"}


@pytest.mark.parametrize("row", TABLE["learners"] + TABLE["counts"], ids=lambda row: row["where"][:60])
def test_each_row_is_whole_and_its_names_are_in_the_code(row: dict[str, str]) -> None:
    assert set(row) in ({"where", "learns", "bound", "source"}, {"where", "why"})
    assert all(text.strip() for text in row.values())
    for part in row["where"].split(" / "):
        path, *names = part.split()
        files = [ROOT / path] if "/" in path else [file for folder in PROCESSES for file in (ROOT / folder).rglob(path)]
        texts = [file.read_text("utf-8") for file in files]
        assert names
        for name in names:
            assert any(name.rpartition(".")[2] in text and name.partition(".")[0] in text for text in texts), name


def sent(delay_s: float, now_s: float) -> Sent:
    return Sent(now_s - delay_s, now_s, now_s)


def delay_is_never_forgotten() -> None:
    watch = Delay(same_clock=False)
    watch.measure(sent(0.0, 1.0))
    for at in range(OFTEN):
        watch.measure(sent(1.0 + RANDOM.random() * 100.0, 10.0 + at))
    assert watch.measure(sent(1.0, 1e6)) == pytest.approx(1.0)


def glitch_filter_delays_by_one_scan() -> None:
    beams = np.arange(3)
    wall = Points(np.array([[1.0, 0.0], [1.0, 0.01], [1.0, 0.02]]), beams, 360)
    for _ in range(OFTEN // 10):
        watch = GlitchFilter(min_points=3)
        for _ in range(3):
            at_m = np.array([[RANDOM.uniform(-9.0, 9.0), RANDOM.uniform(-9.0, 9.0)] for _ in beams])
            watch.genuine(Points(at_m, beams * 100, 360), 0.0, 0.0)
        assert watch.genuine(wall, 0.0, 0.0).shape[0] == 3


def first_place_stays() -> None:
    def place(x_m: float) -> Placement:
        return Placement(x_m, 0.0, (1.0, 0.0), (0.0, 1.0))

    held = HeldPlacement()
    held.hold("laser", place(0.0))
    with pytest.raises(PlacementError):
        held.hold("laser", place(0.5))
    for _ in range(9):
        with pytest.raises(PlacementError):
            held.hold("laser", place(0.0))


def boot_waits_a_bounded_time() -> None:
    node = canopen_node.CanopenNode(1, bench_robot())
    for at in range(OFTEN):
        now_s, gap_s = 1000.0 * at, RANDOM.choice((0.001, 2.999, 3.0, 29.9, 30.0, 31.0, math.inf))
        node._boot_up_at, node._reset_at = now_s - gap_s, now_s - gap_s
        node._learn_to_settle(now_s)
        node._learn_to_wait("it answered", now_s)
    assert node._learned.settle_s == pytest.approx(4.1)
    assert node._learned.boot_up_s == pytest.approx(39.5)


def floor_follows_the_grip() -> None:
    side = SideSlip(grip_mps2=4.0)
    side.update([0.0], 0.01)
    for at in range(100):
        side.update([RANDOM.uniform(50.0, 100.0)], 0.01)
        assert side._floor_mps is not None
        assert side._floor_mps <= 4.0 * 0.01 * (at + 1) + 1e-9
    assert side.speed_mps > 40.0


def travel_is_bounded() -> None:
    travel = WheelTravel(0.001, 100.0)
    travel.update(0)
    for at in range(OFTEN):
        travel.update(RANDOM.choice((RANDOM.randrange(-(2**31), 2**31), 2**31 - 1, 90 * at, 0)))
        assert abs(travel.travel_m) <= 0.1 * (at + 1)


def jitter_is_no_life_for_the_driver() -> None:
    push = release_test.TorqueEvidence(0.05, 1e-5)
    for at in range(OFTEN):
        push.on_sample(RANDOM.choice((0.0, 0.99 * release_test.LIFE_M)), 1.0, 0.5, True, 0.01 * at)
    assert push.must_release


def jitter_is_no_life_for_the_watchdog() -> None:
    life, at_m = counts.Life(counts.LIFE_M), 0.0
    for _ in range(OFTEN):
        to_m = RANDOM.choice((0.0, 0.99 * counts.LIFE_M))
        assert not life.on_step(to_m - at_m)
        at_m = to_m


def to_and_fro_is_no_distance_for_the_driver() -> None:
    stopping = StoppingDistance(0.01, 0.0)
    stopping.on_sample(1.0, 0.0, 2.0)
    for _ in range(OFTEN):
        stopping.on_sample(0.0, RANDOM.uniform(-0.01, 0.01), 2.0)
    assert stopping.missing_m > 0.2


def to_and_fro_is_no_distance_for_the_watchdog() -> None:
    stopping, at_m = stopping_distance.StoppingDistance(0.01, 0.0), 0.0
    stopping.on_speed(1.0, 2.0)
    for _ in range(OFTEN):
        to_m = RANDOM.uniform(-0.01, 0.01)
        stopping.on_travel(to_m - at_m)
        stopping.on_speed(0.0, 2.0)
        at_m = to_m
    assert stopping.lacks


def catching_up_is_bounded() -> None:
    watch, target_mps = overshoot.Overshoot(), 0.5
    for at in range(OFTEN):
        allowed_mps = watch.on_sample(target_mps, RANDOM.choice((-1e9, -3.0, 0.0)), 0.01, 0.01, 0.01 * at)
        assert allowed_mps <= overshoot.FASTER * target_mps
    after = [watch.on_sample(target_mps, 1.5, 0.01, 0.01, 0.01 * at) for at in range(OFTEN, OFTEN + 99)]
    free_s = 0.01 * sum(allowed_mps > 0.0 for allowed_mps in after)
    assert free_s <= target_mps * overshoot.HELD_S / (1.5 - target_mps) + 0.01


def leases_allow_the_ceiling() -> None:
    way = DirectionBounds(1.0, 0.2, 0.0)
    for at in range(OFTEN):
        way.order(RANDOM.choice((1e9, math.inf, -1e9, 0.3)), 0.01 * at, 0.01 * at + 1.0)
        way.update_orders(0.01 * at)
        assert way.level <= 1.0


def mean_speed_has_a_short_memory() -> None:
    watch = twist.TwistWatch(config(), 0.0)
    for _ in range(OFTEN):
        watch._smooth([RANDOM.uniform(-1e3, 1e3)] * 2, 0.01)
    for _ in range(100):
        watch._smooth([0.4, 0.4], 0.01)
    assert watch._speeds == [pytest.approx(0.4, abs=1e-6)] * 2


def calibration_is_bounded() -> None:
    for factor in (0.0, 0.49, 2.01, 1e9, math.inf, math.nan, -1.0):
        with pytest.raises(calibration.CalibrationError):
            calibration.radius(0.1, 1.0, factor)
        with pytest.raises(calibration.CalibrationError):
            calibration.track(0.5, factor, 1.0, 1.0)


HOSTILE: dict[str, Callable[[], None]] = {
    "Delay._least_s": delay_is_never_forgotten,
    "GlitchFilter._before_m": glitch_filter_delays_by_one_scan,
    "HeldPlacement._first": first_place_stays,
    "CanopenNode._learned": boot_waits_a_bounded_time,
    "SideSlip._floor_mps": floor_follows_the_grip,
    "WheelTravel._accepted_raw": travel_is_bounded,
    "TorqueEvidence._low_m TorqueEvidence._high_m": jitter_is_no_life_for_the_driver,
    "Life._low_m Life._high_m": jitter_is_no_life_for_the_watchdog,
    "StoppingDistance._distance_m StoppingDistance._hardest_mps2": to_and_fro_is_no_distance_for_the_driver,
    "StoppingDistance._way_m": to_and_fro_is_no_distance_for_the_watchdog,
    "Overshoot._lack_mps Overshoot._lost_m": catching_up_is_bounded,
    "DirectionBounds.level": leases_allow_the_ceiling,
    "TwistWatch._speeds": mean_speed_has_a_short_memory,
    "radius track": calibration_is_bounded,
}


@pytest.mark.parametrize("where", [row["where"].partition(" ")[2] for row in TABLE["learners"]])
def test_hostile_data_do_not_move_the_bound(where: str) -> None:
    HOSTILE[where]()
