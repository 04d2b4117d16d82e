"""Who publishes where it should not, found among the publishers of the ROS graph."""

from __future__ import annotations

import pytest

from canbase_velocity.unexpected_publishers import PATIENCE_S, Expected, Foreign, ForeignWatch, Publisher

STAMPED = "geometry_msgs/msg/TwistStamped"
PLAIN = "geometry_msgs/msg/Twist"
JOY = Expected("/r1/cmd_vel_joy", STAMPED, "joystick", ())
ACTION = Expected("/r1/cmd_vel_action", STAMPED, "action", ("/r1/drive_distance_server",))
OUTPUT = Expected("/r1/cmd_vel", STAMPED, None, ("/r1/safety_filter",), alone=True)


def found(expected: Expected, *publishers: Publisher) -> list[str]:
    return [foreign.sentence for foreign in ForeignWatch([expected]).check_graph({expected.topic: publishers}, 0.0)]


def test_named_publishers_and_empty_topics_are_right() -> None:
    assert found(ACTION, Publisher("/r1/drive_distance_server", STAMPED)) == []
    assert found(ACTION) == []
    assert ForeignWatch([ACTION]).check_graph({}, 0.0) == ()


def test_where_no_node_is_named_anybody_may_publish() -> None:
    assert found(JOY, Publisher("/teleop", STAMPED), Publisher("/other/teleop", STAMPED)) == []


@pytest.mark.parametrize("node", ["/evil", "/r2/drive_distance_server", "/drive_distance_server"])
def test_another_node_is_foreign_and_told_with_its_namespace(node: str) -> None:
    sentence = f"{node} publishes on /r1/cmd_vel_action: only /r1/drive_distance_server should"
    assert found(ACTION, Publisher("/r1/drive_distance_server", STAMPED), Publisher(node, STAMPED)) == [sentence]


def test_a_second_safety_filter_is_foreign() -> None:
    mine = Publisher("/r1/safety_filter", STAMPED)
    assert found(OUTPUT, mine) == []
    assert found(OUTPUT, mine, mine) == [
        "/r1/safety_filter publishes on /r1/cmd_vel: 2 times; is it running twice?"
    ]  # fmt: skip


def test_the_same_node_twice_on_a_source_is_nothing_wrong() -> None:
    server = Publisher("/r1/drive_distance_server", STAMPED)
    assert found(ACTION, server, server) == []


def test_another_message_type_is_told_and_disturbs_nobody() -> None:
    watch = ForeignWatch([JOY])
    (foreign,) = watch.check_graph({JOY.topic: [Publisher("/teleop", PLAIN)]}, 0.0)
    assert foreign.problem == f"of type {PLAIN}, which is not received; expected {STAMPED}"
    assert foreign.disturbs("joystick") is False


def test_who_it_disturbs() -> None:
    on_action = Foreign("/t", "/evil", STAMPED, "x", "action", obeyed=True)
    on_output = Foreign("/t", "/evil", STAMPED, "x", None, obeyed=True)
    assert [on_action.disturbs(name) for name in ("action", "joystick")] == [True, False]
    assert [on_output.disturbs(name) for name in ("action", "joystick")] == [True, True]


def test_a_publisher_without_a_name_counts_when_it_stays_so() -> None:
    watch, graph = ForeignWatch([OUTPUT]), {OUTPUT.topic: [Publisher("", STAMPED)]}
    assert watch.check_graph(graph, 10.0) == ()  # just discovered
    assert watch.check_graph(graph, 10.0 + PATIENCE_S - 0.01) == ()
    (foreign,) = watch.check_graph(graph, 10.0 + PATIENCE_S)
    assert foreign.sentence == "an unknown node publishes on /r1/cmd_vel: only /r1/safety_filter should"
    assert watch.check_graph({}, 13.0) == ()
    assert watch.check_graph(graph, 14.0) == ()  # another one, just discovered


def test_a_named_one_beside_it_counts_at_once() -> None:
    graph = {OUTPUT.topic: [Publisher("", STAMPED), Publisher("/evil", STAMPED)]}
    assert [foreign.node for foreign in ForeignWatch([OUTPUT]).check_graph(graph, 0.0)] == ["/evil"]


def test_a_nameless_one_is_no_crime_where_anybody_may_publish() -> None:
    watch, graph = ForeignWatch([JOY]), {JOY.topic: [Publisher("", STAMPED)]}
    assert watch.check_graph(graph, 0.0) == ()
    assert watch.check_graph(graph, 100.0) == ()
