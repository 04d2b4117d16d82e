"""The checks of `canbase doctor` without --symptom: whether every part is there and reports that all is well.

Pure: from `Evidence` to rows. `CHECKS` is the order in which they are shown: from what explains most to the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from canbase.msg import DriverStatus, MuxState, SafetyState

from canbase_doctor.check import RESTART, Check, fail, ok, warn
from canbase_doctor.evidence import Evidence
from canbase_doctor.metrics_check import metrics
from canbase_doctor.nav2_checks import nav2_checks
from canbase_driver.cia402 import DriveState
from canbase_driver.supervision.watchdog_link import RUNGS
from canbase_runtime.driver_state import DriverState, driver_state
from canbase_runtime.source_standing import SourceStanding, source_standing
from canbase_runtime.watchdog_view import WatchdogView, watchdog_view

UNFOLLOWED = {
    SourceStanding.UNARMED: "release the joystick, or let that program order zero (docs/velocity.md, Neutral start)",
    SourceStanding.DELAYED: "look at the network between that sender and the robot, and at the clock of the sender",
    SourceStanding.UNKNOWN: "look at the log of velocity_mux",
}
"""What to do about a source that holds the base and is not followed."""
SILENT_S = 1.5
"""A state that was received longer ago is no evidence [s]: the slowest one comes every 0.5 s."""
HANGS = f"its process hangs, or its timers do not run: {RESTART}"
PARTS_RUN = "is it running (canbase up), in this namespace and ROS_DOMAIN_ID?"
MOSTLY_USABLE = 0.5
"""Share of beams: a scanner with more invalid beams is covered, dirty or defective."""
HEARTBEAT_LOST = 0x8130
"""Error code (CiA 301, EMCY): the heartbeat that a drive watches."""
PAUSE_S = 0.05
"""A pause of the watchdog's loop that is worth a look: ten of its turns."""


def configuration(evidence: Evidence) -> list[Check]:
    """The file was read and is valid, otherwise nothing was observed at all."""
    robot = evidence.robot
    return [ok("robot.yaml", f"{evidence.source} is good: {robot.name}, {len(robot.drives)} drives")]


def driver(evidence: Evidence) -> list[Check]:
    """The state of motor_driver, and its counters."""
    status = evidence.on("motor_driver/status").last
    if silent := _silent(evidence, "motor_driver", "motor_driver/status"):
        return [silent]
    state = driver_state(status.state)
    if state is DriverState.ENABLED:
        stands = "stands" if status.standstill else "moves"
        found = ok("motor_driver", f"enabled, {stands}; cmd_vel is {_age(status.command_age_s)} old")
    elif state.passes:
        found = warn("motor_driver", f"{state.word}, {status.cause}: {status.detail}", "look again in a second")
    else:
        found = fail("motor_driver", f"{state.word}, {status.cause}: {status.detail}", _until(status.clears_on))
    return [found, _counters(evidence.on("motor_driver/status").first, status)]


def _counters(before: DriverStatus, now: DriverStatus) -> Check:
    told = f"{_listed(_counts(now))}; cycles at most {now.cycle_lateness_max_s * 1e3:.1f} ms late"
    grew = _grew(_counts(before), _counts(now))
    if not grew:
        return ok("its counters", told)
    return warn(
        "its counters",
        told,
        f"{grew} grew while doctor listened: docs/troubleshooting.md, Counters of the driver, explains them",
    )


def _counts(status: DriverStatus) -> dict[str, int]:
    return {
        "commands_refused": status.commands_refused,
        "overruns": status.overruns,
        "frames_dropped": status.frames_dropped,
        "send_errors": status.send_errors,
    }


def watchdog(evidence: Evidence) -> list[Check]:
    """The watchdog as the driver receives it on the bus: its state, its ages, its counters."""
    heard = evidence.on("motor_driver/status")
    status = heard.last
    if status is None:
        return [
            fail(
                "watchdog",
                "unknown: nothing came on motor_driver/status, which reports it",
                PARTS_RUN,
            )
        ]
    age, view = _age(status.watchdog_age_s), watchdog_view(status.watchdog)
    if view is WatchdogView.MISSING:
        return [fail("watchdog", f"missing, last frame {age} ago", "start canbase serve watchdog with this robot.yaml")]
    told = f"last frame {age} ago; last lease {_age(status.watchdog_lease_age_s)} old"
    if view is WatchdogView.OK:
        found = ok("watchdog", f"ok, {told}")
    else:
        rung = RUNGS[min(status.watchdog_rung, len(RUNGS) - 1)]
        tripped = f"{view.value}: {status.watchdog_cause}; went as far as {rung}; {told}"
        found = fail("watchdog", tripped, "remove the cause (docs/bus.md), canbase reset")
    return [found, _watchdog_counters(heard.first, status)]


def _watchdog_counters(before: DriverStatus, now: DriverStatus) -> Check:
    name = "watchdog's counters"
    told = f"{_listed(_watchdog_counts(now))}; longest pause of its loop {now.watchdog_pause_max_s * 1e3:.0f} ms"
    grew = _grew(_watchdog_counts(before), _watchdog_counts(now))
    if grew:
        return warn(name, told, f"{grew} grew while doctor listened; docs/bus.md, 2FEh")
    if now.watchdog_pause_max_s > PAUSE_S:
        return warn(
            name, told, "its loop is delayed: is the computer overloaded? Does the process have real-time priority?"
        )
    return ok(name, told)


def _watchdog_counts(status: DriverStatus) -> dict[str, int]:
    return {
        "leases_refused": status.watchdog_leases_refused,
        "frames_dropped": status.watchdog_frames_dropped,
        "bus_errors": status.watchdog_bus_errors,
        "trips": status.watchdog_trips,
    }


def drives(evidence: Evidence) -> list[Check]:
    """One row per drive that motor_driver reports."""
    status = evidence.on("motor_driver/status").last
    if status is None:
        return []
    withheld = status.watchdog_rung >= RUNGS.index("heartbeat withheld")
    return [_drive(drive, withheld) for drive in status.drives]


def _drive(drive: Any, withheld: bool) -> Check:
    """`withheld`: the watchdog does not send its heartbeat, so that the drives stop by themselves."""
    name = f"drive {drive.joint} (node {drive.node_id})"
    ages = f"feedback {_age(drive.feedback_age_s)}, heartbeat {_age(drive.heartbeat_age_s)} old"
    found = f"{drive.state}, {drive.nmt_state}; {ages}"
    if withheld and drive.error_code == HEARTBEAT_LOST:
        return warn(name, f"{found}; it stopped by itself, as the watchdog withholds its heartbeat", "canbase reset")
    error = f"0x{drive.error_code:04X} {drive.error_text}"
    if drive.error_code and drive.state == DriveState.OPERATION_ENABLED.text:
        return warn(name, f"{found}; {error}, and it drives on", "see its manual")
    if drive.error_code:
        return fail(name, f"{found}; {error}", "remove the cause, canbase reset")
    if drive.boot_problem:
        return fail(name, f"{found}; {drive.boot_problem}", "the driver cannot boot it: do what this says")
    if not drive.heartbeat_age_s < SILENT_S and math.isnan(drive.feedback_age_s):
        return fail(
            name,
            f"no frame received; {found}",
            "power, cable, termination, bit rate, node id; canbase bus scan shows who answers",
        )
    if math.isnan(drive.feedback_age_s):
        return warn(name, f"{found}; it is not booted yet", "look again in a second")
    if not drive.stops_by_itself:
        return warn(
            name, f"{found}; does not watch the watchdog's heartbeat", "it will not stop when the computer dies"
        )
    return ok(name, found)


def safety_filter(evidence: Evidence) -> list[Check]:
    """What the filter lets through, and whether its leases arrive."""
    heard = evidence.on("safety_filter/state")
    state = heard.last
    if silent := _silent(evidence, "safety_filter", "safety_filter/state"):
        return [silent]
    found = f"{state.cause}: {state.detail}" if state.detail else state.cause
    if state.lease_errors > heard.first.lease_errors:
        lost = f"{state.lease_errors} leases could not be delivered to {evidence.robot.lease.socket}"
        return [fail("safety_filter", lost, "is canbase serve watchdog running, with the same lease.socket?")]
    if state.action == SafetyState.STOP:
        return [fail("safety_filter", f"stops, {found}", _until(state.clears_on))]
    if state.action == SafetyState.PASS:
        return [ok("safety_filter", f"passes; {state.lease_sequence} leases sent")]
    return [warn("safety_filter", f"slows down, {found}", _until(state.clears_on))]


def scanners(evidence: Evidence) -> list[Check]:
    """Each scanner as the safety filter sees it."""
    heard = evidence.on("safety_filter/state")
    if heard.last is None:
        return []
    before = {scanner.topic: scanner.dropped for scanner in heard.first.scanners}
    return [_scanner(scanner, scanner.dropped - before.get(scanner.topic, 0)) for scanner in heard.last.scanners]


def _scanner(scanner: Any, dropped: int) -> Check:
    """`dropped`: scans within the observation."""
    seen = "no usable scan yet" if math.isnan(scanner.age_s) else f"last usable scan {scanner.age_s:.2f} s old"
    name, found = f"scanner {scanner.topic}", seen
    if not math.isnan(scanner.usable_share):
        found += f", {scanner.usable_share:.0%} of its beams are usable"
    if dropped or scanner.problem:
        found += f"; {dropped} scans dropped: {scanner.problem or 'some could not be used'}"
    cure = "look at the scanner and its ROS driver; docs/velocity.md, Scanners, has what a scan must be"
    if scanner.required and not scanner.fresh:
        return fail(name, found, cure)
    if dropped or scanner.problem:
        return warn(name, found, cure)
    if scanner.usable_share < MOSTLY_USABLE:
        return warn(name, found, "the base only creeps to where the others look: clean it, free its view")
    return ok(name, found if scanner.fresh else f"{found}; it is not required")


def velocity_mux(evidence: Evidence) -> list[Check]:
    """Which nodes drive, and which publish what they should not: another type, a value that is not finite."""
    state = evidence.on("velocity_mux/state").last
    if silent := _silent(evidence, "velocity_mux", "velocity_mux/state"):
        return [silent]
    cure = (
        "end that publisher, or let it publish what is expected (`stamped` of the source in robot.yaml: Twist or not)"
    )
    unexpected = [warn(f"publisher on {each.topic}", f"{each.node}: {each.problem}", cure) for each in state.foreign]
    return [_mux(state), *unexpected]


def _mux(state: MuxState) -> Check:
    ignored = [source for source in state.sources if source.active and source_standing(source.standing) in UNFOLLOWED]
    if ignored:
        told = f"{ignored[0].name} is not followed: {ignored[0].reason}"
        return fail("velocity_mux", told, UNFOLLOWED[source_standing(ignored[0].standing)])
    found = f"{state.active} drives" if state.active else "no active source"
    held = [f"lock {lock.name}: {lock.reason}" for lock in state.locks if lock.holds]
    if held and not state.active:
        return warn("velocity_mux", f"{found}; {'; '.join(held)}", "release it (docs/velocity.md, Sources and locks)")
    bad = [source.name for source in state.sources if source.refused]
    if bad:
        return warn("velocity_mux", f"{found}; refused NaN or infinity of {', '.join(bad)}", "correct that sender")
    return ok("velocity_mux", found)


CHECKS: tuple[Callable[[Evidence], list[Check]], ...] = (
    configuration,
    watchdog,
    driver,
    drives,
    safety_filter,
    scanners,
    velocity_mux,
    nav2_checks,
    metrics,
)


def default_checks(evidence: Evidence) -> list[Check]:
    """All rows."""
    return [check for checks in CHECKS for check in checks(evidence)]


def _silent(evidence: Evidence, name: str, topic: str) -> Check | None:
    """Nothing came, or nothing any more: a latched topic gives the last words of a node that hangs to everybody."""
    heard = evidence.on(topic)
    if heard.last is None:
        return fail(name, f"nothing came on {topic}", PARTS_RUN)
    age_s = evidence.now_s - heard.times_s[-1]
    if age_s <= SILENT_S:
        return None
    return fail(name, f"nothing on {topic} for {age_s:.1f} s; older messages are ignored", HANGS)


def _listed(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())


def _grew(before: dict[str, int], now: dict[str, int]) -> str:
    """The names of the counters that grew; empty: none."""
    return ", ".join(name for name, count in now.items() if count > before[name])


def _until(clears_on: str) -> str:
    return f"it ends with: {clears_on}" if clears_on else "see its log"


def _age(age_s: float) -> str:
    return "never" if math.isnan(age_s) else f"{age_s:.2f} s"
