"""A second driver, watchdog, filter or stack on a running robot is refused before it does anything, and says why."""

from __future__ import annotations

import pytest
from canbase.msg import DriverStatus

from ros.running_robot import own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(200)]


# the robot drives ── a second of each is started ── each ends with 1 and the holder's process; the robot drives on
def test_a_second_of_each_part_is_refused_and_disturbs_nothing() -> None:
    with own_domain() as domain, robot_on(domain) as robot:
        pids = robot.stack.pids
        parts = {"driver": "driver", "watchdog": "watchdog", "velocity": "velocity", "up": "driver"}
        robot.goal(4.0, 0.2)
        robot.wait_speed(0.19)
        robot.status.clear()
        seconds = {part: robot.command(part, "--config", str(robot.config)) for part in parts}
        for part, holder in parts.items():
            code, log = robot.exit_code(seconds[part]), seconds[part].log()
            assert (code, f"process {pids[holder]} of user" in log) == (1, True), (part, log)
        assert robot.truth().linear_mps > 0.19
        assert {status.state for status in robot.status.messages} == {DriverStatus.ENABLED}
