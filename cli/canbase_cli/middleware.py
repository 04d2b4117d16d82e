"""Settings of DDS for this process, to be made before ROS starts: this computer alone by default, and UDP.

Never over Fast DDS's shared memory.

There a sender waits up to 0.3 s for a receiver that is slow to answer, such as one that is just starting on a loaded
computer. rclpy holds Python's interpreter lock meanwhile, so one late process would stop the control loop of another,
and the watchdog would rightly stop the robot. Over UDP no sender waits.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from pathlib import Path
from typing import Final

_PROFILES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")  # Fast DDS 2 and 3
_RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_CHOICES: Final = (_RANGE, "ROS_STATIC_PEERS", *_PROFILES)
"""If one of them is set, the user has chosen the range of discovery."""
_NO_PROFILES_FROM_HERE: Final = "SKIP_DEFAULT_XML_FILE"
"""Otherwise Fast DDS reads DEFAULT_FASTRTPS_PROFILES.xml of the current folder, whose owner is unknown."""
_FAST_DDS: Final = ("", "rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp")
_LOCAL: Final = Path(__file__).with_name("fastdds_local.xml")


def stay_on_this_computer(environment: MutableMapping[str, str]) -> None:
    """Changes the environment of this process, unless it sets the range. DDS has no users: every receiver may order."""
    if not any(environment.get(name) for name in _CHOICES):
        environment[_RANGE] = "LOCALHOST"


def take_no_profile_from_here(environment: MutableMapping[str, str]) -> None:
    """Changes the environment of this process: only a profile that a variable names counts."""
    environment.setdefault(_NO_PROFILES_FROM_HERE, "1")


def prefer_udp(environment: MutableMapping[str, str]) -> None:
    """Changes the environment of this process. A profile of the user for Fast DDS stays, and so does another DDS."""
    if environment.get("RMW_IMPLEMENTATION", "") not in _FAST_DDS or any(environment.get(name) for name in _PROFILES):
        return
    environment.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    if environment.get(_RANGE) == "LOCALHOST":  # here rmw_fastrtps adds shared memory in spite of the line above
        environment[_RANGE] = "SYSTEM_DEFAULT"
        environment.update(dict.fromkeys(_PROFILES, str(_LOCAL)))
