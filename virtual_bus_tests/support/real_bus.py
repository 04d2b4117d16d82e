"""Options of pytest that point the tests of the driver at real drives, with their warnings and skips."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from canbase_sim.personality import PERSONALITIES
from support.crews import REAL_SPEED_MPS, Crew, real_crew, simulated_crews

PAUSE_S = 5.0
"""To think about the wheels, at a terminal."""
MARK = "real_bus"
"""Marks the tests that real drives may be given: they move slowly, for seconds, and break nothing."""


def add_options(parser: pytest.Parser) -> None:
    """For `pytest_addoption`."""
    group = parser.getgroup("drives", "drives: simulated ones of all kinds, or real ones (wheels up!)")
    group.addoption("--personality", choices=sorted(PERSONALITIES), help="Drives of this kind alone.")
    group.addoption("--can-interface", metavar="NAME", help="python-can's name of a real bus: socketcan, slcan, …")
    group.addoption("--can-channel", metavar="NAME", default="can0", help="Its channel. Default: can0.")
    group.addoption("--can-bitrate", metavar="N", type=int, default=500_000, help="Where python-can sets it.")
    group.addoption("--robot", metavar="FILE", type=Path, help="--robot=robot.yaml: node ids, gears, encoders.")


def crews(config: pytest.Config) -> list[Crew]:
    """The robots that these options name."""
    kind, interface = config.getoption("--personality"), config.getoption("--can-interface")
    if interface is None:
        return simulated_crews(kind)
    bus = {
        "interface": interface,
        "channel": config.getoption("--can-channel"),
        "bitrate": config.getoption("--can-bitrate"),
    }
    return [real_crew(bus, kind, config.getoption("--robot"))]


def warning(config: pytest.Config) -> list[str]:
    """The warning before real wheels turn; nothing for simulated ones."""
    if config.getoption("--can-interface") is None:
        return []
    (crew,) = crews(config)
    bus, drives = crew.robot.bus, crew.robot.drives
    return [
        f"REAL BUS {bus.interface} {bus.channel}: THE WHEELS TURN, up to {REAL_SPEED_MPS} m/s at the rim, for seconds.",
        "Wheels up, nobody near, the emergency stop in your hand. The tests configure the drives and store nothing.",
        *(f"{each.joint}: node {each.node_id} axis {each.axis}, {each.kind.title}" for each in drives),
    ]


def leave_out(config: pytest.Config, items: list[pytest.Item]) -> None:
    """On a real bus only the tests with the mark run; the others break things, or need no drive."""
    if config.getoption("--can-interface") is None:
        return
    kept = [item for item in items if item.get_closest_marker(MARK)]
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    items[:] = kept


def pause(config: pytest.Config) -> None:
    """Let the person at the terminal read it."""
    if config.getoption("--can-interface") is not None and sys.stdin.isatty():
        print(*warning(config), f"Ctrl-C ends it; it begins in {PAUSE_S:.0f} s.", sep="\n", file=sys.stderr)
        time.sleep(PAUSE_S)
