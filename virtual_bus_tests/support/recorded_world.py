"""Recordings of failures in virtual time, of the real cores: as canbase's driver records them, and as a listener does.

A black box has the frames that the driver sends and receives, and the notes of `stop_events.py`; a listener's recording
has every frame on the wire and no notes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from canbase_campaign.cruise import Cruise
from canbase_campaign.twins import TWINS, Twin
from canbase_campaign.world import World
from canbase_driver.runtime import black_box_notes as notes
from canbase_driver.snapshot import DriverSnapshot
from canbase_recording.entry import Entry, Note, RecordedFrame
from canbase_velocity.decision import Decision
from canbase_velocity.mux import MuxDecision
from canbase_velocity.twist import Twist


class WorldRecorder:
    """Writes down what happens in a world from now on. `box`: the driver's; `wire`: a listener's on the bus."""

    def __init__(self, world: World) -> None:
        self.box: list[Entry] = []
        self.wire: list[Entry] = []
        self._world, self._from_s = world, world.clock.now_s
        self._state: tuple[object, object] | None = None
        driver: Any = world.driver
        driver._on_frame = self._before(driver._on_frame, self._received)
        driver._member.send = self._before(driver._member.send, self._sent)
        world.bus.watch = self._on_wire
        self._tap("cmd_vel", self._on_command)
        world.topics.subscribe("safety_filter/state", driver, self._on_filter)
        world.topics.subscribe("velocity_mux/state", driver, self._on_mux)
        world.topics.watch = self._on_topic

    @property
    def now_s(self) -> float:
        return self._world.clock.now_s - self._from_s

    def _before(self, do: Callable[..., object], first: Callable[..., object]) -> Callable[..., object]:
        def both(*arguments: Any) -> object:
            first(*arguments)
            return do(*arguments)

        return both

    def _tap(self, topic: str, first: Callable[..., object]) -> None:
        """What the driver receives on a topic, at the moment when it does."""
        subscribers: list[Any] = self._world.topics._subscribers[topic]
        for at, (process, do) in enumerate(subscribers):
            if process is self._world.driver:
                subscribers[at] = (process, self._before(do, first))

    def _received(self, cob_id: int, data: bytes) -> None:
        self.box.append(RecordedFrame(self.now_s, cob_id, data))

    def _sent(self, cob_id: int, data: bytes) -> None:
        self.box.append(RecordedFrame(self.now_s, cob_id, data, sent=True))

    def _on_wire(self, _sender: str, cob_id: int, data: bytes) -> None:
        self.wire.append(RecordedFrame(self.now_s, cob_id, data))

    def _note(self, text: str) -> None:
        self.box.append(Note(self.now_s, text))

    def _on_command(self, twist: Twist) -> None:
        self._note(notes.command_note(twist.linear_mps, twist.angular_radps))

    def _on_filter(self, decision: Decision) -> None:
        twist, lease = decision.twist, self._world.velocity._sequence
        self._note(
            notes.filter_note(
                decision.cause.value, decision.detail, twist.linear_mps, twist.angular_radps, lease
            )
        )  # fmt: skip

    def _on_mux(self, decision: MuxDecision) -> None:
        reasons = "; ".join(f"{source.name}: {source.reason}" for source in decision.sources if source.reason)
        self._note(notes.mux_note(decision.active or "", reasons))

    def _on_topic(self, topic: str, message: Any) -> None:
        if topic == "motor_driver/status" and isinstance(message, DriverSnapshot):
            state = (message.state, message.finding.cause)
            if state != self._state:
                self._state = state
                self._note(notes.driver_note(notes.state_text(message)))


def recorded(twin: Twin, seed: int = 0) -> WorldRecorder:
    """What is recorded of one failure of a robot that drives at 0.3 m/s, from a second before it."""
    cruise = Cruise(twin.by)
    recorder = WorldRecorder(cruise.world)
    cruise.world.clock.run_until(cruise.world.clock.now_s + 1.0)
    cruise.run(twin, seed)
    return recorder


def twin(what: str, how: str) -> Twin:
    """The failure of this name."""
    return next(each for each in TWINS if each.key == (what, how))
