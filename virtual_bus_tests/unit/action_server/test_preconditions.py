"""Which goals may start: numbers dense at the limits, and each reason against a robot that is not ready."""

import math
from dataclasses import replace

import pytest

from canbase_action_server.goal_request import DriveRequest
from canbase_action_server.inputs import Safety
from canbase_action_server.preconditions import NO_SOURCE, state_reason
from canbase_config.mux import Mux, MuxSource
from canbase_runtime.driver_state import DriverState
from canbase_runtime.stop_cause import SCAN_LOST, StopCause
from canbase_runtime.watchdog_view import WatchdogView
from support.action_plant import GOOD_DRIVER, GOOD_MUX, GOOD_SAFETY, Plant, bench_robot, good_inputs, replaced

ROBOT = bench_robot()  # action.*: 0.01 to 5 m, 0.02 to 0.5 m/s


def stopped(cause: StopCause) -> Safety:
    """The safety filter stops the base."""
    return replace(GOOD_SAFETY, stops=True, cause=cause, detail="as the test says")


READY = good_inputs(Plant().odometry(0.0))


@pytest.mark.parametrize("distance_m", [0.01, -0.01, 0.011, 5.0, -5.0, 1.0])
@pytest.mark.parametrize("speed_mps", [0.02, 0.5, 0.3])
def test_numbers_within_the_limits_are_good(distance_m: float, speed_mps: float) -> None:
    assert DriveRequest(distance_m, speed_mps).range_reason(ROBOT) is None


def test_a_limit_that_float32_rounded_outward_is_still_the_limit() -> None:
    smallest = DriveRequest(0.009999999776482582, 0.019999999552965164)  # float32(0.01), float32(0.02)
    assert smallest.range_reason(ROBOT) is None


@pytest.mark.parametrize("distance_m", [0.0, -0.0, 0.00999, -0.00999, 5.0001, -5.0001, math.inf, -math.inf, math.nan])
def test_a_distance_outside_is_refused_with_its_range(distance_m: float) -> None:
    reason = DriveRequest(distance_m, 0.2).range_reason(ROBOT)
    assert reason is not None
    assert "|distance_m|" in reason
    assert "0.01 to 5.0" in reason


@pytest.mark.parametrize("speed_mps", [0.0, -0.2, 0.0199, 0.5001, math.inf, -math.inf, math.nan])
def test_a_speed_outside_is_refused_with_its_range(speed_mps: float) -> None:
    reason = DriveRequest(1.0, speed_mps).range_reason(ROBOT)
    assert reason is not None
    assert "max_speed_mps" in reason
    assert "0.02 to 0.5" in reason


def test_a_robot_that_is_ready_has_no_reason_against_it() -> None:
    assert state_reason(ROBOT, READY, 0.0) is None
    assert state_reason(ROBOT, replaced(READY, 0.0, mux=replace(GOOD_MUX, active="action")), 0.0) is None


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"shutdown": True}, "shutting down"),
        ({"odometry": None}, "nothing received on odom"),
        ({"safety": None}, "nothing received on safety_filter/state"),
        ({"driver": None}, "nothing received on motor_driver/status"),
        ({"mux": None}, "nothing received on velocity_mux/state"),
        ({"safety": replace(GOOD_SAFETY, estop=True)}, "emergency stop"),
        ({"safety": replace(GOOD_SAFETY, cause=StopCause.ESTOP_STALE)}, "emergency stop"),
        ({"driver": replace(GOOD_DRIVER, state=DriverState.LATCHED)}, "latched, not enabled"),
        ({"driver": replace(GOOD_DRIVER, watchdog=WatchdogView.MISSING)}, "watchdog is missing"),
        ({"driver": replace(GOOD_DRIVER, watchdog=WatchdogView.TRIPPED), "odometry": None}, "watchdog is tripped"),
        ({"driver": replace(GOOD_DRIVER, state=DriverState.LATCHED), "odometry": None}, "latched, not enabled"),
        ({"driver": replace(GOOD_DRIVER, hears_command=False)}, "receives no cmd_vel"),
        ({"mux": replace(GOOD_MUX, active="joystick")}, "joystick has the base"),
        ({"mux": replace(GOOD_MUX, held_back="locked: pause holds")}, "holds action back: locked: pause holds"),
        ({"safety": stopped(StopCause.SHUTDOWN)}, "stops the base (shutdown): as the test says"),
        ({"safety": stopped(StopCause.COMMAND_STALE)}, "stops the base (command_stale): as the test says"),
        ({"safety": stopped(StopCause.UNKNOWN)}, "stops the base (unknown): as the test says"),
        *(({"safety": stopped(cause)}, "laser scan lost: as the test says") for cause in sorted(SCAN_LOST, key=str)),
    ],
)
def test_each_thing_that_is_missing_is_named(changes: dict[str, object], reason: str) -> None:
    assert reason in str(state_reason(ROBOT, replaced(READY, 0.0, **changes), 0.0))


@pytest.mark.parametrize("state", [state for state in DriverState if state is not DriverState.ENABLED])
def test_every_state_of_the_driver_without_power_is_named_with_its_detail(state: DriverState) -> None:
    driver = replace(GOOD_DRIVER, state=state, detail="left_wheel: 0x2310")
    assert state_reason(ROBOT, replaced(READY, 0.0, driver=driver), 0.0) == (
        f"motor_driver is {state.word}, not enabled: left_wheel: 0x2310"
        + ("; canbase reset ends it, when its cause is gone" if state is DriverState.LATCHED else "")
    )


@pytest.mark.parametrize("view", [view for view in WatchdogView if view is not WatchdogView.OK])
def test_every_state_of_the_watchdog_but_ok_is_named_with_its_cause(view: WatchdogView) -> None:
    driver = replace(GOOD_DRIVER, watchdog=view, watchdog_cause="lease lost", state=DriverState.LATCHED)
    tripped = view is WatchdogView.TRIPPED
    remedy = "canbase reset ends it, when its cause is gone" if tripped else "does it run, and is its bus well?"
    expected = f"watchdog is {view.value} (cause lease lost); {remedy}"
    assert state_reason(ROBOT, replaced(READY, 0.0, driver=driver), 0.0) == expected


def test_a_watchdog_that_is_missing_has_no_cause() -> None:
    driver = replace(GOOD_DRIVER, watchdog=WatchdogView.MISSING, watchdog_cause="none")
    expected = "watchdog is missing; does it run, and is its bus well?"
    assert state_reason(ROBOT, replaced(READY, 0.0, driver=driver), 0.0) == expected


def test_of_several_causes_the_one_that_explains_the_others_is_named() -> None:
    everything = replaced(
        READY,
        0.0,
        safety=replace(stopped(StopCause.ESTOP), estop=True),
        driver=replace(GOOD_DRIVER, state=DriverState.LATCHED, watchdog=WatchdogView.TRIPPED, hears_command=False),
        mux=replace(GOOD_MUX, active="joystick", held_back="locked: pause holds"),
    )
    order = []
    for cure in (
        {"safety": stopped(StopCause.SCAN_STALE)},
        {"driver": replace(GOOD_DRIVER, state=DriverState.LATCHED, hears_command=False)},
        {"driver": replace(GOOD_DRIVER, hears_command=False)},
        {"driver": GOOD_DRIVER},
        {"mux": replace(GOOD_MUX, held_back="locked: pause holds")},
        {"safety": GOOD_SAFETY},
        {"mux": GOOD_MUX},
    ):
        order.append(str(state_reason(ROBOT, everything, 0.0)).split(" ")[0])
        everything = replaced(everything, 0.0, **cure)
    assert order == ["emergency", "watchdog", "motor_driver", "motor_driver", "joystick", "laser", "velocity_mux"]
    assert state_reason(ROBOT, everything, 0.0) is None


def test_an_obstacle_before_the_base_refuses_no_goal() -> None:
    assert state_reason(ROBOT, replaced(READY, 0.0, safety=stopped(StopCause.OBSTACLE)), 0.0) is None


@pytest.mark.parametrize(
    ("name", "topic", "timeout_s"),
    [
        ("odometry", "odom", 0.2),
        ("driver", "motor_driver/status", 0.3),
        ("safety", "safety_filter/state", 0.3),
        ("mux", "velocity_mux/state", 0.3),
    ],
)
def test_old_messages_are_no_messages(name: str, topic: str, timeout_s: float) -> None:
    def reason(age_s: float) -> str | None:
        inputs = good_inputs(Plant().odometry(10.0))
        old = replace(getattr(inputs, name), received_at_s=10.0 - age_s)
        return state_reason(ROBOT, replace(inputs, **{name: old}), 10.0)

    assert reason(timeout_s - 1e-9) is None
    assert f"no message on {topic} for {timeout_s:.2f} s (timeout {timeout_s} s)" in str(reason(timeout_s + 1e-9))


@pytest.mark.parametrize(
    "source",
    [
        MuxSource(topic="cmd_vel_joy", priority=1, timeout_s=0.3),
        MuxSource(topic="cmd_vel_action", priority=1, timeout_s=0.3, stamped=False),  # it would hear no TwistStamped
        MuxSource(topic="cmd_vel_action", type="joint_command", priority=1, timeout_s=0.3),
    ],
)
def test_where_the_mux_does_not_hear_the_action_server_every_goal_is_refused(source: MuxSource) -> None:
    assert ROBOT.mux.action_source == "action"
    robot = ROBOT.model_copy(update={"mux": Mux(sources={"only": source})})
    assert state_reason(robot, READY, 0.0) == NO_SOURCE
