"""What may happen in a small world: one failure of one part, or one thing that an operator does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from campaign.faults import FAULTS
from canbase_bench.faults import apply

if TYPE_CHECKING:
    from small_worlds.world import SmallWorld

Change = Callable[["SmallWorld"], None]
SHORT_S, LONG_S, EVER_S = 0.2, 0.4, 100.0
"""Shorter than every timeout, longer than most, and until the end."""


@dataclass(frozen=True, slots=True)
class Event:
    """One row. `lasts_s`: then `end` undoes it."""

    name: str
    sentence: str
    lasts_s: float
    begin: Change
    end: Change
    once: bool = True
    """It cannot happen again while it holds."""


def _nothing(small: SmallWorld) -> None:
    """It does not end."""


def _of_campaign(name: str, sentence: str, lasts_s: float, fault: str, **arguments: object) -> Event:
    """A fault of the campaign, with these arguments."""
    kind = FAULTS[fault]
    return Event(
        name,
        sentence,
        lasts_s,
        lambda small: kind.begin(small.world, small.around, arguments),
        lambda small: kind.end(small.world, small.around, arguments) if lasts_s < EVER_S else None,
    )


def _process(name: str) -> list[Event]:
    return [
        _of_campaign(f"{name} dies", f"the process {name} is killed", EVER_S, f"{name}_dies"),
        _of_campaign(f"{name} restarts", f"{name} is killed and started again", SHORT_S, f"{name}_dies"),
        _of_campaign(f"{name} hangs", f"{name} hangs for {LONG_S} s", LONG_S, f"{name}_hangs"),
    ]


def _all_die(small: SmallWorld) -> None:
    for process in small.parts:
        process.die()
    for node in small.world.drives.bench.nodes.values():
        node.power_cycle(small.world.clock.now, SHORT_S)


def _all_restart(small: SmallWorld) -> None:
    for process in small.parts:
        process.restart()


def _no_radio(small: SmallWorld) -> None:
    small.has_radio = False


FAULT_EVENTS: tuple[Event, ...] = (
    *[event for name in ("driver", "watchdog", "velocity") for event in _process(name)],
    Event("reboot", "computer and drives lose their supply and start again", SHORT_S, _all_die, _all_restart),
    _of_campaign("cable", f"computer and drives do not receive each other for {LONG_S} s", LONG_S, "cable_cut"),
    _of_campaign("cable for good", "computer and drives do not receive each other any more", EVER_S, "cable_cut"),
    Event("radio lost", "the joystick's messages do not arrive any more", EVER_S, _no_radio, _nothing),
    _of_campaign("drive mute", f"drive 1 sends nothing for {LONG_S} s", LONG_S, "drive_silent", node=1),
    _of_campaign("drive fault", f"drive 1 is in fault for {LONG_S} s", LONG_S, "drive_fault", node=1),
    _of_campaign("drive deaf to setpoints", "drive 1 ignores setpoints", EVER_S, "drive_ignores_setpoints", node=1),
    Event("encoder dead", "the encoder of drive 1 counts nothing and shows no speed", EVER_S,
          lambda small: apply(small.world.drives.bench.nodes, 1, "encoder_lost", small.world.clock.now, {}), _nothing),
    _of_campaign("lease lost", f"no lease arrives for {LONG_S} s", LONG_S, "lease_lost", value=1.0),
    _of_campaign("status lost", "the driver's status arrives nowhere", EVER_S, "status_lost"),
)  # fmt: skip
"""What may fail; a search takes at most two of them."""

OPERATOR_EVENTS: tuple[Event, ...] = (
    Event("press", "the emergency stop is pressed, and stays so", EVER_S,
          lambda small: small.around.press(True), _nothing),
    Event("press and release", f"the emergency stop is pressed for {SHORT_S} s", SHORT_S,
          lambda small: small.around.press(True), lambda small: small.around.press(False)),
    Event("stick", "the operator pushes the stick, or releases it", EVER_S,
          lambda small: small.turn_stick(), _nothing, once=False),
    Event("reset", "the operator resets", EVER_S, lambda small: small.reset(), _nothing, once=False),
    Event("stop", "the operator calls motor_driver/stop", EVER_S,
          lambda small: small.world.driver.stop(), _nothing, once=False),
)  # fmt: skip
"""What an operator does; a search takes at most one of them."""
EVENTS = {event.name: event for event in (*FAULT_EVENTS, *OPERATOR_EVENTS)}
