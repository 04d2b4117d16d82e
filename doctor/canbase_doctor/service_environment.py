"""The environment that a robot's services have, out of its .env file and the drop-ins of its units. Pure: texts in.

As systemd.exec(5) has it: an EnvironmentFile= wins over Environment=, a later line over an earlier one.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from typing import Final

from canbase_runtime.environment_file import variables

_THEIRS: Final = ("ROS_", "RMW_", "CANBASE_", "FASTDDS_", "FASTRTPS_", "CYCLONEDDS_")
"""The caller's environment does not decide these: the services do not see it."""
_OPERATOR: Final = "/canbase/operator"
"""The enclave of deploy/sros2/policy.xml for observers."""


def service_environment(own: Mapping[str, str], drop_ins: Iterable[str], env_file: str) -> dict[str, str]:
    """`own` without what is about ROS, then what the drop-ins (in their order) and the .env file set."""
    found = {name: value for name, value in own.items() if not name.startswith(_THEIRS)}
    for line in (line.strip() for text in drop_ins for line in text.splitlines()):
        if line.startswith("Environment="):
            pairs = shlex.split(line.removeprefix("Environment=").replace("%%", "%"))
            found |= dict(pair.split("=", 1) for pair in pairs if "=" in pair)
    return found | variables(env_file)


def arguments(environment: Mapping[str, str]) -> tuple[str, ...]:
    """What `canbase doctor` needs on its line to look where the services are: namespace, and an enclave with SROS2."""
    words = environment.get("CANBASE_OPTIONS", "").replace("--namespace=", "--namespace ").split()
    place = words.index("--namespace") + 1 if "--namespace" in words else len(words)
    namespace = ("--namespace", words[place]) if place < len(words) else ()
    secured = environment.get("ROS_SECURITY_ENABLE") == "true"
    return (*namespace, *(("--ros-args", "--enclave", _OPERATOR) if secured else ()))
