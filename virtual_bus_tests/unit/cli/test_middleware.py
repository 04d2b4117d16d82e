"""What the commands tell Fast DDS by the environment, and what they leave alone."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from canbase_cli.middleware import prefer_udp, stay_on_this_computer


def test_who_has_said_nothing_is_heard_on_this_computer_alone() -> None:
    environment: dict[str, str] = {"ROS_DOMAIN_ID": "7"}
    stay_on_this_computer(environment)
    assert environment == {"ROS_DOMAIN_ID": "7", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT"),
        ("ROS_STATIC_PEERS", "192.0.2.7"),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", "/etc/dds.xml"),
        ("FASTDDS_DEFAULT_PROFILES_FILE", "/etc/dds.xml"),
    ],
)
def test_who_has_said_who_may_hear_is_obeyed(name: str, value: str) -> None:
    environment = {name: value}
    stay_on_this_computer(environment)
    assert environment == {name: value}


def test_the_profile_is_bound_to_loopback() -> None:
    """What `ss -lunp` shows of a running robot: 127.0.0.1 alone."""
    environment: dict[str, str] = {}
    stay_on_this_computer(environment)
    prefer_udp(environment)
    profile = Path(environment["FASTRTPS_DEFAULT_PROFILES_FILE"]).read_text()
    assert set(re.findall(r"<address>(.*?)</address>", profile)) == {"127.0.0.1"}
    assert profile.count("<interfaceWhiteList>") == 1
    assert "<leaseAnnouncement><sec>1</sec></leaseAnnouncement>" in profile  # else `ros2 lifecycle get` finds no node


@pytest.mark.parametrize("other", ["rmw_cyclonedds_cpp", "rmw_zenoh_cpp"])
def test_another_middleware_keeps_the_range_that_it_understands(other: str) -> None:
    environment = {"RMW_IMPLEMENTATION": other, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    prefer_udp(environment)
    assert environment == {"RMW_IMPLEMENTATION": other, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


@pytest.mark.parametrize("ours", ["rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp"])
def test_fast_dds_by_its_name_is_treated_as_by_default(ours: str) -> None:
    environment = {"RMW_IMPLEMENTATION": ours, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    prefer_udp(environment)
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"


def test_on_the_network_of_the_robot_udp_alone_is_used() -> None:
    environment: dict[str, str] = {}
    prefer_udp(environment)
    assert environment == {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}


def test_who_has_chosen_a_transport_keeps_it() -> None:
    environment = {"FASTDDS_BUILTIN_TRANSPORTS": "SHM", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    prefer_udp(environment)
    assert environment == {"FASTDDS_BUILTIN_TRANSPORTS": "SHM", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}


def test_this_machine_alone_means_the_same_without_shared_memory() -> None:
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    prefer_udp(environment)
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"
    profile = Path(environment["FASTRTPS_DEFAULT_PROFILES_FILE"]).read_text()
    assert environment["FASTDDS_DEFAULT_PROFILES_FILE"] == environment["FASTRTPS_DEFAULT_PROFILES_FILE"]
    assert "<useBuiltinTransports>false</useBuiltinTransports>" in profile
    assert "SHM" not in profile


@pytest.mark.parametrize("name", ["FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"])
def test_a_profile_of_the_user_is_left_alone(name: str) -> None:
    environment = {name: "/etc/dds.xml", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    prefer_udp(environment)
    assert environment == {name: "/etc/dds.xml", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
