"""What the driver writes between the frames is what `canbase explain` reads there."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_driver.runtime import black_box_notes as written
from canbase_recording.entry import Note
from canbase_recording.notes import CommandNote, DriverNote, FilterNote, MuxNote, TitleNote, parse_note
from canbase_runtime.driver_state import DriverState
from canbase_runtime.foreign_text import printable
from canbase_runtime.stop_cause import StopCause

NUMBERS = st.floats(-1e4, 1e4, allow_nan=False)
TEXTS = st.text(max_size=60).map(printable)


@given(NUMBERS, NUMBERS)
def test_a_command(linear_mps: float, angular_radps: float) -> None:
    note = parse_note(Note(1.0, written.command_note(linear_mps, angular_radps)))
    assert isinstance(note, CommandNote)
    assert (note.linear_mps, note.angular_radps) == pytest.approx((linear_mps, angular_radps), abs=6e-5)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_no_number_orders_no_motion(value: float) -> None:
    note = parse_note(Note(1.0, written.command_note(value, 0.0)))
    assert isinstance(note, CommandNote)
    assert not note.moves


@given(st.sampled_from(list(StopCause)), TEXTS, NUMBERS, NUMBERS, st.integers(0, 2**63))
def test_a_state_of_the_filter(cause: StopCause, detail: str, linear: float, angular: float, lease: int) -> None:
    note = parse_note(Note(1.0, written.filter_note(cause.value, detail, linear, angular, lease)))
    assert isinstance(note, FilterNote)
    assert (note.cause, note.lease) == (cause, lease)
    assert note.linear_mps == pytest.approx(linear, abs=6e-5)


def test_the_mux_and_the_title() -> None:
    assert parse_note(Note(1.0, written.mux_note("", "joystick: old; action: old"))) == MuxNote(
        1.0, "", "joystick: old; action: old"
    )
    assert parse_note(Note(1.0, written.mux_note("action", ""))) == MuxNote(1.0, "action", "")
    assert parse_note(Note(0.0, written.title("watchdog", "lease lost", "age (0.3 s)"))) == TitleNote(
        0.0, "watchdog", "lease lost", "age (0.3 s)"
    )


@pytest.mark.parametrize(
    ("text", "note"),
    [
        ("ENABLED", DriverNote(1.0, DriverState.ENABLED, "", "", "")),
        (
            "LATCHED: drive fault (left_wheel (node 1): 7305h encoder); ends with: reset, with the drive's cause gone",
            DriverNote(1.0, DriverState.LATCHED, "drive fault", "left_wheel (node 1): 7305h encoder",
                       "reset, with the drive's cause gone"),
        ),
        ("BOOTING (1 of 2)", DriverNote(1.0, DriverState.BOOTING, "", "1 of 2", "")),
    ],
)  # fmt: skip
def test_a_state_of_the_driver(text: str, note: DriverNote) -> None:
    assert parse_note(Note(1.0, written.driver_note(text))) == note


@given(st.text(max_size=200))
def test_any_text_is_understood_or_left_as_it_is(text: str) -> None:
    parse_note(Note(0.0, text))
    parse_note(Note(0.0, f"motor_driver {text}"))
    parse_note(Note(0.0, f"safety_filter {text}; orders {text} m/s {text} rad/s"))
