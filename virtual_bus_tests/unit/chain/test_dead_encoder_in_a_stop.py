"""An encoder dies while the base is being stopped: nobody says standstill while the wheel still turns.

    0.6 m/s ── lease lost ── quick stop ── encoder lost ── power off ── rolls out ── standstill assumed
                                          ╰ frames lost ╯

Driver, watchdog and simulated drives in virtual time; the fault is that of the left wheel.
"""

from __future__ import annotations

import pytest

from canbase_config.stopping import coasting_s, max_wheel_mps
from canbase_driver.cia301.frame import Frame
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim import faults
from canbase_watchdog.watchdog import Watchdog
from support.chain_world import World

TURNS_MPS = 0.1
"""A wheel that is faster does not stand."""
STATUS, VELOCITY = 0x181, 0x281
"""TPDOs of the left drive."""


class Course(World):
    """A world in which TPDOs of the left drive can be lost."""

    lost = False
    said_falsely = ""
    settled_falsely = False

    def _send(self, frames: list[Frame]) -> None:
        super()._send([frame for frame in frames if not (self.lost and frame.cob_id in (STATUS, VELOCITY))])

    @property
    def dog(self) -> Watchdog:
        assert self.watchdog is not None
        return self.watchdog

    def look(self) -> bool:
        """For `run`: notes who says that it stands while the left wheel turns; never True."""
        if abs(self.truth.v_left_mps) > TURNS_MPS:
            if self.driver is not None and self.snapshot.standstill:
                self.said_falsely = self.said_falsely or f"{self.truth.v_left_mps:.2f} m/s"
            self.settled_falsely |= self.dog.status.settled
        return False

    def quick_stop(self, until_mps: float) -> None:
        """No lease any more, until the wheel has become so slow."""
        self.drive(Twist2D(0.6, 0.0), 1.5)
        self.leases = False
        assert self.run(1.0, lambda: abs(self.truth.v_left_mps) <= until_mps)

    def lose(self, gap_s: float) -> None:
        self.lost = gap_s > 0.0
        faults.apply(self.bench.nodes, 1, "encoder_lost", self.now_s, {})
        self.run(gap_s, self.look)
        self.lost = False

    @property
    def rolls_s(self) -> float:
        return coasting_s(self.robot.watchdog.overspeed_factor * max_wheel_mps(self.robot))


@pytest.mark.parametrize(("speed", "gap_s"), [(0.55, 0.0), (0.55, 0.05), (0.35, 0.03), (0.35, 0.08), (0.2, 0.0)])
def test_an_encoder_that_is_lost_in_a_quick_stop_is_no_standstill_with_or_without_lost_frames(
    speed: float, gap_s: float
) -> None:
    world = Course()
    world.quick_stop(speed)
    world.lose(gap_s)
    world.run(1.0, world.look)
    assert not world.said_falsely
    assert not world.settled_falsely
    assert world.core.state is DriverState.LATCHED
    assert not world.snapshot.standstill
    assert not world.dog.status.settled
    world.leases = True
    world.command = Twist2D.ZERO
    world.run(0.1)
    refused = world.reset()
    assert not refused.done
    assert "a wheel is not proven to be at standstill" in refused.sentence
    assert world.dog.status.unproven == "left_wheel"


def test_after_a_lost_encoder_in_a_quick_stop_standstill_is_assumed_once_the_wheel_must_have_rolled_out() -> None:
    world = Course()
    world.quick_stop(0.35)
    world.lose(0.03)
    assert world.run(world.rolls_s + 0.5, lambda: world.dog.status.settled)
    assert world.dog.status.assumed
    assert abs(world.truth.v_left_mps) < TURNS_MPS


@pytest.mark.parametrize("speed", [0.5, 0.35, 0.25])
def test_with_a_dead_driver_the_watchdog_reads_on_until_it_knows_how_the_wheel_stopped(speed: float) -> None:
    """No SYNC any more: values come by SDO, and one look at a standstill is not enough."""
    world = Course()
    world.drive(Twist2D(0.6, 0.0), 1.5)
    world.leases = False
    world.kill_driver()
    assert world.run(2.0, lambda: abs(world.truth.v_left_mps) <= speed)
    world.lose(0.0)
    world.run(1.5, world.look)
    assert not world.settled_falsely
    assert world.dog.status.unproven == "left_wheel"
    assert not world.powered[0]
