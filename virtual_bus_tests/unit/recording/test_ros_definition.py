"""The definitions of ROS types in a recording: each contained type once, below its own name."""

from __future__ import annotations

import pytest

from canbase_recording.ros_definition import SEPARATOR, whole_definition


def test_each_contained_type_comes_once_below_its_own_name() -> None:
    first, *others = whole_definition("nav_msgs", "Odometry").split(f"\n{SEPARATOR}\n")
    assert "geometry_msgs/PoseWithCovariance pose" in first
    assert sorted(part.split("\n")[0] for part in others) == [
        "MSG: builtin_interfaces/Time",
        "MSG: geometry_msgs/Point",
        "MSG: geometry_msgs/Pose",
        "MSG: geometry_msgs/PoseWithCovariance",
        "MSG: geometry_msgs/Quaternion",
        "MSG: geometry_msgs/Twist",
        "MSG: geometry_msgs/TwistWithCovariance",
        "MSG: geometry_msgs/Vector3",
        "MSG: std_msgs/Header",
    ]


def test_a_type_that_is_not_installed_is_an_error() -> None:
    with pytest.raises(OSError, match="Nothing"):
        whole_definition("nav_msgs", "Nothing")
