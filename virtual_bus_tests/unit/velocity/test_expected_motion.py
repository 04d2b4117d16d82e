"""How the safety filter expects the base to move: the driver's ramps, and a memory of poses."""

from __future__ import annotations

import pytest

from canbase_velocity.motion import ExpectedMotion
from canbase_velocity.twist import Twist
from support.filter_inputs import LIMITS


def test_the_expected_pose_is_remembered_between_orders_and_no_longer_than_asked_for() -> None:
    motion = ExpectedMotion(LIMITS, memory_s=0.5)
    motion.order(Twist(1.0, 0.0), 10.0)
    at_m = [motion.advance(10.0 + step * 0.1).x_m for step in range(21)]
    assert at_m[10] == pytest.approx(0.5, abs=1e-6)  # 1 m/s² from rest
    assert motion.pose_at(11.75).x_m == pytest.approx((at_m[17] + at_m[18]) / 2.0)
    assert motion.pose_at(11.8).x_m == pytest.approx(at_m[18])
    assert motion.pose_at(13.0).x_m == at_m[20]
    assert at_m[14] <= motion.pose_at(10.0).x_m <= at_m[15]
