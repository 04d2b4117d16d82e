"""`canbase cancel`: cancels the goals of all actions of the robot, whoever sent them, and waits for standstill."""

from __future__ import annotations

import time
from typing import Annotated, Any, Final

import typer

from canbase_cli.options import NamespaceOption
from canbase_cli.trigger import Caller
from canbase_runtime.terminal import FAILED, colour, fail

SERVICE: Final = "drive_distance_server/cancel_goals"
NO_SERVER: Final = 6
ANSWER_S: Final = 5.0
STANDSTILL_S: Final = 10.0
"""As long as `canbase drive` waits for the end of a goal that it canceled."""
PERIOD_S: Final = 0.2
UNHEARD: Final = (
    "If the action server has ended, the base stops by itself once cmd_vel_action is silent; if it only cannot be "
    "reached, its goals go on: `canbase stop`"
)
WaitOption = Annotated[
    float, typer.Option("--wait", metavar="SECONDS", min=0.1, help="How long to look for the action server.")
]


def cancel(ctx: typer.Context, wait_s: WaitOption = 5.0, namespace: NamespaceOption = "") -> None:
    """Cancel the goals of all actions of the robot, those that wait too, and wait for standstill.

    Goals that arrive later are not canceled. Drives keep their power: `canbase stop` takes it.

    Exit codes: 0 no goal is open any more and the base is at standstill, 1 goals or motion go on, 2 wrong command line,
    6 no action server, or it does not answer.
    """
    with Caller(ctx, namespace, wait_s) as caller:
        goals = _request(caller, None)
        if not goals:
            _tell("no goal runs or waits")
            return
        typer.echo(f"{_number(len(goals))} canceled; waiting for standstill", err=True)
        newest = max((goal.stamp for goal in goals), key=lambda stamp: (stamp.sec, stamp.nanosec))
        _wait_for_ends(caller, newest)
        if not caller.is_at_standstill():
            fail(
                "every goal has ended, and motor_driver does not report standstill: another source may drive "
                "(`canbase monitor`); `canbase stop` stops the base",
                FAILED,
            )
        _tell(f"{_number(len(goals))} ended; the base is at standstill")


def _request(caller: Caller, stamp: Any) -> list[Any]:
    """Cancels all goals, or those accepted until `stamp`; which of them have not ended yet."""
    from action_msgs.srv import CancelGoal

    request = CancelGoal.Request()
    if stamp is not None:
        request.goal_info.stamp = stamp
    if not caller.offers(CancelGoal, SERVICE):
        fail(
            f"no action server with {SERVICE} is found: it has ended, hangs, or has another namespace. {UNHEARD}",
            NO_SERVER,
        )
    answer = caller.answer(CancelGoal, SERVICE, request, ANSWER_S)
    if answer is None:
        fail(f"{SERVICE} does not answer within {ANSWER_S:.0f} s: the action server hangs. {UNHEARD}", NO_SERVER)
    return list(answer.goals_canceling)


def _wait_for_ends(caller: Caller, stamp: Any) -> None:
    deadline_s = time.monotonic() + STANDSTILL_S
    while left := _request(caller, stamp):
        if time.monotonic() > deadline_s:
            fail(f"{_number(len(left))} not ended after {STANDSTILL_S:.0f} s; `canbase stop` stops the base", FAILED)
        time.sleep(PERIOD_S)


def _number(goals: int) -> str:
    return f"{goals} goal{'s' if goals > 1 else ''}"


def _tell(sentence: str) -> None:
    typer.secho(sentence, fg=typer.colors.GREEN, color=colour())
