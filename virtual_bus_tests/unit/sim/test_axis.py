"""Option codes, fault reset, halt, modes and statusword of the simulated drive, with times."""

from __future__ import annotations

import pytest

from canbase_sim.cia402.states import State
from support.sim_rig import MPS, Rig

HALF = MPS // 2


def _running(**objects: int) -> Rig:
    """Node 1 at 0.5 m/s, ramps 1 m/s², quick stop 2 m/s²; further objects as o605A=…"""
    rig = Rig()
    for name, value in objects.items():
        rig.write(int(name[1:], 16), value)
    rig.drive(HALF, HALF, 1.0)
    return rig


def _time_to_stand(rig: Rig) -> float:
    start = rig.now_s
    while abs(rig.bench.base.v_left_mps) > 0.003:
        rig.wait(0.002)
        assert rig.now_s - start < 5.0, "never stands"
    return rig.now_s - start


def _both(rig: Rig, word: int) -> None:
    rig.write(0x6040, word, node=1)
    rig.write(0x6040, word, node=2)


# time from 0.5 m/s: coasting by friction alone, 6084h (1 m/s²), 6085h (2 m/s²), torque limit 90 N a wheel for 18 kg
COAST, RAMP, QUICK, LIMIT = (0.7, 1.6), (0.48, 0.54), (0.23, 0.29), (0.05, 0.14)


@pytest.mark.parametrize(
    ("code", "time_s", "end"),
    [
        (0, COAST, State.SWITCH_ON_DISABLED),
        (1, RAMP, State.SWITCH_ON_DISABLED),
        (2, QUICK, State.SWITCH_ON_DISABLED),
        (3, LIMIT, State.SWITCH_ON_DISABLED),
        (4, LIMIT, State.SWITCH_ON_DISABLED),
        (5, RAMP, State.QUICK_STOP_ACTIVE),
        (6, QUICK, State.QUICK_STOP_ACTIVE),
        (7, LIMIT, State.QUICK_STOP_ACTIVE),
        (8, LIMIT, State.QUICK_STOP_ACTIVE),
    ],
)
def test_quick_stop_option_605a(code: int, time_s: tuple[float, float], end: State) -> None:
    rig = Rig()
    for node in (1, 2):
        rig.write(0x605A, code, node=node)
    rig.drive(HALF, HALF, 1.0)
    _both(rig, 0x02)
    low, high = time_s
    assert low <= _time_to_stand(rig) <= high
    rig.wait(0.1)
    assert rig.state() is end


@pytest.mark.parametrize(
    ("index", "word", "end"),
    [(0x605B, 0x06, State.READY_TO_SWITCH_ON), (0x605C, 0x07, State.SWITCHED_ON)],
)
@pytest.mark.parametrize(("code", "time_s"), [(0, COAST), (1, RAMP)])
def test_shutdown_605b_and_disable_operation_605c(
    index: int, word: int, end: State, code: int, time_s: tuple[float, float]
) -> None:
    rig = Rig()
    for node in (1, 2):
        rig.write(index, code, node=node)
    rig.drive(HALF, HALF, 1.0)
    _both(rig, word)
    low, high = time_s
    assert low <= _time_to_stand(rig) <= high
    rig.wait(0.1)
    assert rig.state() is end


def test_stopping_commands_interrupt_a_slow_down_and_enabling_does_not() -> None:
    for word, end in ((0x00, State.SWITCH_ON_DISABLED), (0x02, State.QUICK_STOP_ACTIVE)):
        rig = _running(o605C=1)
        rig.write(0x6040, 0x07)
        rig.wait(0.1)
        rig.write(0x6040, 0x0F)
        rig.wait(0.1)
        assert rig.axis.motor.goal_mps == 0.0
        rig.write(0x6040, word)
        assert rig.state() is end


@pytest.mark.parametrize(("code", "time_s"), [(0, COAST), (1, RAMP), (2, QUICK), (3, LIMIT), (4, LIMIT)])
def test_fault_reaction_605e(code: int, time_s: tuple[float, float]) -> None:
    rig = Rig()
    for node in (1, 2):
        rig.write(0x605E, code, node=node)
    rig.drive(HALF, HALF, 1.0)
    for node in (1, 2):
        rig.bench.nodes[node].fail(0, 0x2310)
    low, high = time_s
    assert low <= _time_to_stand(rig) <= high
    rig.wait(0.1)
    assert rig.state() is State.FAULT
    assert rig.read(0x603F) == 0x2310
    assert not rig.axis.motor.powered


def test_a_fault_without_power_needs_no_reaction() -> None:
    rig = Rig()
    rig.node.fail(0, 0x3220)
    assert rig.state() is State.FAULT


def test_fault_reset_takes_an_edge_of_bit_7() -> None:
    """
    6040h bit 7 : 1 1 1 0 1
    state       : F F F F S     the fault came while bit 7 was already set
    """
    rig = Rig()
    rig.write(0x6040, 0x80)
    rig.node.fail(0, 0x2310)
    for word, state in (
        (0x80, State.FAULT),
        (0x80, State.FAULT),
        (0x00, State.FAULT),
        (0x80, State.SWITCH_ON_DISABLED),
    ):
        rig.write(0x6040, word)
        assert rig.state() is state
    assert rig.read(0x603F) == 0


def test_fault_reset_is_in_vain_while_the_cause_holds() -> None:
    rig = Rig()
    rig.node.fail(0, 0x4210, holds=True)
    for word in (0x00, 0x80, 0x00, 0x80):
        rig.write(0x6040, word)
        assert rig.state() is State.FAULT
    rig.node.heal(0)
    rig.write(0x6040, 0x80)
    assert rig.state() is State.FAULT  # no edge
    rig.write(0x6040, 0x00)
    rig.write(0x6040, 0x80)
    assert rig.state() is State.SWITCH_ON_DISABLED


@pytest.mark.parametrize(("code", "time_s"), [(1, RAMP), (2, QUICK), (3, LIMIT), (4, LIMIT)])
def test_halt_605d_stops_enabled_and_goes_on(code: int, time_s: tuple[float, float]) -> None:
    rig = Rig()
    for node in (1, 2):
        rig.write(0x605D, code, node=node)
    rig.drive(HALF, HALF, 1.0)
    _both(rig, 0x10F)
    low, high = time_s
    assert low <= _time_to_stand(rig) <= high
    rig.wait(0.2)
    assert rig.read(0x6041) & 0x046F == 0x0427  # enabled, target reached: it stands
    _both(rig, 0x0F)
    rig.wait(1.0)
    assert rig.bench.base.v_mps == pytest.approx(0.5, abs=0.005)


@pytest.mark.parametrize("option", [0, 1, 2, 3])
def test_abort_connection_6007_when_nmt_stops_the_node(option: int) -> None:
    ends = (State.OPERATION_ENABLED, State.FAULT_REACTION_ACTIVE, State.SWITCH_ON_DISABLED, State.QUICK_STOP_ACTIVE)
    rig = _running(o6007=option)
    rig.tx("000 02 01")
    assert rig.state() is ends[option]


def test_pre_operational_alone_leaves_the_motor_running() -> None:
    rig = _running(o6007=3)
    rig.tx("000 01 01")
    rig.tx("000 80 01")
    rig.wait(0.2)
    assert rig.state() is State.OPERATION_ENABLED
    assert rig.bench.base.v_mps == pytest.approx(0.5, abs=0.005)


def test_mode_3_ramps_by_6083_and_6084_and_shows_target_reached_and_speed_zero() -> None:
    rig = Rig()
    rig.drive(0, 0, 0.1)
    assert rig.read(0x6041) & 0x1400 == 0x1400
    rig.drive(HALF, HALF, 0.25)
    assert rig.bench.base.v_mps == pytest.approx(0.25, abs=0.01)
    assert rig.read(0x6041) & 0x1400 == 0
    rig.wait(0.4)
    assert rig.read(0x6041) & 0x1400 == 0x0400
    assert rig.read(0x606C) == pytest.approx(HALF, abs=3)
    assert rig.read(0x606C, node=2) == pytest.approx(-HALF, abs=3)


def test_mode_9_follows_within_the_torque_limit() -> None:
    """90 N a wheel on 36 kg that rub with 12 N: 0.25 m/s takes about 54 ms, with bit 11 set meanwhile."""
    rig = Rig()
    rig.drive(MPS // 4, MPS // 4, 0.02, mode=9)
    assert rig.read(0x6041) & 0x1800 == 0x1800  # follows, at the internal limit
    assert rig.bench.base.v_mps < 0.15
    rig.wait(0.08)
    assert rig.bench.base.v_mps == pytest.approx(0.25, abs=0.02)


def test_max_torque_6072_is_the_limit() -> None:
    rig = Rig()
    for node in (1, 2):
        rig.write(0x6072, 100, node=node)  # 10 % of 90 N: 18 N against 12 N of friction
    rig.drive(HALF, HALF, 0.5)
    assert rig.bench.base.v_mps < 0.15
    assert rig.read(0x6077) == 100


@pytest.mark.parametrize("mode", [1, 6, 8, 10, -3])
def test_other_modes_are_refused(mode: int) -> None:
    assert Rig().write(0x6060, mode) == "06090030"


def test_the_mode_changes_only_without_power() -> None:
    rig = Rig()
    rig.enable(mode=3)
    assert rig.write(0x6060, 9) == "08000022"
    assert rig.write(0x6060, 3) == "ok"
    rig.write(0x6040, 0x00)
    assert rig.write(0x6060, 9) == "ok"
    assert rig.read(0x6061) == 9


def test_a_stale_target_acts_as_soon_as_the_drive_is_enabled() -> None:
    """As real drives do; the driver must write zero first."""
    rig = _running()
    _both(rig, 0x00)
    rig.wait(2.0)
    for word in (0x06, 0x07, 0x0F):
        _both(rig, word)
    rig.wait(0.5)
    assert rig.bench.base.v_mps > 0.3


def test_quick_stop_active_shows_bit_5_clear_and_bit_10_when_it_stands() -> None:
    rig = _running(o605A=6)
    _both(rig, 0x02)
    assert rig.read(0x6041) & 0x046F == 0x0007
    rig.wait(0.4)
    assert rig.read(0x6041) & 0x046F == 0x0407
