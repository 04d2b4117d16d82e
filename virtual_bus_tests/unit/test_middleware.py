"""What the commands tell Fast DDS by the environment, and what they leave alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_cli.middleware import prefer_udp


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
