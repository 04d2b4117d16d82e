"""From a decision of the mux to ROS messages: velocity_mux/state and its entry in /diagnostics. No node, no clock."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from canbase.msg import ForeignPublisher, MuxLock, MuxSource, MuxState
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from canbase_config.diagnostics import VELOCITY_MUX, entry_name
from canbase_runtime.source_standing import IGNORED
from canbase_velocity.lock import LockView
from canbase_velocity.messages import or_nan
from canbase_velocity.mux import MuxDecision, SourceView
from canbase_velocity.unexpected_publishers import Foreign


def mux_state(decision: MuxDecision, stamp: Time) -> MuxState:
    """velocity_mux/state."""
    return MuxState(
        stamp=stamp,
        active=decision.active or "",
        ready=not decision.not_ready,
        not_ready=decision.not_ready,
        sources=[_source(source, decision.active) for source in decision.sources],
        locks=[_lock(lock) for lock in decision.locks],
        foreign=[_foreign(foreign, decision.foreign_lock) for foreign in decision.foreign],
    )


def diagnostics(decision: MuxDecision, robot: str, deaf: tuple[str, ...], stamp: Time) -> DiagnosticArray:
    """One entry. `deaf`: sentences about subscribers that receive nothing: their QoS requests more than we offer."""
    problems = [*(foreign.sentence for foreign in decision.foreign), *deaf]
    held = [f"{lock.name} {lock.reason}" for lock in decision.locks if lock.holds]
    ignored = decision.holder is not None and decision.holder.standing in IGNORED
    values = {source.name: source.reason or "drives" for source in decision.sources}
    values |= {"the base": decision.not_ready or "can move"}
    values |= {f"refused commands of {source.name}": str(source.refused) for source in decision.sources}
    values |= {f"lock {lock.name}": lock.reason or "free" for lock in decision.locks}
    values |= {f"foreign publisher {number}": foreign.sentence for number, foreign in enumerate(decision.foreign, 1)}
    status = DiagnosticStatus(
        level=DiagnosticStatus.WARN if problems or ignored else DiagnosticStatus.OK,
        name=entry_name(robot, VELOCITY_MUX),
        message="; ".join([decision.sentence, *held, *problems]),
        hardware_id=robot,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message


def _source(source: SourceView, active: str | None) -> MuxSource:
    return MuxSource(
        name=source.name,
        topic=source.topic,
        priority=source.priority,
        active=source.name == active,
        armed=source.armed,
        locked=source.locked,
        age_s=or_nan(source.age_s),
        timeout_s=source.timeout_s,
        delay_s=or_nan(source.delay_s),
        received=source.received,
        refused=source.refused,
        standing=source.standing,
        reason=source.reason,
    )


def _lock(lock: LockView) -> MuxLock:
    return MuxLock(
        name=lock.name,
        topic=lock.topic,
        priority=lock.priority,
        holds=lock.holds,
        required=lock.required,
        age_s=or_nan(lock.age_s),
        timeout_s=lock.timeout_s,
        standing=lock.standing,
        reason=lock.reason,
    )


def _foreign(foreign: Foreign, locks: bool) -> ForeignPublisher:
    return ForeignPublisher(
        topic=foreign.topic,
        node=foreign.node,
        type=foreign.kind,
        problem=foreign.problem,
        locks=locks and foreign.obeyed,
    )
