"""Mux and filter once more, call by call: the file of their inputs into their real cores. Pure.

The filter takes the order of the mux that is replayed, as on the robot. Each decision is compared with the recorded
one: which source has the base, the order, and its cause. With another robot.yaml the differences are what it changes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from canbase_base.latch_record import Found, Mark, Record
from canbase_config.robot import Robot
from canbase_recording.core_state import BROKEN, restore
from canbase_recording.input_lines import NoInputsError
from canbase_recording.velocity_inputs import Call, VelocityConfig, VelocityInputs
from canbase_runtime.driver_state import driver_state
from canbase_velocity.base_ready import status_timeout_s
from canbase_velocity.decision import Action
from canbase_velocity.delay import Sent
from canbase_velocity.estop import EstopState
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.input_ring import filter_entry, mux_entry
from canbase_velocity.mux import Mux
from canbase_velocity.obstacle import Geometry
from canbase_velocity.placement import Placement
from canbase_velocity.safety_filter import FilterConfig
from canbase_velocity.speed_limit import SpeedLimit
from canbase_velocity.twist import ZERO, Twist
from canbase_velocity.unexpected_publishers import Foreign

SAME_SPEED: Final = 1e-6
"""Orders that differ by less are the same [m/s, rad/s]: a step of integration may be divided in another way."""
MOST_KEPT: Final = 1000
"""Differences; more are counted."""


@dataclass(frozen=True, slots=True)
class Decided:
    """One decision of the filter: STOP for a cause, or an order [m/s, rad/s]."""

    at_s: float
    action: str
    cause: str
    linear_mps: float
    angular_radps: float
    emergency: bool
    detail: str

    def is_as(self, other: Decided) -> bool:
        """The same for the base: action, cause, order."""
        near = abs(self.linear_mps - other.linear_mps) <= SAME_SPEED
        near = near and abs(self.angular_radps - other.angular_radps) <= SAME_SPEED
        return near and (self.action, self.cause, self.emergency) == (other.action, other.cause, other.emergency)


@dataclass(frozen=True, slots=True)
class Held:
    """One decision of the mux: the source that has the base (empty: none), how it stands (SourceStanding; None: there
    is none), and its order."""

    at_s: float
    active: str
    standing: int | None
    linear_mps: float
    angular_radps: float


@dataclass(slots=True)
class VelocityReplay:
    """`stops`: each time when the filter began to stop or to limit for another cause, recorded and replayed.

    `decisions`, `holds`: compared. The differences: recorded and replayed; the first MOST_KEPT of them.
    """

    has_state: bool
    decisions: int = 0
    holds: int = 0
    different: int = 0
    stops: list[tuple[Decided, Decided]] = field(default_factory=list)
    filter_differences: list[tuple[Decided, Decided]] = field(default_factory=list)
    mux_differences: list[tuple[Held, Held]] = field(default_factory=list)

    @property
    def agrees(self) -> bool:
        """Every decision is the recorded one."""
        return self.different == 0


def replay_velocity(inputs: VelocityInputs, other: Robot | None = None) -> VelocityReplay:
    """`other`: another robot.yaml. Raises NoInputsError for a state that is none."""
    recorded = inputs.head.config
    config = recorded if other is None else _of(other, recorded.uncommissioned)
    cores = _cores(config)
    if inputs.state is not None:
        before = cores if other is None else _cores(recorded)
        cores = restore(inputs.state, cores, before)
    if not (isinstance(cores, tuple) and len(cores) == 2 and isinstance(cores[0], Mux)):
        raise NoInputsError("no state of mux and filter")
    try:
        return _Replayer(*cores, config, has_state=inputs.state is not None).through(inputs.calls)
    except BROKEN as error:
        raise NoInputsError(f"mux and filter of this canbase cannot take it: {str(error)[:80]}") from error


def _of(robot: Robot, uncommissioned: str) -> VelocityConfig:
    return VelocityConfig(robot.limits, robot.safety, robot.mux, robot.rates, robot.base, uncommissioned)


def _cores(config: VelocityConfig) -> tuple[Mux, SafetyFilter]:
    geometry = Geometry.of(config.limits, config.safety, config.rates.command_hz)
    needs = FilterConfig(config.limits, config.safety, config.base.standstill_mps, geometry, config.uncommissioned)
    mux = Mux(
        config.mux.sources,
        config.mux.locks,
        foreign_lock=config.mux.foreign_publishers == "lock",
        status_timeout_s=status_timeout_s(config.rates),
    )
    return mux, SafetyFilter(needs, Found())


class _Replayer:
    """Both cores, wired as their nodes wire them."""

    def __init__(self, mux: Mux, safety: SafetyFilter, config: VelocityConfig, *, has_state: bool) -> None:
        self._mux, self._filter, self._config = mux, safety, config
        self._placements = {scan.topic: Placement.of(scan) for scan in config.safety.scans if scan.pose != "tf"}
        self._order = ZERO
        self._found = VelocityReplay(has_state)
        self._told: tuple[object, object] | None = None
        self._do: Mapping[str, Callable[..., object]] = {
            "command": self._command,
            "driver": lambda at_s, state, cycles, received: mux.on_driver(driver_state(state), cycles, received),
            "lock": self._lock,
            "foreign": lambda at_s, found: mux.on_foreign([Foreign(**each) for each in found]),
            "publishers": lambda at_s, topic, nodes, keys: mux.on_publishers(topic, nodes, keys),
            "obey": lambda at_s, received: safety.accept_command(self._order, received),
            "estop": lambda at_s, pressed, received: safety.on_estop(pressed, received),
            "buttons": lambda at_s, count, why: safety.on_estop_publishers(count, why),
            "scan": self._scan,
            "points": lambda at_s, topic, points: self._seen(topic, safety.on_points, points, None, at_s),
            "unplaced": lambda at_s, topic, why: self._seen(topic, safety.on_unplaced_scan, why),
            "scanners": lambda at_s, topic, *who: self._seen(topic, safety.on_scan_publishers, *who, at_s),
            "speed_limit": lambda at_s, v, w, by: safety.on_speed_limit(SpeedLimit(v, w), by),
            "reset": lambda at_s, moving: safety.reset(moving, at_s),
            "record": self._record,
            "end": lambda at_s: safety.end(),
            "mux": self._hold,
            "mux_shutdown": self._hold,
            "decide": self._decide,
            "shut_down": self._decide,
        }

    def through(self, calls: tuple[Call, ...]) -> VelocityReplay:
        for call in calls:
            what, at_s, *values = call
            if what in _DECISIONS:
                self._do[what](call)
            else:
                self._do[what](at_s, *values)
        return self._found

    def _command(self, at_s: float, name: str, v: float, w: float, received: float, times: Any) -> None:
        if name in self._config.mux.sources:
            sent = None if times is None else Sent(times[0], times[1], at_s)
            self._mux.accept_command(name, Twist(v, w), received, at_s, sent)

    def _lock(self, at_s: float, name: str, locked: bool, received: float) -> None:
        if name in self._config.mux.locks:
            self._mux.on_lock(name, locked, received)

    def _scan(self, at_s: float, topic: str, scan: Any, placement: Placement | None, wall_s: float) -> None:
        placement = placement or self._placements.get(topic)
        if placement is not None:
            self._seen(topic, self._filter.on_laser_scan, scan, placement, at_s, wall_s)

    def _seen(self, topic: str, take: Callable[..., None], *values: Any) -> None:
        """Of a scanner that the configuration has."""
        if any(scan.topic == topic for scan in self._config.safety.scans):
            take(topic, *values)

    def _record(self, at_s: float, told: Mapping[str, Any] | None, problem: str) -> None:
        record = None if told is None else Record(**{**told, "mark": Mark(told["mark"])})
        self._filter.on_record(record, problem)

    def _hold(self, call: Call) -> None:
        what, at_s, active, v, w, standing = call
        self._mux.on_estop(self._filter.estop is EstopState.FREE)
        self._mux.on_scans(self._filter.without_scans)
        made = self._mux.shutdown(at_s) if what == "mux_shutdown" else self._mux.decide(at_s)
        self._order = made.twist
        _, _, now_active, now_v, now_w, now_standing = mux_entry(what, at_s, made)
        recorded, replayed = Held(at_s, active, standing, v, w), Held(at_s, now_active, now_standing, now_v, now_w)
        self._found.holds += 1
        self._compare(recorded == replayed, self._found.mux_differences, (recorded, replayed))

    def _decide(self, call: Call) -> None:
        what, at_s = call[:2]
        made = self._filter.shut_down(at_s) if what == "shut_down" else self._filter.decide(at_s)
        recorded, replayed = _decided(call), _decided(filter_entry(what, at_s, made))
        self._found.decisions += 1
        self._compare(recorded.is_as(replayed), self._found.filter_differences, (recorded, replayed))
        told = recorded.action, recorded.cause
        if told != self._told and len(self._found.stops) < MOST_KEPT:
            self._found.stops.append((recorded, replayed))
        self._told = told

    def _compare(self, same: bool, differences: list[Any], pair: Any) -> None:
        if not same:
            self._found.different += 1
            if len(differences) < MOST_KEPT:
                differences.append(pair)


_DECISIONS: Final = ("mux", "mux_shutdown", "decide", "shut_down")
_ACTIONS: Final = {int(each): each.name for each in Action}


def _decided(call: Call) -> Decided:
    _, at_s, action, cause, v, w, emergency, detail = call
    return Decided(at_s, _ACTIONS.get(action, "unknown"), cause, v, w, emergency, detail)


def causes(found: VelocityReplay) -> Iterator[tuple[Decided, Decided]]:
    """The stops alone."""
    return ((recorded, replayed) for recorded, replayed in found.stops if recorded.action == Action.STOP.name)
