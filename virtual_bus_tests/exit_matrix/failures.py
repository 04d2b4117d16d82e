"""The exit matrix as a table: what fails, how, and which parts may catch it. The meaning of a row is in `runner.py`."""

from __future__ import annotations

from dataclasses import dataclass
from signal import SIGINT, SIGKILL, SIGSTOP, SIGTERM

from exit_matrix import stop_limits as by
from exit_matrix.driven_robot import CLIENT, By
from exit_matrix.injections import (
    Inject,
    Undo,
    breaks,
    ends,
    estop_dies,
    estop_pressed,
    fault,
    heal,
    joystick_dies,
    no_second_master,
    nothing,
    publish_no_more,
    publish_straight,
    resumes,
    scan_dies,
    second_master,
    sends,
    then_zero,
)
from exit_matrix.stop_limits import Layer

DRIVER, VELOCITY, WATCHDOG, SERVER = "driver", "velocity", "watchdog", "action-server"
"""Parts of `canbase_cli.stack`."""
BEHIND_FILTER = ("motor_driver", "watchdog", "drives")
BROKEN = 1
"""Exit code after a defect."""
COMMON = (
    (DRIVER, "SIGKILL"),
    (DRIVER, "SIGSTOP"),
    (VELOCITY, "SIGKILL"),
    (WATCHDOG, "SIGKILL"),
    (WATCHDOG, "SIGSTOP"),
    (SERVER, "SIGSTOP"),
)
"""Processes that `make test` kills and stops in a row of the matrix. It stops the velocity process in
ros/test_velocity_hang.py, and kills the server in ros/test_up.py."""


@dataclass(frozen=True, slots=True)
class Row:
    """One failure of a robot that drives. At least one of `caught_by` must have caught it, within its limit."""

    what: str
    how: str
    inject: Inject
    caught_by: tuple[Layer, ...]
    undo: Undo = nothing
    driven_by: By = By.GOAL
    ended: tuple[str, int] | None = None
    """The part that must have ended, and its exit code; all others still run."""
    starves: str = ""
    """The part that never waits: with real-time priority the system ends it sooner or later (RLIMIT_RTTIME)."""
    holds: bool = True
    """A joystick that orders motion moves nothing until `undo` and, where the stop is latched, a reset."""
    common: bool = False
    """One of those that `make test` runs."""

    @property
    def name(self) -> str:
        """As pytest and --only know it."""
        return f"{self.what}: {self.how}"

    @property
    def latched_behind_filter(self) -> bool:
        """Driver, watchdog or drives hold the stop themselves: it must meet orders on cmd_vel too.

        A joystick that is held does not get so far: the mux waits for its zero.
        """
        return self.holds and all(layer.who in BEHIND_FILTER for layer in self.caught_by)


def _process(what: str, part: str, columns: dict[str, tuple[Layer, ...]], free: tuple[str, ...] = ()) -> list[Row]:
    """The rows of one process. `free`: after these the base may be driven on at once."""
    return [_of_process(what, part, how, layers, how not in free) for how, layers in columns.items()]


def _of_process(what: str, part: str, how: str, caught_by: tuple[Layer, ...], holds: bool) -> Row:
    inject, exit_code = {
        "SIGINT": (sends(part, SIGINT), 0),
        "SIGTERM": (sends(part, SIGTERM), 0),
        "SIGKILL": (sends(part, SIGKILL), -SIGKILL),
        "SIGSTOP": (sends(part, SIGSTOP), None),
        "exception": (breaks(part, "raise_error"), BROKEN),
        "busy loop": (breaks(part, "be_busy"), None),
        "exception in its control thread": (breaks(part, "break_control_thread"), BROKEN),
        "busy loop in its control thread": (breaks(part, "hang_control_thread"), BROKEN),
    }[how]
    return Row(
        what,
        how,
        inject,
        caught_by,
        undo=resumes(part) if how == "SIGSTOP" else nothing,
        driven_by=By.CLIENT if part == CLIENT else By.GOAL,
        ended=None if exit_code is None or part == CLIENT else (part, exit_code),
        starves=part if how == "busy loop" else "",
        holds=holds,
        common=(part, how) in COMMON,
    )


PROCESSES = (
    *_process(
        "motor_driver",
        DRIVER,
        {
            "SIGINT": (by.DRIVER_SHUTDOWN,),
            "SIGTERM": (by.DRIVER_SHUTDOWN,),
            "SIGKILL": (by.WATCHDOG_DRIVER, by.DRIVES),
            "SIGSTOP": (by.WATCHDOG_DRIVER, by.DRIVES),
            "exception": (by.DRIVER_EXCEPTION_RAMP,),
            "busy loop": (by.DRIVER_STALE,),
            "exception in its control thread": (by.DRIVER_EXCEPTION,),
            "busy loop in its control thread": (by.WATCHDOG_DRIVER, by.DRIVES),
        },
        free=("busy loop",),
    ),
    *_process(
        "velocity process",
        VELOCITY,
        {
            "SIGINT": (by.FILTER_SHUTDOWN,),
            "SIGTERM": (by.FILTER_SHUTDOWN,),
            "SIGKILL": (by.WATCHDOG_LEASE,),
            "SIGSTOP": (by.WATCHDOG_LEASE,),
            "exception": (by.FILTER_SHUTDOWN,),
            "busy loop": (by.WATCHDOG_LEASE,),
        },
    ),
    *_process(
        "watchdog",
        WATCHDOG,
        {
            "SIGINT": (by.WATCHDOG_ENDED,),
            "SIGTERM": (by.WATCHDOG_ENDED,),
            "SIGKILL": (by.DRIVER_WATCHDOG, by.DRIVES),
            "SIGSTOP": (by.DRIVER_WATCHDOG, by.DRIVES),
            "exception": (by.WATCHDOG_EXCEPTION,),
            "busy loop": (by.DRIVER_WATCHDOG, by.DRIVES),
        },
    ),
    *_process(
        "drive_distance_server",
        SERVER,
        {
            "SIGINT": (by.SERVER_SHUTDOWN,),
            "SIGTERM": (by.SERVER_SHUTDOWN,),
            "SIGKILL": (by.MUX_ACTION,),
            "SIGSTOP": (by.MUX_ACTION,),
            "exception": (by.SERVER_EXCEPTION,),
            "busy loop": (by.MUX_ACTION,),
        },
        free=("SIGINT", "SIGTERM", "SIGKILL", "SIGSTOP", "exception", "busy loop"),
    ),
    *_process(
        "client",
        CLIENT,
        {
            "SIGINT": (by.SERVER_CANCELED,),
            "SIGTERM": (by.SERVER_CANCELED,),
            "SIGKILL": (by.SERVER_CLIENT,),
            "SIGSTOP": (by.SERVER_CLIENT,),
            "exception": (by.SERVER_CLIENT,),
            "busy loop": (by.SERVER_CLIENT,),
        },
        free=("SIGINT", "SIGTERM", "SIGKILL", "SIGSTOP", "exception", "busy loop"),
    ),
)

BUS = (
    Row("cable", "cut both ways", fault("cut"), (by.DRIVES,), heal, common=True),
    Row("cable", "nothing reaches the drives", fault("deaf"), (by.DRIVES,), heal),
    Row("cable", "nothing comes from the drives", fault("silent"), (by.DRIVER_DRIVE_SILENT, by.WATCHDOG_DRIVE), heal),
    Row("drive", "silent", fault("silent", 1), (by.DRIVER_DRIVE_SILENT, by.WATCHDOG_DRIVE), heal),
    Row("drive", "in fault", fault("fault", 1), (by.DRIVER_FAULT,), heal, common=True),
    Row(
        "drive",
        "reset: without power for 0.5 s",
        fault("power_cycle", 1),
        (by.DRIVER_DRIVE_RESTARTED, by.DRIVER_DRIVE_GONE, by.WATCHDOG_DRIVE_GONE),
    ),
    Row("drive", "encoder frozen", fault("frozen_encoder", 1), (by.WATCHDOG_FEEDBACK,), heal),
    Row("drive", "actual velocity stuck at 0", fault("stuck_velocity", 1, raw=0), (by.WATCHDOG_FEEDBACK,), heal),
    Row(
        "drive",
        "actual velocity stuck, then zero is commanded",
        then_zero(fault("stuck_velocity", 1)),
        (by.WATCHDOG_STUCK,),
        heal,
        By.JOYSTICK,
    ),
    Row(
        "drive",
        "ignores its setpoints, then zero is commanded",
        then_zero(fault("ignores_setpoints", 1)),
        (by.WATCHDOG_MOTION,),
        heal,
        By.JOYSTICK,
    ),
    Row(
        "motor_driver",
        "repeats its last setpoints for ever, then zero is commanded",
        then_zero(breaks(DRIVER, "repeat_setpoints")),
        (by.WATCHDOG_KEPT,),
        ends(DRIVER),
        By.JOYSTICK,
        common=True,
    ),
    Row(
        "motor_driver",
        "ignores zero, then zero is commanded",
        then_zero(breaks(DRIVER, "ignore_zero")),
        (by.WATCHDOG_KEPT,),
        ends(DRIVER),
        By.JOYSTICK,
    ),
    Row(
        "cmd_vel",
        "another node publishes to it, then zero is commanded",
        then_zero(publish_straight),
        (by.WATCHDOG_KEPT,),
        publish_no_more,
        By.JOYSTICK,
    ),
    Row("second master", "sends setpoints too", second_master, (by.WATCHDOG_FOREIGN,), no_second_master),
)

LIES = tuple(
    Row(what, how, inject, caught_by, heal, By.JOYSTICK)
    for what, how, inject, caught_by in (
        ("encoder", "lost: nothing counts, no speed", fault("encoder_lost", 1), (by.WATCHDOG_SENSOR,)),
        ("encoder", "counts backward", fault("encoder_reversed", 1), (by.WATCHDOG_SENSOR, by.WATCHDOG_BACKWARD)),
        ("wheel", "blocked", fault("blocked", 1), (by.WATCHDOG_SENSOR,)),
        ("wheel", "follows half of its setpoint", fault("limited", 1, share=0.5), (by.WATCHDOG_TWIST,)),
    )
)

ROS = (
    Row("joystick", "dies", joystick_dies, (by.MUX_JOYSTICK,), driven_by=By.JOYSTICK, holds=False),
    Row(
        "odometry",
        "stale",
        breaks(DRIVER, "withhold_odometry"),
        (by.SERVER_ODOMETRY,),
        ends(DRIVER),
        holds=False,
    ),
    Row("scan", "stale", scan_dies, (by.FILTER_SCAN,)),
    Row("emergency stop", "pressed", estop_pressed, (by.FILTER_ESTOP,), common=True),
    Row("emergency stop", "stale", estop_dies, (by.FILTER_ESTOP_STALE,)),
)

ROWS: tuple[Row, ...] = (*PROCESSES, *BUS, *LIES, *ROS)
