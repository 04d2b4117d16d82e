"""What pytest does with --can-interface: a slow robot on that bus, a warning, and the harmless tests alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from canbase_config.load import sample
from canbase_sim.personality import PERSONALITIES
from support import real_bus
from support.crews import KINDS_TOGETHER, REAL_SPEED_MPS, real_crew, simulated_crews

CAN0 = {"interface": "socketcan", "channel": "can0", "bitrate": 250_000}


class Options:
    """As much of pytest.Config as is asked."""

    def __init__(self, **given: Any) -> None:
        self._given = {"--can-channel": "can0", "--can-bitrate": 500_000, **given}
        self.hook = self
        self.deselected: list[pytest.Item] = []

    def getoption(self, name: str) -> Any:
        return self._given.get(name)

    def pytest_deselected(self, items: list[pytest.Item]) -> None:
        self.deselected += items


class Item:
    """A test with or without the mark."""

    def __init__(self, *marks: str) -> None:
        self._marks = marks

    def get_closest_marker(self, name: str) -> str | None:
        return name if name in self._marks else None


def options(**given: Any) -> Any:
    return Options(**{f"--{name.replace('_', '-')}": value for name, value in given.items()})


def test_the_crews_of_simulated_drives_have_every_kind_once() -> None:
    kinds = [kind for crew in KINDS_TOGETHER for kind in crew]
    assert sorted((*kinds, "generic")) == sorted(PERSONALITIES)
    for crew in simulated_crews(None):
        assert "+".join(dict.fromkeys(drive.profile for drive in crew.robot.drives)) == crew.name
        assert len(crew.robot.drives) == 4


def test_one_kind_alone() -> None:
    (crew,) = simulated_crews("zlac8015d")
    assert [(drive.node_id, drive.axis, drive.profile) for drive in crew.robot.drives] == [
        (1, 0, "zlac8015d"),
        (1, 1, "zlac8015d"),
    ]


@pytest.mark.parametrize("file", [None, sample("example_can0")])
def test_a_real_robot_is_on_that_bus_and_its_own_limits_hold_it_at_a_walk_of_a_snail(file: Path | None) -> None:
    crew = real_crew(CAN0, "epos4" if file is None else None, file)
    robot = crew.robot
    assert (robot.bus.interface, robot.bus.channel, robot.bus.bitrate) == ("socketcan", "can0", 250_000)
    assert not crew.simulated
    assert crew.speed_mps == REAL_SPEED_MPS <= robot.limits.linear_mps <= 0.06
    assert robot.limits.angular_radps * robot.base.track_m / 2.0 <= 0.06 + 1e-9


def test_what_python_can_wants_besides_is_kept_for_the_same_interface_only() -> None:
    bench = real_crew({"interface": "udp_multicast", "channel": "239.74.163.2", "bitrate": 500_000}, None, None)
    assert bench.robot.bus.extra == {"port": 43113, "hop_limit": 0}
    assert real_crew(CAN0, None, None).robot.bus.extra == {}


def test_a_warning_names_bus_speed_and_drives_before_anything_moves() -> None:
    assert real_bus.warning(options()) == []
    first, second, *drives = real_bus.warning(options(can_interface="socketcan", personality="epos4"))
    assert "REAL BUS socketcan can0: THE WHEELS TURN" in first
    assert "Wheels up" in second
    assert drives == ["left_wheel: node 1 axis 0, maxon EPOS4", "right_wheel: node 2 axis 0, maxon EPOS4"]


def test_on_a_real_bus_only_marked_tests_are_left() -> None:
    harmless, other = Item("real_bus", "bus"), Item("bus")
    items: list[Any] = [harmless, other]
    config = options(can_interface="socketcan")
    real_bus.leave_out(config, items)
    assert (items, config.deselected) == ([harmless], [other])
    items = [harmless, other]
    real_bus.leave_out(options(), items)
    assert items == [harmless, other]
