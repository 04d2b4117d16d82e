"""Whether this computer has the bus that robot.yaml names. Warnings alone: the file may be for another computer."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from canbase_config.robot import Bus

SYSFS: Final = Path("/sys/class/net")
CAN: Final = 280
"""ARPHRD_CAN of if_arp.h, in the file `type` of a network interface."""
UP: Final = 1
"""IFF_UP of if.h, in its file `flags`."""


def bus_warnings(bus: Bus, interfaces: Collection[str], network: Path = SYSFS) -> Iterator[str]:
    """`interfaces`: those that python-can knows. Each sentence names the key, its value, and what to do."""
    if bus.interface not in interfaces:
        yield f"bus.interface is {bus.interface!r}, expected one of {', '.join(sorted(interfaces))}"
    elif bus.interface == "socketcan":
        yield from _socketcan(bus, network)
    elif bus.channel.startswith("/") and not Path(bus.channel).exists():
        yield f"bus.channel is {bus.channel}: there is no such device on this computer; is the adapter plugged in?"


def unknown_options(bus: Bus, parameters: Collection[str]) -> Iterator[str]:
    """Keys of bus.extra that are nearly one of these parameters of the adapter's class in python-can. Many classes take
    options that their signature does not name."""
    for key in bus.extra.keys() - set(parameters):
        for near in difflib.get_close_matches(key, parameters, n=1):
            yield f"bus.extra.{key} is no option of python-can's {bus.interface}: did you mean {near}?"


def _socketcan(bus: Bus, network: Path) -> Iterator[str]:
    folder, found = network / bus.channel, _can_interfaces(network)
    if bus.channel not in found:
        what = "is no CAN interface" if folder.exists() else "is no network interface of this computer"
        yield f"bus.channel {bus.channel!r} {what}; CAN interfaces here: {', '.join(found) or 'none'}"
    elif not _number(folder / "flags") & UP:
        yield (
            f"bus.channel {bus.channel} is down: "
            f"sudo ip link set {bus.channel} up type can bitrate {bus.bitrate} restart-ms 100 txqueuelen 64"
        )


def _can_interfaces(network: Path) -> list[str]:
    return sorted(path.name for path in network.glob("*") if _number(path / "type") == CAN)


def _number(path: Path) -> int:
    """What the kernel wrote there, decimal or hexadecimal; 0 where nothing can be read."""
    try:
        return int(path.read_text(encoding="ascii"), 0)
    except (OSError, ValueError):
        return 0
