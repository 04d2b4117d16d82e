"""Checks of `canbase doctor --symptom` about the action: its server, its goals, their feedback, cancel and result.

Pure: from `Evidence` to one `Check` each. symptoms.py has the symptom that each belongs to.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from canbase_action_server.goal_request import DriveRequest, Request, RotateRequest
from canbase_action_server.goal_step import GoalStep
from canbase_action_server.nav2_request import Target, back_up, drive_on_heading, spin
from canbase_action_server.preconditions import state_reason
from canbase_config.robot import Robot
from canbase_doctor.check import RESTART, Check, fail, ok, too_slow, warn
from canbase_doctor.evidence import Evidence, Goal, LoggedStep, served_actions

ACTION = "drive_distance"
SLOW_ANSWER_S = 0.1
"""A server that takes longer does something else meanwhile; a cancel is promised within half of it."""
MARGIN_S = 1.0
"""On top of the braking time: the standstill has to be seen, and what is on the way has to arrive."""
SETTINGS = {
    "ROS_DOMAIN_ID": "0",
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "ROS_STATIC_PEERS": "",
    "RMW_IMPLEMENTATION": "",
}
"""What has to be alike for two processes to see each other; their defaults in `canbase`."""
_AFTER_STOPPING = (GoalStep.STANDSTILL, GoalStep.ENDED)


def server_process(seen: Evidence) -> Check:
    """Is there a server of this robot at all, on this computer or elsewhere?"""
    name, robot = "the server's process", seen.robot.name
    here = [str(process.pid) for process in seen.own_processes]
    if here:
        return ok(name, f"runs on this computer, process {', '.join(here)}")
    if seen.whole_name(ACTION) in seen.servers:
        return ok(name, "runs on another computer, or as another user")
    others = [f"process {process.pid} is that of {process.robot}" for process in seen.processes]
    elsewhere = _elsewhere(seen)
    found = "; ".join([f"none of {robot} runs on this computer, and none is seen", *others, *elsewhere])
    advice = "canbase up, or canbase serve action-server; see its log"
    return fail(name, found, f"{advice}. If {elsewhere[0]} is {robot}: --namespace" if elsewhere else advice)


def _elsewhere(seen: Evidence) -> list[str]:
    """The names that the action has in other namespaces, maybe by servers of other robots."""
    return sorted(action for action in seen.servers if action.endswith(f"/{ACTION}"))


def server_name(seen: Evidence) -> Check:
    """Is it offered under the name that was looked for?"""
    name, wanted, others = "name and namespace", seen.whole_name(ACTION), _elsewhere(seen)
    if wanted in others:
        return ok(name, wanted)
    if not others:
        return warn(name, f"no server offers {ACTION} under any name here", "see the next check")
    spaces = " or ".join(other.rsplit("/", 1)[0] or "/" for other in others)
    return fail(name, f"not {wanted}, but {', '.join(others)}", f"use --namespace {spaces}, that of {seen.robot.name}")


def domain(seen: Evidence) -> Check:
    """Do the two reach each other?"""
    name, ours = "domain and network", settings(seen.environment)
    if seen.whole_name(ACTION) in seen.servers:
        return ok(name, f"seen with ROS_DOMAIN_ID {ours['ROS_DOMAIN_ID']}")
    for process in seen.own_processes:
        theirs = settings(process.environment)
        apart = [f"{key} is {theirs[key] or 'not set'} there, {ours[key] or 'not set'} here" for key in SETTINGS
                 if theirs[key] != ours[key]]  # fmt: skip
        if apart:
            return fail(name, f"process {process.pid}: {'; '.join(apart)}", "set the same in both terminals")
    return fail(
        name, "same settings, yet not seen", "does it hang, or start just now? Multicast and firewall of the network?"
    )


def settings(environment: Any) -> dict[str, str]:
    """SETTINGS as a process has them."""
    return {key: environment.get(key) or default for key, default in SETTINGS.items()}


def goal_range(seen: Evidence) -> Check:
    """Were the numbers of the goal that was rejected last within the ranges of robot.yaml?"""
    name, goal = "range of the goal", _last_rejected(seen)
    if goal is None:
        return warn(name, "no goal was rejected in the last ten seconds", "send it again, then call doctor at once")
    reason = goal.range_reason(seen.robot)
    if reason is not None and _finite(goal):
        return fail(name, reason, "canbase config check shows the ranges under `action`")
    return ok(name, "within the ranges of robot.yaml" if reason is None else "see the next check")


def goal_finite(seen: Evidence) -> Check:
    """Were they numbers at all?"""
    name, goal = "NaN and infinity", _last_rejected(seen)
    if goal is None:
        return warn(name, "no goal was rejected in the last ten seconds", "send it again, then call doctor at once")
    if _finite(goal):
        return ok(name, "all numbers are finite")
    return fail(name, str(goal.range_reason(seen.robot)), "correct the client: it has divided by zero, or set nothing")


def busy_or_unsafe(seen: Evidence) -> Check:
    """Has the robot a place for a goal now, and may it move?"""
    name, policy = "busy, or not safe to start", seen.robot.action.goal_policy
    waiting = [goal for goal in seen.goals if not goal.ended]
    if policy == "reject" and waiting:
        return fail(
            name,
            f"busy: goal {waiting[0].uuid} of {waiting[0].action} runs",
            "wait, or cancel it; or set action.goal_policy",
        )
    if policy == "queue" and len(waiting) > seen.robot.action.queue_length:
        return fail(name, f"busy: {len(waiting) - 1} goals wait", "wait, or set action.queue_length")
    reason = state_reason(seen.robot, seen.inputs, seen.now_s)
    if reason is not None:
        return fail(name, reason, "canbase doctor without --symptom shows every part")
    return ok(name, "a good goal would be accepted now")


def goal_executes(seen: Evidence) -> Check:
    """Has the execute callback of a goal been entered?"""
    name = "a goal executes"
    if seen.running and _answers(seen):
        return ok(name, f"{seen.running[0].uuid} of {seen.running[0].action}")
    if not _answers(seen):
        found = "the server does not answer: whether a goal runs is unknown"
        return fail(name, found, "canbase doctor --symptom no-result")
    if any(goal.status == Goal.ACCEPTED for goal in seen.goals):
        return fail(name, "accepted, but it waits for another goal", "action.goal_policy decides this")
    return fail(name, "none runs now", "send a goal, and call doctor while it runs")


def feedback_rate(seen: Evidence) -> Check:
    """Does the server publish feedback as often as it should?"""
    name, wanted_hz = "feedback is published", seen.robot.action.feedback_hz
    rate_hz = max((seen.on(f"{goal.action}/_action/feedback").rate_hz for goal in seen.running), default=0.0)
    if rate_hz >= wanted_hz / 2.0:
        return ok(name, f"at {rate_hz:.1f} Hz")
    found = f"at {rate_hz:.1f} Hz instead of {wanted_hz:.0f} Hz"
    return too_slow(seen.overload.sentence, name, found, "is the server's computer overloaded? See its log")


def client_listens(seen: Evidence) -> Check:
    """Is there a client that receives it?"""
    name = "a client listens"
    nodes = sorted(
        {each.node for goal in seen.running for each in seen.subscribers.get(f"{goal.action}/_action/feedback", ())}
    )
    if nodes:
        return ok(name, f"{', '.join(nodes)}: has it a feedback callback (--feedback), and does it spin?")
    return fail(
        name, "the feedback has no subscriber", "the client has ended, or is in another namespace; the goal still runs"
    )


def nothing_blocks(seen: Evidence) -> Check:
    """Does any callback of the server take so long that the others wait?"""
    return _fast(seen, "no blocking work", seen.answers.question_s, "a callback of the server blocks: see its log")


def cancel_is_heard(seen: Evidence) -> Check:
    """Do cancel requests wait longer than other questions?"""
    return _fast(
        seen, "callback group of the cancel", seen.answers.cancel_s, "the cancel waits for callbacks of its own group"
    )


def control_cycle(seen: Evidence) -> Check:
    """Does the executor call the control timer on time?"""
    name, orders = "executor", seen.on("cmd_vel_action")
    if not seen.running or len(orders.messages) < 2:
        return warn(name, "no goal runs now: the control cycle was not measured", "call doctor while a goal runs")
    gap_s = orders.longest_gap_s
    if gap_s > SLOW_ANSWER_S:
        advice = "too little CPU for the server: see the load, nice, chrt"
        return too_slow(seen.overload.sentence, name, f"orders came up to {gap_s:.2f} s apart", advice)
    return ok(name, f"orders at most {gap_s * 1e3:.0f} ms apart")


def stop_procedure(seen: Evidence) -> Check:
    """After the order to stop, does the base stand within its braking time?"""
    name, limits, fastest_mps = "the stop itself", seen.robot.limits, seen.robot.action.max_speed_mps
    allowed_s = fastest_mps / limits.deceleration_mps2 + limits.deceleration_mps2 / limits.jerk_mps3 + MARGIN_S
    took_s = [_stop_time_s(seen, step) for step in seen.steps if step.step is GoalStep.STOPPING]
    if not took_s:
        return warn(name, "no goal was stopped in the last ten seconds", "cancel one, then call doctor at once")
    found = f"the last one took {took_s[-1]:.2f} s"
    if took_s[-1] > allowed_s:
        slow = f"{found}, expected at most {allowed_s:.2f} s"
        return too_slow(seen.overload.sentence, name, slow, "payload, slope, or limits.deceleration_mps2 too high")
    return ok(name, found)


def server_answers(seen: Evidence) -> Check:
    """Is the server alive?"""
    name = "the server answers"
    if _answers(seen):
        return ok(name, f"{len(seen.answers.question_s)} questions")
    return fail(
        name,
        "to nothing: it ended, or hangs",
        f"{RESTART}. The result is lost: look at the base, and do not send the goal again blindly",
    )


def results_are_kept(seen: Evidence) -> Check:
    """Does every goal that has ended give its result?"""
    name = "ended goals give their result"
    lost = [uuid for uuid, given in seen.answers.results.items() if not given]
    if lost:
        return fail(name, f"not {', '.join(lost)}", "an end without a result is a defect of the server: see its log")
    return ok(name, f"{len(seen.answers.results)} asked")


def goals_are_driven(seen: Evidence) -> Check:
    """Does every goal that executes come to orders, so that one of its ends will be reached?"""
    name = "running goals are on their way to an end"
    if not seen.running:
        return ok(name, "no goal runs")
    if seen.on("cmd_vel_action").messages:
        return ok(name, "orders flow; progress and overall timeout end it at the latest")
    return fail(
        name,
        f"{seen.running[0].uuid} executes, but nothing is ordered",
        "a defect of the server: see its log, restart it",
    )


def one_server(seen: Evidence) -> Check:
    """Is there one server for each action of the base?"""
    name, nodes = "one server", [""]
    for wanted in map(seen.whole_name, served_actions(seen.robot)):
        nodes = [endpoint.node for endpoint in seen.servers.get(wanted, ())]
        if not nodes:
            return fail(name, f"no server offers {wanted}", "canbase doctor --symptom not-listed")
        if len(nodes) > 1:
            found = f"{len(nodes)} servers offer {wanted}: {', '.join(nodes)}"
            return fail(
                name, found, "end all but one (of Nav2: its behavior_plugins); a second robot needs a namespace"
            )
    return ok(name, nodes[0])


def goal_policy(seen: Evidence) -> Check:
    """Does one goal at most own the base?"""
    name, policy = "one goal at a time", seen.robot.action.goal_policy
    if len(seen.running) <= 1:
        return ok(name, f"action.goal_policy is {policy}; {len(seen.running)} goals run")
    return fail(name, f"{len(seen.running)} goals run", "a defect, or a second server: see the server's log")


def one_publisher(seen: Evidence) -> Check:
    """Does only the server order as the action source?"""
    name = "one publisher of cmd_vel_action"
    nodes = [endpoint.node for endpoint in seen.publishers.get("cmd_vel_action", ())]
    if len(nodes) <= 1:
        return ok(name, ", ".join(nodes) or "none")
    return fail(name, ", ".join(nodes), "each source of velocity needs a topic of its own under mux.sources")


def _last_rejected(seen: Evidence) -> Request | None:
    rejected = [step.values for step in seen.steps if step.step is GoalStep.REJECTED]
    if not rejected:
        return None
    last = rejected[-1]
    if "distance_m" in last:
        return DriveRequest(last["distance_m"], last["max_speed_mps"])
    if "angle_rad" in last:
        return RotateRequest(last["angle_rad"], last["max_speed_radps"])
    return _behavior(seen.robot, last)


def _behavior(robot: Robot, goal: Mapping[str, Any]) -> DriveRequest | RotateRequest:
    """Of an action of Nav2: what it drives. Its numbers are in range: other goals are not rejected, but end at once."""
    if goal["action"] == "spin":
        return spin(robot, goal["target_yaw"], 0.0).motion_request
    behavior = back_up if goal["action"] == "backup" else drive_on_heading
    return behavior(robot, Target(goal["target.x"]), goal["speed"], 0.0).motion_request


def _answers(seen: Evidence) -> bool:
    return any(math.isfinite(time_s) for time_s in seen.answers.question_s)


def _finite(goal: Any) -> bool:
    return all(math.isfinite(getattr(goal, name)) for name in goal.__slots__)


def _fast(seen: Evidence, name: str, times_s: tuple[float, ...], advice: str) -> Check:
    if not times_s:
        return fail(name, "the server was not queried: it was not found", "canbase doctor --symptom not-listed")
    found = f"answers within {max(times_s) * 1e3:.0f} ms at most, {len(times_s)} questions"
    if max(times_s) <= SLOW_ANSWER_S:
        return ok(name, found)
    silent = math.inf in times_s  # no answer at all is no matter of a busy computer
    return too_slow("" if silent else seen.overload.sentence, name, found, advice)


def _stop_time_s(seen: Evidence, stopping: LoggedStep) -> float:
    ends = (step.at_s for step in seen.steps if step.uuid == stopping.uuid and step.step in _AFTER_STOPPING)
    return next(ends, seen.wall_s) - stopping.at_s
