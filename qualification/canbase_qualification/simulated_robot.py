"""The robot of a robot.yaml as virtual time has it: what is simulated otherwise, and what is not judged. Pure.

Nothing is left out silently: each difference is a sentence in `assumed` or in `not_judged`, with its key.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from canbase_campaign.faults import FAULTS
from canbase_campaign.outside import publishes_s
from canbase_campaign.robots import commissioned
from canbase_campaign.scanner import LIES
from canbase_campaign.twins import SERVER
from canbase_config import bus_load
from canbase_config.commissioned import uncommissioned, uncommissioned_mps, without_proof
from canbase_config.mux import JOINTS, MuxSource
from canbase_config.robot import Robot
from canbase_config.safety import Scan
from canbase_qualification.job import FAILURES
from canbase_sim.personality import PERSONALITIES

HANDS: Final = {"joystick": "cmd_vel_joy", "navigation": "cmd_vel_nav"}
"""The campaign's sources that order motion, the one with the higher priority first, and their topics."""
ACTION: Final = "action"
NO_SCANNER: Final = frozenset({"obstacle", "scan_stale", *LIES})
NO_BUTTON: Final = frozenset({"estop_stale"})
NO_LOCK: Final = frozenset({"two_on_a_lock"})
ONE_HAND: Final = frozenset({"two_hands"})
"""Faults that mean nothing to a robot without it."""
MEANS: Final = {("scan", "stale"): "scan_stale", ("emergency stop", "stale"): "estop_stale"}
"""Single failures, and the faults of scenarios that are the same."""
OF_GOALS: Final = (SERVER, "client", "odometry")
"""What fails with goals alone; all other failures come while a joystick orders full speed."""


class UnfitError(ValueError):
    """A robot.yaml that virtual time cannot represent: a sentence with the key, and what can be done."""


@dataclass(frozen=True, slots=True)
class Simulated:
    """`robot` goes into the simulation. `assumed` and `not_judged`: sentences for people."""

    robot: Robot
    faults: tuple[str, ...]
    """Those of canbase_campaign that scenarios are drawn from, in alphabetical order."""
    failures: tuple[int, ...]
    """Places in job.FAILURES of those that stop this robot."""
    assumed: tuple[str, ...]
    not_judged: tuple[str, ...]


def simulated(robot: Robot) -> Simulated:
    """Raises UnfitError."""
    _check(robot)
    hands = _hands(robot)
    own_action = robot.mux.action_source
    has_scanner = any(scan.required for scan in robot.safety.scans)
    without = set() if has_scanner else set(NO_SCANNER)
    without |= NO_LOCK if not _locks_all(robot) else set()
    without |= set() if robot.safety.estop.required else NO_BUTTON
    without |= ONE_HAND if len(hands) < len(HANDS) else set()
    without |= {name for name in FAULTS if name.startswith("action_")} if not own_action else set()
    changed = _changed(robot, hands, own_action, has_scanner)
    return Simulated(
        changed,
        tuple(sorted(FAULTS.keys() - without)),
        tuple(_failures(frozenset(without), has_goals=bool(own_action))),
        tuple(_assumed(robot, changed, hands, has_scanner)),
        (
            *_sources_not_judged(robot, hands, own_action),
            *_sensors_not_judged(robot, has_scanner),
            *_drives_not_judged(robot),
        ),
    )


def _failures(without: frozenset[str], *, has_goals: bool) -> Iterator[int]:
    for place, failure in enumerate(FAILURES):
        meaningless = MEANS.get(failure.key) in without
        if not meaningless and (has_goals or failure.what not in OF_GOALS):
            yield place


def _check(robot: Robot) -> None:
    profiles = sorted({drive.profile for drive in robot.drives})
    if len(profiles) > 1:
        raise UnfitError(
            f"drives: {' and '.join(profiles)}: the judge knows robots whose drives are all of one kind. "
            "Nothing can be said about this robot"
        )
    if not _hands(robot):
        raise UnfitError(
            f"mux.sources: {', '.join(robot.mux.sources)} alone: nobody drives but goals. The campaign needs a source "
            "that orders motion by itself, such as a joystick"
        )
    if bus_load.cyclic_load(robot) > bus_load.FULL_LOAD:
        raise UnfitError(
            f"bus.bitrate: {robot.bus.bitrate} bit/s do not carry the frames of this robot. A virtual bus ignores the "
            "key, virtual time does not: write that of the real bus"
        )


def _hands(robot: Robot) -> tuple[str, ...]:
    """Names of the two sources with the highest priority that are not the action server."""
    own_action = robot.mux.action_source
    others = [(source.priority, name) for name, source in robot.mux.sources.items() if name != own_action]
    return tuple(name for _, name in sorted(others, reverse=True))[: len(HANDS)]


def _locks_all(robot: Robot) -> bool:
    """A lock that holds back every source; the campaign's own lock is one."""
    highest = max(source.priority for source in robot.mux.sources.values())
    return any(lock.priority > highest for lock in robot.mux.locks.values())


def _changed(robot: Robot, hands: tuple[str, ...], own_action: str, has_scanner: bool) -> Robot:
    """Names and topics are those of the campaign; every limit, timeout, rate and tolerance is the file's."""
    sources: dict[str, MuxSource] = {
        role: robot.mux.sources[name].model_copy(update={"topic": topic, "type": "twist", "stamped": True})
        for name, (role, topic) in zip(hands, HANDS.items(), strict=False)
    }
    if own_action:
        sources[ACTION] = robot.mux.sources[own_action]
    safety = robot.safety
    middle = {"x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0, "upside_down": False, "pose": "config"}
    scan = _slowest_scan(robot).model_copy(update={**middle, "topic": "scan", "required": has_scanner})
    changes = {
        "mux": robot.mux.model_copy(update={"sources": sources, "locks": {}}),
        "safety": safety.model_copy(
            update={
                "scan": scan,
                "more_scans": (),
                "require_self_stop": False,
                "estop": safety.estop.model_copy(update={"topic": "estop_state"}),
            }
        ),
        "action": robot.action.model_copy(update={"require_client_lease": False, "goal_policy": "reject"}),
    }
    return commissioned(robot.model_copy(update=changes))


def _slowest_scan(robot: Robot) -> Scan:
    """The one scanner that stands for all: of those that must be there, the one that is missed last."""
    scans = [scan for scan in robot.safety.scans if scan.required] or list(robot.safety.scans)
    return max(scans, key=lambda scan: scan.timeout_s + scan.frozen_s)


def _assumed(robot: Robot, changed: Robot, hands: tuple[str, ...], has_scanner: bool) -> Iterator[str]:
    if uncommissioned(robot):
        slow = uncommissioned_mps(robot)
        yield f"The robot is commissioned: the speeds of `limits` count, not safety.uncommissioned_mps ({slow:g} m/s)."
    if robot.safety.require_self_stop and without_proof(robot):
        yield "Drives get power without the proof that safety.require_self_stop demands."
    if robot.bus.is_virtual:
        yield f"The bus has {robot.bus.bitrate} bit/s (bus.bitrate; {robot.bus.interface} ignores the key)."
    yield f"{' and '.join(hands)} order motion, as a joystick and a planner do; a joystick is at 50 Hz."
    scan_s, button_s = publishes_s(changed)
    if has_scanner:
        yield f"One scanner in the middle of the base sees all around, {1.0 / scan_s:.0f} times a second, up to 5 m."
    yield f"The emergency stop button publishes {1.0 / button_s:.0f} times a second."
    if robot.mux.locks:
        yield f"mux.locks: {', '.join(robot.mux.locks)}: open, and their topics never missing."
    if robot.action.require_client_lease:
        yield "action.require_client_lease: the clients of goals send their keepalives."
    if robot.action.goal_policy != "reject":
        yield f"action.goal_policy: a goal while another one runs is rejected; {robot.action.goal_policy} is not tried."
    yield "Motors are strong enough for the accelerations of `limits`, with the load on the slope; tyres do not slip."


def _sources_not_judged(robot: Robot, hands: tuple[str, ...], own_action: str) -> Iterator[str]:
    silent = [name for name in robot.mux.sources if name not in (*hands, own_action)]
    if silent:
        yield f"mux.sources: {', '.join(silent)}: never ordered motion; {' and '.join(hands)} have higher priorities."
    joints = [name for name in hands if robot.mux.sources[name].type == JOINTS]
    if joints:
        yield f"mux.sources: {', '.join(joints)}: ordered velocities of the base, not speeds of its wheels."
    if own_action:
        nav2 = ", and Nav2's behaviours" if robot.action.nav2_behaviors else ""
        yield f"action: goals of drive_distance alone; rotate_angle{nav2} got none."
    else:
        yield "action: mux.sources has no stamped source on cmd_vel_action, so no goal was sent."
    if robot.mux.locks:
        yield "mux.locks: closing them" + (", but for two publishers on one." if _locks_all(robot) else ".")
    if any(source.same_clock for source in robot.mux.sources.values()):
        yield "mux.sources.….same_clock: delays by the stamps of commands."


def _sensors_not_judged(robot: Robot, has_scanner: bool) -> Iterator[str]:
    if not has_scanner:
        yield "safety.scan: no scanner is required, so the robot drove without one; obstacles were not looked at."
    elif len(robot.safety.scans) > 1:
        yield f"safety.more_scans: one scanner stood for all {len(robot.safety.scans)}: one alone never failed."
    if has_scanner:
        yield "safety.scan: places, blind sectors and fields of view of the scanners."
    if not robot.safety.estop.required:
        yield "safety.estop: a button whose messages do not arrive stops nothing, as safety.estop.required is false."


def _drives_not_judged(robot: Robot) -> Iterator[str]:
    if robot.watchdog.relay is not None:
        yield "watchdog.relay: the line that opens a safety relay is not simulated, so stops do not rely on it."
    profile = robot.drives[0].profile
    if profile not in PERSONALITIES:
        yield (
            f"drives: {profile} is a profile of your own: plain CiA 402 drives were simulated in its place. Whether "
            "the real ones stop by themselves is not known here; canbase setup commission tests it."
        )
    yield "Hardware: wiring, STO, brakes, tyres, the accuracy of the drive's model. This is simulation, no certificate."
