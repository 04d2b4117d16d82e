"""The name of an action after the remap rules of the command line. Pure: the two resolvers of a ROS node come in.

ROS 2 Jazzy applies remap rules to topics and services, and to no action (ros2/ros2, 1312). Rules.
1. A rule for the action's own name, `-r drive_distance:=go`, holds for the whole action.
2. Rules for its five hidden names, `-r drive_distance/_action/send_goal:=go/_action/send_goal` and so on, hold if all
   five lead to one name: so it is done for actions of other servers.
3. Every other set of rules would tear the action apart: some of its parts would be found under one name, some under
   another, and ROS would say nothing. It is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from canbase_runtime.wrong_start import WrongStartError

Resolve = Callable[[str], str]
"""From a name to the whole name that ROS uses for it."""

SERVICES: Final = ("send_goal", "cancel_goal", "get_result")
TOPICS: Final = ("feedback", "status")


class TornActionError(WrongStartError):
    """Remap rules give the parts of one action different names."""


def action_name(action: str, topic: Resolve, service: Resolve) -> str:
    """The whole name of `action`. TornActionError where its parts do not lead to one name."""
    name, as_service = topic(action), service(action)
    if name != as_service:
        raise TornActionError(
            f"remap rules rename the topics of action {action} to {name}, and its services to {as_service}: "
            f"write one rule for both, -r {action}:=NAME"
        )
    resolved = _parts(name, topic, service)
    other = next(iter(resolved.values())).removesuffix(f"/_action/{SERVICES[0]}")
    whole = [*resolved.values()] == [*_parts(other, topic, service)]
    if whole and _holds(other, topic, service):
        return other
    torn = ", ".join(f"{part} to {new}" for part, new in resolved.items() if new != part)
    raise TornActionError(
        f"remap rules rename parts of action {action}, and not all five to one name ({torn}): "
        f"write one rule for the action, -r {action}:=NAME"
    )


def _parts(name: str, topic: Resolve, service: Resolve) -> dict[str, str]:
    """The hidden names of an action, each with the name that ROS makes of it."""
    services = {f"{name}/_action/{part}": service(f"{name}/_action/{part}") for part in SERVICES}
    return services | {f"{name}/_action/{part}": topic(f"{name}/_action/{part}") for part in TOPICS}


def _holds(name: str, topic: Resolve, service: Resolve) -> bool:
    """No rule renames the parts of this action."""
    return all(part == new for part, new in _parts(name, topic, service).items())
