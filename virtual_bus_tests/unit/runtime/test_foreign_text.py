"""Text from outside forges no line of a log and controls no terminal: frame ids, names, details of other nodes."""

from __future__ import annotations

import pytest
from canbase.msg import ForeignPublisher, MuxState, SafetyState
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header

from canbase_action_server.messages import mux_in, safety_in
from canbase_runtime.foreign_text import CUT, clean, printable
from canbase_runtime.journal import EventLog, Journal
from canbase_runtime.log_priority import Priority
from canbase_velocity.placement import PlacementError, placed_by_tf

FORGED = "laser\n[ERROR] [motor_driver]: LATCHED\x1b[2J\u202e"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("laser", "laser"),
        ("0.5 m/s², 10°, größer, 가나", "0.5 m/s², 10°, größer, 가나"),
        ("a\nb\r\tc", "a\\nb\\r\\tc"),
        ("\x1b[31mred\x07\x9b", "\\x1b[31mred\\x07\\x9b"),
        ("\u2028\u2029\x85", "\\u2028\\u2029\\x85"),
        ("\u202eevil", "\\u202eevil"),  # turns the direction of writing
        ("", ""),
        ("x" * 80, "x" * 80),
        ("x" * 81, "x" * 79 + CUT),
        ("\n" * 80, ("\\n" * 40)[:79] + CUT),
        ("x" * 10_000_000, "x" * 79 + CUT),
    ],
)
def test_what_cannot_be_printed_is_escaped_and_what_is_long_is_cut(text: str, shown: str) -> None:
    assert printable(text) == shown
    assert len(printable(text)) <= 80
    assert printable(text).isprintable()


def test_a_message_is_cleaned_in_all_its_texts() -> None:
    state = MuxState(active=FORGED, foreign=[ForeignPublisher(node=FORGED, problem="x" * 9000)])
    clean(state)
    assert state.active.isprintable()
    assert state.foreign[0].node.isprintable()
    assert len(state.foreign[0].problem) == 4000
    scan = LaserScan(header=Header(frame_id=FORGED), ranges=[1.0, 2.0])
    clean(scan)
    assert scan.header.frame_id.isprintable()
    assert list(scan.ranges) == [1.0, 2.0]


class Log:
    """A logger of ROS; keeps its lines."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def error(self, message: str) -> None:
        self.lines.append(message)

    warning = info = error


def test_whatever_a_part_says_is_one_line_of_its_log() -> None:
    log = Log()
    for priority in (Priority.ERROR, Priority.WARNING, Priority.INFO):
        EventLog(log, Journal("x", {})).write(f"scan: {FORGED}", priority)
    assert len(log.lines) == 3
    assert all(line.isprintable() for line in log.lines)


def test_the_frame_of_a_scan_and_the_details_of_other_nodes_come_in_escaped_and_cut() -> None:
    with pytest.raises(PlacementError) as told:
        placed_by_tf(FORGED + "x" * 1000, "base_link", {})
    assert str(told.value).isprintable()
    assert len(str(told.value)) < 160
    safety = safety_in(SafetyState(cause=FORGED, detail=FORGED * 100))
    assert safety.cause.value.isprintable()
    assert safety.detail.isprintable()
    assert len(safety.detail) == 500
    assert mux_in(MuxState(active=FORGED), "action").active.isprintable()
