"""What is mutated, and which tests have to notice: every module that decides about motion or a stop.

`first`: the tests that are about the module, which kill nearly all mutants in no time. `then`: what looks at it
together with the others, run only for a mutant that is still alive.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from mutation.mutants import behaviour

ROOT = Path(__file__).resolve().parents[2]
UNIT = Path("virtual_bus_tests/unit")
STORIES = ("watchdog/story_trips", "watchdog/story_ladder", "watchdog/story_reset", "watchdog/trips")
"""Tests of the watchdog as a whole."""
SENSORS = ("watchdog/lies", "watchdog/sensors", "watchdog/runaway", "watchdog/ghost_velocity", "watchdog/slow_wheel")
"""Tests of sensors that lie, also of the watchdog as a whole."""
FILTER = (
    "velocity/safety_filter_properties",
    "velocity/without_scans",
    "velocity/two_buttons",
    "velocity/estop_record",
)
"""Tests of the safety filter as a whole."""
LONG = "noise_neither_raises or no_noise_untrips or noise_never_raises or no_frame_raises or minute"
"""Tests that are left out: long, and about exceptions and false trips, which the others notice as well."""


@dataclass(frozen=True, slots=True)
class Target:
    """One mutated module. `path`: from the root of the project; `first`, `then`: of the tests (watchdog/policy)."""

    path: str
    first: tuple[str, ...]
    then: tuple[str, ...]

    @property
    def module(self) -> str:
        """Its dotted name."""
        return ".".join(Path(self.path).with_suffix("").parts[1:])

    @property
    def source(self) -> str:
        """Its text."""
        return (ROOT / self.path).read_text(encoding="utf-8")

    @property
    def sha256(self) -> str:
        """Of what it does: comments, docstrings and layout may change."""
        return hashlib.sha256(behaviour(self.source).encode()).hexdigest()


def files(names: tuple[str, ...]) -> list[str]:
    """Paths of test files, from the root of the project."""
    return [str(UNIT / folder / f"test_{name}.py") for folder, name in (name.split("/") for name in names)]


def _target(package: str, name: str, first: tuple[str, ...], then: tuple[str, ...]) -> Target:
    """`first`: without any, the test with the module's own name."""
    room = Path(package).name.removeprefix("canbase_")
    return Target(f"{package}/{name}.py", first or (f"{room}/{Path(name).name}",), then)


def _watchdog(name: str, *first: str, then: tuple[str, ...] = STORIES) -> Target:
    return _target("watchdog/canbase_watchdog", name, first, then)


def _driver(name: str, *first: str, then: tuple[str, ...] = ()) -> Target:
    return _target("driver/canbase_driver", name, first, then)


def _velocity(name: str, *first: str, then: tuple[str, ...] = FILTER) -> Target:
    return _target("velocity_mux/canbase_velocity", name, first, then)


def _action(name: str, *first: str, then: tuple[str, ...] = ("action_server/goal",)) -> Target:
    return _target("action_server/canbase_action_server", name, first, then)


TARGETS = (
    _watchdog("policy", "watchdog/policy", "watchdog/policy_motion"),
    _watchdog("trip_cause", "watchdog/policy", "watchdog/latch"),
    _watchdog("power_and_motion", "watchdog/policy"),
    _watchdog("view", "watchdog/policy", "watchdog/observer"),
    _watchdog("watchdog", *STORIES, then=SENSORS),
    _watchdog("observer", then=(*STORIES, *SENSORS)),
    _watchdog("lease"),
    _target("runtime/canbase_base", "latch_record", ("runtime/latch_record",), ("runtime/latch_file",)),
    _watchdog("envelope", then=("watchdog/trips", "watchdog/envelope_limiter")),
    _watchdog("left_right"),
    _watchdog("setpoint_at_rest"),
    _watchdog("ramp_to_zero"),
    _watchdog("hard_braking"),
    _watchdog("plausibility", then=(*STORIES, *SENSORS)),
    _watchdog("overshoot", "watchdog/lies", "watchdog/runaway", then=(*STORIES, *SENSORS)),
    _watchdog("motion_evidence", then=("watchdog/observer", *SENSORS)),
    _watchdog("ghost", "watchdog/ghost_velocity", then=SENSORS),
    _watchdog("torque_evidence", then=SENSORS),
    _watchdog("unasked_torque", then=("watchdog/torque_evidence", "chain/dead_encoder_at_a_stand")),
    _watchdog("counts", "watchdog/stopping_distance", then=SENSORS),
    _watchdog("twist", then=("watchdog/observer",)),
    _watchdog("bad_cycles", then=("watchdog/observer",)),
    _watchdog("standstill", "watchdog/standstill", "watchdog/stopping_distance", then=("watchdog/observer", *SENSORS)),
    _watchdog("stopping_distance"),
    _watchdog("slowing", then=("watchdog/story_ladder", "chain/quick_stop_without_effect")),
    _watchdog("ladder", then=("watchdog/story_ladder", "watchdog/story_trips", "chain/reset_as_a_last_rung")),
    _watchdog("stopper", "watchdog/story_ladder", "watchdog/story_trips", then=("chain/reset_as_a_last_rung",)),
    _watchdog("guarding"),
    _watchdog("copies", then=("watchdog/second_master",)),
    _watchdog("second_master"),
    _watchdog("bus_health"),
    _driver("cia402", then=("driver/axis", "chain/layouts_agree")),
    _driver("drives/axis", then=("driver/canopen_node", "driver/core")),
    _driver("drives/standstill", "driver/standstill", "driver/standstill_limits", then=("driver/core",)),
    _driver("drives/stall", then=("driver/core",)),
    _driver("drives/release_test", then=("chain/dead_encoder_at_a_stand",)),
    _driver("motion/limiter", then=("driver/limiter_properties", "driver/braking", "velocity/ramp")),
    _driver("motion/braking"),
    _driver("motion/velocity_command", then=("driver/core",)),
    _driver("supervision/state_machine", then=("driver/state_machine_way_down", "driver/core")),
    _driver("supervision/hazards", "driver/state_machine", then=("driver/state_machine_way_down", "driver/core")),
    _driver("supervision/fault_reset", then=("driver/core", "driver/lifecycle")),
    _velocity("mux", then=("velocity/neutral", "velocity/neutral_pauses", "velocity/neutral_publishers")),
    _velocity("neutral", then=("velocity/neutral_pauses", "velocity/neutral_publishers", "velocity/mux")),
    _velocity("lock", "velocity/mux"),
    _velocity("delay", then=("velocity/neutral",)),
    _velocity("safety_filter", "velocity/safety_filter", "velocity/safety_filter_limits"),
    _velocity("filter_state", "velocity/safety_filter_estop", "velocity/safety_filter_obstacle"),
    _velocity("obstacle", "velocity/safety_filter_obstacle"),
    _velocity("sweep"),
    _velocity("estop"),
    _action("causes"),
    _action("goal", then=("action_server/active_goal",)),
    _action("standstill"),
)
