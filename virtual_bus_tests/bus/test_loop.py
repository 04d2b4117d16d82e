"""The control thread in real time, whatever is on its bus: late cycles, missed cycles. With drives: test_drives.py."""

from __future__ import annotations

import time
from typing import Any

import can
import pytest
from can.interfaces.virtual import VirtualBus

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_driver.cia301.frame import Frame
from canbase_driver.core import DriverCore
from canbase_driver.runtime import control_thread
from canbase_driver.runtime.black_box import Ring
from canbase_driver.runtime.bus_port import BusPort
from canbase_driver.runtime.control_thread import FRAMES_WHEN_LATE, ControlLoop

pytestmark = pytest.mark.bus


@pytest.fixture
def robot() -> Robot:
    return load_robot(sample("bench")).robot


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Of a virtual bus that this test has for itself."""
    return {"interface": "virtual", "channel": f"loop-{request.node.name}"}


class SlowCore(DriverCore):
    """Its cycles take as long as `naps_s` says, one after the other; the last one for ever."""

    def __init__(self, robot: Robot, *naps_s: float) -> None:
        super().__init__(robot)
        self._naps_s = list(naps_s)
        self.ticked_at: list[float] = []
        self.taken = self.suspends = 0

    def on_suspend(self, now_s: float) -> None:
        self.suspends += 1

    def on_frame(self, frame: Frame, now_s: float) -> list[Frame]:
        self.taken += 1
        return []

    def tick(self, now_s: float, lateness_s: float = 0.0) -> list[Frame]:
        self.ticked_at.append(now_s)
        time.sleep(self._naps_s.pop(0) if len(self._naps_s) > 1 else self._naps_s[0])
        return super().tick(now_s, lateness_s)


def run_for(core: DriverCore, robot: Robot, arguments: dict[str, Any], seconds: float, frames: int = 0) -> None:
    """Run the loop; after 0.1 s so many frames arrive at once."""
    loop = ControlLoop(core, BusPort(arguments), robot.rates.control_hz, robot.rates.odometry_hz, Ring(10.0))
    with VirtualBus(arguments["channel"]) as other:
        loop.start()
        time.sleep(0.1)
        for _ in range(frames):
            other.send(can.Message(arbitration_id=0x181, data=bytes(6), is_extended_id=False))
        time.sleep(seconds)
        loop.request_shutdown()
        loop.join(5.0)
    assert loop.failure is None
    assert not loop.is_alive()


def test_a_loop_that_is_always_late_still_takes_in_what_waits(robot: Robot, channel: dict[str, Any]) -> None:
    core = SlowCore(robot, 0.015)
    run_for(core, robot, channel, 0.5, frames=5 * FRAMES_WHEN_LATE)
    assert core.taken == 5 * FRAMES_WHEN_LATE


def test_cycles_that_were_missed_are_not_made_up_for(robot: Robot, channel: dict[str, Any]) -> None:
    core = SlowCore(robot, 0.0, 0.5, 0.0)
    run_for(core, robot, channel, 1.0)
    after = core.ticked_at[1] + 0.5
    assert len([at for at in core.ticked_at if after < at < after + 0.1]) <= 13


def test_a_suspend_is_reported_once(robot: Robot, channel: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """A pause of 0.1 s between the two clocks is none."""
    core, times = SlowCore(robot, 0.0), iter((5.0, 4.9, 5.01, 65.01))
    monkeypatch.setattr(control_thread, "suspended_s", lambda: next(times, 65.02))
    run_for(core, robot, channel, 0.1)
    assert core.suspends == 1
