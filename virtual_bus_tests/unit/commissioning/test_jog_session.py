"""A wheel under a dead-man key: which key presses move it, and that everything else stops it."""

from __future__ import annotations

import pytest

from canbase_commissioning.guide import Guide, Script
from canbase_commissioning.jog_session import DeadMan, JogSession, split_keys
from canbase_commissioning.powered_drives import PoweredDrives, RigError
from canbase_commissioning.safe_stop import SafeStop
from canbase_commissioning.self_stop_test import get_ready
from canbase_sim.cia402.states import POWERED
from canbase_sim.frame import Frame as BenchFrame
from support.guide_world import GuideWorld

UP = "\x1b[A"


def directions(*presses: tuple[float, str], at: float) -> int:
    dead_man = DeadMan()
    for time_s, key in presses:
        dead_man.direction(time_s)
        dead_man.press(key, time_s)
    return dead_man.direction(at)


def test_one_press_moves_nothing_the_first_repetition_does() -> None:
    assert directions((0.0, "w"), at=0.1) == 0
    assert directions((0.0, "w"), (0.5, "w"), at=0.5) == 1
    assert directions((0.0, "s"), (0.5, "s"), at=0.6) == -1


@pytest.mark.parametrize(("gap_s", "moves"), [(0.79, 1), (0.81, 0)])
def test_the_first_repetition_must_come_in_time(gap_s: float, moves: int) -> None:
    assert directions((0.0, "w"), (gap_s, "w"), at=gap_s) == moves


@pytest.mark.parametrize(("later_s", "moves"), [(0.24, 1), (0.26, 0)])
def test_a_key_that_repeats_no_more_is_released_after_a_quarter_of_a_second(later_s: float, moves: int) -> None:
    assert directions((0.0, "w"), (0.5, "w"), (0.6, "w"), at=0.6 + later_s) == moves


def test_after_the_release_it_takes_two_presses_again() -> None:
    released = ((0.0, "w"), (0.5, "w"), (1.0, "w"))
    assert directions(*released, at=1.0) == 0
    assert directions(*released, (1.5, "w"), at=1.5) == 1


@pytest.mark.parametrize("other", ["s", " ", "x", "q"])
def test_another_key_stops_at_once(other: str) -> None:
    assert directions((0.0, "w"), (0.5, "w"), (0.55, other), at=0.55) == 0


def test_arrow_keys_come_as_three_characters_and_many_keys_at_once() -> None:
    assert split_keys(f"w{UP}{UP}q") == ["w", UP, UP, "q"]
    assert directions((0.0, UP), (0.4, UP), at=0.4) == 1


class Holding(GuideWorld):
    """A jog before simulated drives; `hold` presses a key every 50 ms."""

    def __init__(self) -> None:
        super().__init__()

        def boot(rig: PoweredDrives) -> Script[bool]:
            yield from get_ready(rig)
            return True

        self.run(Guide(self.rig, boot(self.rig), self.told.append))
        self.jog = JogSession(self.rig, "left", 0.05)

    def hold(self, key: str, seconds: float) -> None:
        end, next_at = self.now_s + seconds, self.now_s
        while self.now_s < end:
            if key and self.now_s >= next_at:
                next_at = self.now_s + 0.05
                self.jog.press(key, self.now_s)
            self.turn(self.jog)

    def powered(self) -> bool:
        return any(axis.state in POWERED for node in self.bench.nodes.values() for axis in node.axes)


def test_a_wheel_turns_while_the_key_is_held_alone_and_slowly_and_loses_its_power_afterwards() -> None:
    world = Holding()
    world.hold("w", 1.5)
    left_mps, right_mps = world.speeds
    assert left_mps == pytest.approx(0.05, abs=0.005)
    assert right_mps == pytest.approx(0.0, abs=0.005)
    world.hold("", 0.25 + 0.05 / 0.2 + 0.2)
    assert world.speeds[0] == pytest.approx(0.0, abs=0.001)
    assert world.powered()
    world.hold("", 1.0)
    assert not world.powered()
    assert "switch on disabled, +0.000 m/s" in world.jog.line


def test_backward_goes_backward() -> None:
    world = Holding()
    world.hold("s", 1.5)
    assert world.speeds[0] == pytest.approx(-0.05, abs=0.005)


def test_q_ends_it_and_the_farewell_stops_a_wheel_that_turns() -> None:
    world = Holding()
    world.hold("w", 1.5)
    world.jog.press("q", world.now_s)
    assert world.jog.done
    took_s = world.run(SafeStop(world.rig))
    assert took_s < 0.5
    world.wait(0.2)
    assert world.speeds == (0.0, 0.0)
    assert not world.powered()


def test_killed_while_the_wheel_turns_the_drive_stops_by_itself() -> None:
    """SIGKILL: from one moment to the next nothing is sent any more. 0.3 s of 1016h, and the ramp."""
    world = Holding()
    world.hold("w", 1.5)
    world.wait(0.45)
    assert world.speeds == (0.0, 0.0)
    assert not world.powered()


def test_a_fault_while_it_turns_ends_it() -> None:
    world = Holding()
    world.hold("w", 1.0)
    world.bench.nodes[1].fail(0, 0x2310)
    with pytest.raises(RigError, match="left: fault 2310h over-current"):
        world.hold("w", 0.2)


def test_a_drive_that_falls_silent_while_it_turns_ends_it() -> None:
    world = Holding()
    world.hold("w", 1.0)
    world.bench.nodes[1].line.silent = True
    with pytest.raises(RigError, match="left: no status and velocity to 30 SYNCs"):
        world.hold("w", 0.5)


def cut(world: Holding, cob_id: int, kept_bytes: int) -> None:
    """From now on this PDO of the drives is too short, as after another client has mapped it."""
    tick = world.bench.tick

    def shorter(now_s: float) -> list[BenchFrame]:
        return [
            BenchFrame(frame.cob_id, frame.data[:kept_bytes]) if frame.cob_id == cob_id else frame
            for frame in tick(now_s)
        ]

    world.bench.tick = shorter  # type: ignore[method-assign]


# 0.05 m/s ── 6041h with 6064h, or 606Ch, becomes too short ── 0.3 s: it ends ── quick stop, until nothing is known 2 s
@pytest.mark.parametrize(("cob_id", "kept_bytes"), [(0x181, 5), (0x281, 3), (0x281, 0)])
def test_a_drive_whose_feedback_has_become_too_short_to_read_ends_it(cob_id: int, kept_bytes: int) -> None:
    world = Holding()
    world.hold("w", 1.0)
    cut(world, cob_id, kept_bytes)
    with pytest.raises(RigError, match="left: no status and velocity to 30 SYNCs"):
        world.hold("w", 0.5)


# standstill ── 606Ch becomes too short, its last value is 0 ── the key turns the wheel ── it ends, and brakes the wheel
def test_a_wheel_whose_last_velocity_is_old_is_not_at_standstill_for_the_farewell() -> None:
    world = Holding()
    world.hold("w", 0.02)
    cut(world, 0x281, 3)
    with pytest.raises(RigError, match="left: no status and velocity"):
        world.hold("w", 0.5)
    assert world.rig.axes["left"].velocity_mps == 0.0
    assert not world.rig.standing
