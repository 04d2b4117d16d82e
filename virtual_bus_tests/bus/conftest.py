"""Fixtures of the tests in real time: a crew of drives, its bus, and the driver with everything around it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import can
import pytest
from can.interfaces import BACKENDS
from can.interfaces.virtual import VirtualBus

from support.crews import Crew
from support.drive_rig import Driver, Surroundings
from support.flaky_bus import FlakyBus
from support.real_bus import crews


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Each test with a `crew` runs once for each of them, or for the last of them: mark `one_crew`."""
    if "crew" in metafunc.fixturenames:
        all_of_them = crews(metafunc.config)
        wanted = all_of_them[-1:] if metafunc.definition.get_closest_marker("one_crew") else all_of_them
        metafunc.parametrize("crew", wanted, ids=lambda crew: crew.name)


@pytest.fixture
def arguments(crew: Crew, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Of `can.Bus`: a virtual bus that this test has for itself, and can break; or the real one."""
    if not crew.simulated:
        return crew.robot.bus.arguments()
    monkeypatch.setitem(BACKENDS, "virtual", ("support.flaky_bus", "FlakyBus"))
    FlakyBus.heal()
    return {"interface": "virtual", "channel": f"drives-{request.node.name}"}


@pytest.fixture
def around(crew: Crew, arguments: dict[str, Any]) -> Iterator[Surroundings]:
    """On a bus handle of its own, which never breaks."""
    bus = VirtualBus(arguments["channel"]) if crew.simulated else can.Bus(**arguments)
    with Surroundings(crew, bus) as surroundings:
        yield surroundings


@pytest.fixture
def driver(crew: Crew, arguments: dict[str, Any], around: Surroundings) -> Iterator[Driver]:
    """The control thread, started."""
    with Driver(crew, arguments, around) as running:
        yield running
        FlakyBus.heal()
