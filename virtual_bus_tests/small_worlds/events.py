"""What may happen in a small world: one failure of one part, or one thing that an operator does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from canbase_campaign.faults import FAULTS
from canbase_sim.faults import apply

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
    may: Callable[[SmallWorld], bool] = lambda small: True
    """Where it would change nothing, it cannot happen."""
    after: str = ""
    """Only when an event with a name that begins so has happened: before, drive 2 is as drive 1."""


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
    def lives(small: SmallWorld) -> bool:
        return small.world.processes[name].alive

    killed = f"{name} is killed and started again {SHORT_S} s later"
    return [
        replace(_of_campaign(f"{name} dies", f"{name} is killed", EVER_S, f"{name}_dies"), may=lives),
        _of_campaign(f"{name} restarts", killed, SHORT_S, f"{name}_dies"),
        Event(f"{name} restarts torn", f"{killed}; its record of stops is torn", SHORT_S,
              lambda small: small.kill_and_tear(name), lambda small: small.world.processes[name].restart(), may=lives),
        replace(_of_campaign(f"{name} hangs", f"{name} hangs for {LONG_S} s", LONG_S, f"{name}_hangs"), may=lives),
    ]  # fmt: skip


def _drive(node: int, after: str = "") -> list[Event]:
    """What may befall one drive."""
    power, wheel = f"drive {node} loses its supply for {SHORT_S} s", node - 1
    return [
        replace(event, after=after)
        for event in (
            _of_campaign(f"drive {node} mute", f"drive {node} sends nothing for {LONG_S} s", LONG_S, "drive_silent",
                         wheel=wheel),
            _of_campaign(f"drive {node} fault", f"drive {node} is in fault for {LONG_S} s", LONG_S, "drive_fault",
                         wheel=wheel),
            _of_campaign(f"drive {node} power cycle", power, LONG_S, "drive_power_cycle", wheel=wheel, off_s=SHORT_S),
            _of_campaign(f"drive {node} deaf to setpoints", f"drive {node} ignores setpoints", EVER_S,
                         "drive_ignores_setpoints", wheel=wheel),
            Event(f"drive {node} encoder dead", f"the encoder of drive {node} counts nothing and shows no speed",
                  EVER_S, partial(_kill_encoder, node), _nothing),
        )
    ]  # fmt: skip


def _kill_encoder(node: int, small: SmallWorld) -> None:
    apply(small.world.drives.bench.nodes, node, "encoder_lost", small.world.clock.now_s, {})


def _processes_die(small: SmallWorld) -> None:
    for process in small.parts:
        process.die()


def _processes_restart(small: SmallWorld) -> None:
    for process in small.parts:
        process.restart()


def _supply_fails(small: SmallWorld) -> None:
    _processes_die(small)
    for node in small.world.drives.bench.nodes.values():
        node.power_cycle(small.world.clock.now_s, SHORT_S)


def _no_radio(small: SmallWorld) -> None:
    small.has_radio = False


def _disks_read_only(small: SmallWorld) -> None:
    for disk in small.disks.values():
        disk.file.writable = False


def _records_lost(small: SmallWorld) -> None:
    for disk in small.disks.values():
        disk.file.data = None


FAULT_EVENTS: tuple[Event, ...] = (
    *[event for name in ("driver", "watchdog", "velocity") for event in _process(name)],
    Event("all restart", "all processes are killed and started again", SHORT_S, _processes_die, _processes_restart),
    Event("reboot", "computer and drives lose their supply and start again", SHORT_S, _supply_fails,
          _processes_restart),
    Event("disks read-only", "no record of stops can be written any more", EVER_S, _disks_read_only, _nothing),
    Event("records lost", "the records of stops are deleted", EVER_S, _records_lost, _nothing),
    _of_campaign("cable", f"computer and drives do not receive each other for {LONG_S} s", LONG_S, "cable_cut"),
    _of_campaign("cable for good", "computer and drives do not receive each other any more", EVER_S, "cable_cut"),
    Event("radio lost", "the joystick's messages do not arrive any more", EVER_S, _no_radio, _nothing),
    *_drive(1),
    *_drive(2, after="drive 1"),
    _of_campaign("lease lost", f"no lease arrives for {LONG_S} s", LONG_S, "lease_lost", value=1.0),
    _of_campaign("status lost", "the driver's status arrives nowhere", EVER_S, "status_lost"),
)  # fmt: skip
"""What may fail; a search takes at most two of them."""

OPERATOR_EVENTS: tuple[Event, ...] = (
    Event("button", "the emergency stop is pressed, or released", EVER_S,
          lambda small: small.around.press(not small.around.pressed), _nothing, once=False),
    Event("press and release", f"the emergency stop is pressed for {SHORT_S} s", SHORT_S,
          lambda small: small.around.press(True), lambda small: small.around.press(False),
          may=lambda small: not small.around.pressed),
    Event("stick", "the operator pushes the stick, or releases it", EVER_S,
          lambda small: small.turn_stick(), _nothing, once=False),
    Event("reset", "the operator resets", EVER_S, lambda small: small.reset(), _nothing, once=False),
    Event("stop", "the operator calls motor_driver/stop", EVER_S,
          lambda small: small.world.driver.stop(), _nothing, once=False,
          may=lambda small: small.world.driver.running),
    Event("lifecycle", "the driver is deactivated, or activated again", EVER_S,
          lambda small: small.turn_lifecycle(), _nothing, once=False, may=lambda small: small.world.driver.running),
)  # fmt: skip
"""What an operator does; a search takes at most one of them."""
EVENTS = {event.name: event for event in (*FAULT_EVENTS, *OPERATOR_EVENTS)}
