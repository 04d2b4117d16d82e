"""Quality of service of the topics of mux and filter, and subscriptions that receive from every publisher."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_policy_name_from_kind,
    qos_profile_sensor_data,
)

COMMAND = QoSProfile(depth=1)
"""Velocities: only the newest counts."""
ANY_COMMAND = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""For subscriptions: they match reliable and best-effort publishers. A reliable one would not match the latter."""
SWITCH = QoSProfile(depth=10)
"""Buttons and locks: every message counts, also a press that is released again before this process gets to it."""
ANY_SWITCH = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
KEPT_SWITCH = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
STATE = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Latched: a late subscriber receives the newest state."""
DRIVER_STATUS = QoSProfile(depth=10)
"""Every change of state counts, also those that come close together."""
SCAN = qos_profile_sensor_data
"""Best effort: it fits every scanner's publisher, reliable or not."""
STATIC_TF = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""As tf2's static broadcasters publish, of which there may be many."""


def listen_closely(node: Node, kind: type[Any], topic: str, callback: Callable[[Any], None]) -> None:
    """Subscribes to a topic that may publish once and then no more, such as a button or a lock.

    With best effort, to match every publisher; reliably, so that nothing of a reliable one is lost; and with the
    messages from before the start of a publisher that keeps them (transient local). One message may call the callback
    three times.
    """
    silent = SubscriptionEventCallbacks(use_default_callbacks=False)  # another one matches where this one does not
    node.create_subscription(kind, topic, callback, KEPT_SWITCH, event_callbacks=silent)
    node.create_subscription(kind, topic, callback, SWITCH, event_callbacks=silent)
    node.create_subscription(kind, topic, callback, ANY_SWITCH)


def loud(node: Node, topic: str, deaf: list[str]) -> PublisherEventCallbacks:
    """For a publisher: a subscriber whose QoS requests more receives nothing. Logs that, adds it to `deaf`."""

    def on_incompatible(event: Any) -> None:
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        sentence = f"a subscriber of {topic} receives nothing: it requests another {policy} than is offered"
        if sentence not in deaf:
            deaf.append(sentence)
        node.get_logger().error(sentence)

    return PublisherEventCallbacks(incompatible_qos=on_incompatible)
