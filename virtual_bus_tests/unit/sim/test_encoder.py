"""A drive whose one encoder fails, wheels that do not follow upward, frames of one axis that stay away."""

from __future__ import annotations

import pytest

from canbase_sim import faults
from canbase_sim.plant.encoder import EncoderFault
from support.sim_rig import MPS, Rig

SLOW = round(0.3 * MPS)


def _driving(seconds: float = 1.0) -> Rig:
    rig = Rig()
    rig.drive(SLOW, SLOW, seconds)
    return rig


def _suffer(rig: Rig, kind: str, **arguments: float) -> None:
    faults.apply(rig.bench.nodes, 1, kind, rig.now_s, arguments)


def _shown(rig: Rig) -> tuple[int, int]:
    """6064h and 606Ch."""
    return rig.read(0x6064), rig.read(0x606C)


def _left(rig: Rig) -> float:
    return rig.bench.truth(rig.now_s).v_left_mps


def test_with_a_lost_encoder_the_loop_pushes_and_the_wheel_runs_away() -> None:
    rig = _driving()
    position, _ = _shown(rig)
    _suffer(rig, "encoder_lost")
    rig.wait(0.02)
    assert _shown(rig) == (position, 0)
    rig.wait(1.0)
    assert _shown(rig) == (position, 0)
    assert _left(rig) > 3.0


def test_a_quick_stop_with_a_lost_encoder_brakes_nothing() -> None:
    rig = _driving()
    _suffer(rig, "encoder_lost")
    rig.wait(0.3)
    before = _left(rig)
    rig.write(0x6040, 0x02)
    rig.wait(0.3)
    assert _left(rig) > 0.5 * before
    rig.write(0x6040, 0x00)
    rig.wait(3.0)
    assert _left(rig) < before


def test_a_frozen_encoder_shows_its_last_speed_and_no_motion() -> None:
    rig = _driving()
    shown = _shown(rig)
    _suffer(rig, "encoder_frozen")
    rig.write(0x60FF, 0)
    rig.wait(0.5)
    assert _shown(rig) == shown
    assert _left(rig) < -0.5  # the loop brakes a speed that is not there any more


def test_a_zero_encoder_shows_zero() -> None:
    rig = _driving()
    _suffer(rig, "encoder_zero")
    rig.wait(0.1)
    assert _shown(rig) == (0, 0)


def test_a_reversed_encoder_makes_the_loop_unstable() -> None:
    rig = _driving()
    _suffer(rig, "encoder_reversed")
    rig.wait(0.5)
    assert abs(_left(rig)) > 1.0


def test_a_scaled_encoder_makes_the_wheel_as_much_too_fast() -> None:
    rig = _driving()
    _suffer(rig, "encoder_scaled", factor=0.5)
    rig.wait(2.0)
    assert rig.read(0x606C) == pytest.approx(SLOW, rel=0.02)
    assert _left(rig) == pytest.approx(0.6, rel=0.02)


def test_an_intermittent_encoder_misses_half_of_the_way() -> None:
    rig = _driving()
    _suffer(rig, "encoder_intermittent", off_s=0.01)
    start, _ = _shown(rig)
    way = rig.bench.base.travel_left_m
    rig.wait(0.2)
    way = rig.bench.base.travel_left_m - way
    counted = (rig.read(0x6064) - start) / (4096 * 10 / (2 * 3.14159265 * 0.1))
    assert counted == pytest.approx(way / 2.0, rel=0.3)


def test_an_encoder_that_loses_counts_above_a_speed_makes_its_wheel_faster_and_faster() -> None:
    rig = _driving()
    rig.bench.nodes[1].axes[0].lose_encoder(EncoderFault(factor=1.0, most_mps=0.4))
    rig.wait(0.5)
    assert _left(rig) == pytest.approx(0.3, rel=0.02)
    rig.write(0x60FF, round(0.5 * MPS))
    rig.wait(1.0)
    assert rig.read(0x606C) == pytest.approx(0.4 * MPS, rel=0.02)
    assert _left(rig) > 1.5


def test_a_jumping_encoder_jumps_ahead_and_back() -> None:
    rig = _driving()
    _suffer(rig, "encoder_jumping", jump_m=0.02, every_s=0.1)
    shown = []
    for _ in range(200):
        rig.wait(0.002)
        shown.append(rig.read(0x606C))
    assert max(shown) > 5.0 * MPS > -5.0 * MPS > min(shown)
    assert sum(abs(speed) > 5.0 * MPS for speed in shown) == 4


def test_what_an_encoder_missed_is_lost_after_it_has_healed() -> None:
    rig = _driving()
    position, _ = _shown(rig)
    _suffer(rig, "encoder_lost")
    rig.wait(0.2)
    _suffer(rig, "heal")
    assert rig.read(0x6064) == position
    rig.wait(2.0)
    assert _left(rig) == pytest.approx(0.3, abs=0.01)
    assert rig.read(0x6064) > position


def test_a_blocked_wheel_stands_whatever_its_motor_does_and_the_base_turns() -> None:
    rig = Rig()
    _suffer(rig, "blocked")
    rig.drive(SLOW, SLOW, 1.0)
    assert _left(rig) == 0.0
    assert rig.bench.truth(rig.now_s).angular_radps > 0.3
    _suffer(rig, "heal")
    rig.wait(2.0)
    assert _left(rig) == pytest.approx(0.3, abs=0.01)


def test_a_threshold_holds_a_wheel_until_its_motor_is_strong_enough() -> None:
    rig = Rig()
    _suffer(rig, "blocked", force_n=50.0)
    rig.drive(SLOW, SLOW, 2.0)
    assert _left(rig) == pytest.approx(0.3, abs=0.02)


def test_the_right_wheel_is_held_by_its_own_drive() -> None:
    rig = Rig()
    faults.apply(rig.bench.nodes, 2, "blocked", rig.now_s, {})
    rig.drive(SLOW, SLOW, 1.0)
    assert rig.bench.truth(rig.now_s).v_right_mps == 0.0


def test_a_limited_wheel_turns_at_a_share_of_its_setpoint() -> None:
    rig = Rig()
    _suffer(rig, "limited", share=0.5)
    rig.drive(SLOW, SLOW, 1.0)
    assert _left(rig) == pytest.approx(0.15, abs=0.01)
    assert rig.bench.truth(rig.now_s).v_right_mps == pytest.approx(0.3, abs=0.01)


PDO_SETUP = ((0x1800, 0x181, 0x1A00, (0x60410010, 0x60640020)), (0x1801, 0x281, 0x1A01, (0x606C0020,)))


def _with_pdos(rig: Rig) -> None:
    """TPDO1 and TPDO2 on each SYNC, RPDO1 takes effect with it."""
    for index, cob_id, mapping, objects in (*PDO_SETUP, (0x1400, 0x201, 0x1600, (0x60400010, 0x60FF0020))):
        rig.write(index, 1 << 31 | cob_id, sub=1)
        rig.write(index, 1, sub=2)
        rig.write(mapping, 0, sub=0)
        for number, packed in enumerate(objects, 1):
            assert rig.write(mapping, packed, sub=number) == "ok"
        rig.write(mapping, len(objects), sub=0)
        assert rig.write(index, cob_id, sub=1) == "ok"
    rig.tx("000 01 01")


def _targets(rig: Rig, targets: range) -> list[int]:
    """60FFh after each of these targets and a SYNC."""
    taken = []
    for target in targets:
        rig.tx(f"201 00 00 {target:02x} 00 00 00")
        rig.tx("080")
        taken.append(rig.read(0x60FF))
    return taken


def test_setpoints_of_one_axis_do_not_reach_it_or_every_second_one() -> None:
    rig = Rig()
    _with_pdos(rig)
    assert _targets(rig, range(1, 5)) == [1, 2, 3, 4]
    _suffer(rig, "rpdo_lost")
    assert _targets(rig, range(5, 9)) == [4, 4, 4, 4]
    _suffer(rig, "rpdo_lost", every=2)
    assert len(set(_targets(rig, range(10, 18)))) in (4, 5)
    _suffer(rig, "heal")
    assert _targets(rig, range(20, 24)) == [20, 21, 22, 23]


def test_feedback_of_one_axis_stays_away() -> None:
    rig = Rig()
    _with_pdos(rig)

    def answers() -> list[str]:
        return [text[:3] for text in rig.tx("080") if text[:3] in ("181", "281")]

    assert answers() == ["181", "281"]
    _suffer(rig, "tpdo_lost")
    assert answers() == []
    _suffer(rig, "heal")
    assert answers() == ["181", "281"]
