"""A second driver, watchdog, filter or stack on a running robot is refused before it does anything, and says why."""

from __future__ import annotations

import pytest
from canbase.msg import DriverStatus

from support.running_robot import own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(200)]


# the robot has power ── a second of each, one after the other ── each ends with 1 and the holder's process
def test_a_second_of_each_part_is_refused_and_disturbs_nothing() -> None:
    with own_domain() as domain, robot_on(domain) as robot:
        pids = robot.stack.pids
        robot.status.clear()
        for part, holder in {
            "up": "driver",
            "watchdog": "watchdog",
            "velocity": "velocity",
            "driver": "driver",
        }.items():
            second = robot.command(part, "--config", str(robot.config))
            code = robot.exit_code(second, 60.0)
            assert (code, f"process {pids[holder]} of user" in second.log()) == (1, True), (part, second.log())
        assert {status.state for status in robot.status.messages} == {DriverStatus.ENABLED}
        assert robot.driven(0.1)
