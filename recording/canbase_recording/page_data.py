"""What the page of `canbase explain --html` shows of one stop: lines of its plots, bars, rows of frames. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from canbase_driver.cia402 import DriveState, decode_statusword
from canbase_driver.supervision.watchdog_link import TRIPPED, WATCHING
from canbase_recording.frame_words import Decoder
from canbase_recording.lease_bounds import Bounds, lease_bounds
from canbase_recording.scene import Scene
from canbase_recording.trace import AxisTrace, Line, thinned
from canbase_runtime.driver_state import DriverState
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable
from canbase_runtime.stop_cause import StopCause


@dataclass(frozen=True, slots=True)
class Curve:
    """A line of a plot."""

    name: str
    times: tuple[float, ...]
    values: tuple[float, ...]
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Bar:
    """A state of a part from one time to another. `tone`: good, warn, bad or idle."""

    lane: str
    since_s: float
    until_s: float
    text: str
    tone: str


Row = tuple[float, str, str, str, str, str]
"""Time, COB-ID, sent or received, kind, data, words."""


def speed_unit(scene: Scene) -> str:
    """Of the speeds of this scene."""
    return "m/s" if any(trace.has_units for trace in scene.axes.values()) else "raw"


def speeds(scene: Scene) -> list[Curve]:
    """Ordered (60FFh) and measured (606Ch) of each axis."""
    curves = []
    for _, trace in sorted(scene.axes.items()):
        curves.append(_curve(f"{trace.name} ordered", trace, trace.target, dashed=True))
        curves.append(_curve(f"{trace.name} measured", trace, trace.velocity))
    return [curve for curve in curves if curve.times]


def bounds(scene: Scene) -> dict[str, Bounds]:
    """What the leases allow, by joint; empty without robot.yaml or commands."""
    return {} if scene.robot is None else lease_bounds(scene.robot, scene.commands, scene.ended_s)


def commands(scene: Scene) -> list[Curve]:
    """cmd_vel, and what the safety filter reports that it orders."""
    found = []
    sources = (("cmd_vel", scene.commands), ("safety_filter", scene.filters))
    for what, field in (("linear [m/s]", "linear_mps"), ("angular [rad/s]", "angular_radps")):
        for name, notes in sources:
            points = thinned([(note.at_s, getattr(note, field)) for note in notes])
            curve = Curve(f"{name} {what}", *_columns(points), dashed=name != "cmd_vel")
            if any(curve.values) or (curve.times and what.startswith("linear")):
                found.append(curve)
    return found


def bars(scene: Scene) -> list[Bar]:
    """States over time: mux, filter, driver, watchdog, drives."""
    end_s = scene.ended_s
    mux = [(note.at_s, note.active or "no source") for note in scene.muxes]
    filters = [(note.at_s, note.cause.value if note.cause is not StopCause.NONE else "free") for note in scene.filters]
    drivers = [(note.at_s, note.state.name) for note in scene.drivers]
    dogs = [(at_s, _WATCHDOG.get(state.state, "starting")) for at_s, state in scene.watchdog]
    found = [
        *_bars("mux", mux, end_s, lambda text: "idle" if text == "no source" else "good"),
        *_bars("filter", filters, end_s, lambda text: "good" if text == "free" else "warn"),
        *_bars("driver", drivers, end_s, lambda text: _DRIVER.get(text, "idle")),
        *_bars("watchdog", dogs, end_s, lambda text: {"watching": "good", "tripped": "bad"}.get(text, "idle")),
    ]
    for _, trace in sorted(scene.axes.items()):
        states = _with_silence(trace, scene.period_s)
        found += _bars(trace.name, states, end_s, lambda text: _DRIVE.get(text, "idle"))
    return found


def frame_rows(scene: Scene, decoder: Decoder) -> list[Row]:
    """The frames around the reaction, in words."""
    rows = []
    for frame in scene.frames:
        words = decoder.words(frame)
        text = printable(words.text, SENTENCE_LENGTH)
        way, data = "Tx" if frame.sent else "Rx", frame.data.hex(" ").upper()
        rows.append((round(frame.at_s, 6), f"{frame.cob_id:03X}", way, words.kind.value, data, text))
    return rows


_WATCHDOG: Final = {TRIPPED: "tripped", WATCHING: "watching"}
_DRIVER: Final = {
    DriverState.ENABLED.name: "good", DriverState.STOPPING.name: "warn", DriverState.LATCHED.name: "bad",
    DriverState.ENABLING.name: "warn",
}  # fmt: skip
_DRIVE: Final = {
    DriveState.OPERATION_ENABLED.text: "good", DriveState.QUICK_STOP_ACTIVE.text: "warn",
    DriveState.FAULT_REACTION_ACTIVE.text: "bad", DriveState.FAULT.text: "bad",
}  # fmt: skip


def _with_silence(trace: AxisTrace, period_s: float) -> list[tuple[float, str]]:
    """States, and that nothing is known of them while no statusword comes."""
    states = [(at_s, _state_text(word)) for at_s, word in trace.status]
    ends = [(at_s + period_s, NOT_KNOWN) for at_s in trace.silent_since]
    return sorted([*states, *ends])


NOT_KNOWN: Final = "no statusword"


def _state_text(word: int) -> str:
    state = decode_statusword(word)
    return state.text if state else "unknown state"


def _bars(lane: str, states: Sequence[tuple[float, str]], end_s: float, tone: Callable[[str], str]) -> list[Bar]:
    """Neighbours of one text are one bar; a state lasts until the next one."""
    found: list[Bar] = []
    for at, (since_s, text) in enumerate(states):
        until_s = states[at + 1][0] if at + 1 < len(states) else end_s
        if found and found[-1].text == text:
            found[-1] = Bar(lane, found[-1].since_s, until_s, text, found[-1].tone)
        else:
            found.append(Bar(lane, since_s, until_s, text, tone(text)))
    return found


def _curve(name: str, trace: AxisTrace, line: Line[int], *, dashed: bool = False) -> Curve:
    points = thinned([(at_s, trace.speed(raw)) for at_s, raw in line])
    return Curve(name, *_columns(points), dashed=dashed)


def _columns(points: Iterable[tuple[float, float]]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    rounded = [(round(at_s, 4), round(value, 5)) for at_s, value in points]
    return tuple(at_s for at_s, _ in rounded), tuple(value for _, value in rounded)
