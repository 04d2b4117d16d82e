"""NMT of the simulated drive: boot-up, what lives in which state, resets, and its own heartbeat."""

from __future__ import annotations

import pytest

from canbase_sim.cia301.nmt import NmtState
from canbase_sim.cia402.states import State
from support.sim_rig import MPS, Rig


def test_each_node_says_boot_up_once_and_then_waits_in_pre_operational() -> None:
    """0.1 s after power on, and nothing else before it is asked: 1017h is 0."""
    rig = Rig()
    assert [text for _, text in rig.heard] == ["701 00", "702 00"]
    assert rig.heard[0][0] == pytest.approx(0.1, abs=0.002)
    assert rig.wait(1.0) == []
    assert rig.node.state is NmtState.PRE_OPERATIONAL
    assert rig.state() is State.SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("frame", "state"),
    [
        ("000 01 01", NmtState.OPERATIONAL),
        ("000 01 00", NmtState.OPERATIONAL),
        ("000 02 01", NmtState.STOPPED),
        ("000 80 01", NmtState.PRE_OPERATIONAL),
        ("000 81 01", NmtState.INITIALISING),
        ("000 82 01", NmtState.INITIALISING),
        ("000 01 02", NmtState.PRE_OPERATIONAL),  # another node
        ("000 03 01", NmtState.PRE_OPERATIONAL),  # no such command
        ("000 01", NmtState.PRE_OPERATIONAL),  # too short
        ("000 01 01 00", NmtState.PRE_OPERATIONAL),  # too long
        ("000", NmtState.PRE_OPERATIONAL),
    ],
)
def test_commands_from_pre_operational(frame: str, state: NmtState) -> None:
    rig = Rig()
    rig.tx(frame)
    assert rig.node.state is state


def test_heartbeat_comes_every_period_and_at_once_after_a_change_of_state() -> None:
    """
    1017h = 100 ms
    t/ms      : 0   100  200  250  350
    heartbeat : 7F  7F   7F   05   05       250: NMT start
    """
    rig = Rig()
    start = rig.now_s
    rig.write(0x1017, 100)
    rig.wait(0.25)
    rig.tx("000 01 01")
    rig.wait(0.15)
    beats = [
        (round(1000 * (time - start)), text) for time, text in rig.heard if time >= start and text.startswith("701")
    ]
    times = [time for time, _ in beats]
    assert times == pytest.approx([0, 100, 200, 250, 350], abs=2)
    assert [text for _, text in beats] == ["701 7F", "701 7F", "701 7F", "701 05", "701 05"]


def test_a_late_tick_sends_one_heartbeat_and_no_burst() -> None:
    rig = Rig()
    rig.write(0x1017, 10)
    rig.wait(1.0, step_s=0.01)
    rig.heard.clear()
    rig.wait(5.0, step_s=5.0)
    assert len(rig.heard) == 1


def test_in_stopped_only_nmt_and_heartbeat_live() -> None:
    rig = Rig()
    rig.write(0x1017, 100)
    rig.tx("000 02 01")
    rig.wait(0.01)
    assert rig.tx("601 40 00 10 00 00 00 00 00") == []
    assert rig.tx("080") == []
    assert set(rig.wait(0.5)) == {"701 04"}
    rig.tx("000 80 01")
    assert rig.tx("601 40 00 10 00 00 00 00 00") == ["581 43 00 10 00 92 01 02 00"]


def test_reset_node_forgets_everything_and_cuts_the_power() -> None:
    rig = Rig()
    rig.drive(MPS // 2, MPS // 2, 1.0)
    rig.tx("000 81 00")
    assert not rig.axis.motor.powered
    assert "701 00" in rig.wait(0.2)
    assert rig.state() is State.SWITCH_ON_DISABLED
    assert (rig.read(0x6084), rig.read(0x60FF), rig.read(0x6060), rig.read(0x6040)) == (1000, 0, 0, 0)


def test_reset_communication_keeps_the_application() -> None:
    rig = Rig()
    rig.write(0x1017, 100)
    rig.write(0x6007, 0)
    rig.enable(target=MPS // 2)
    rig.tx("000 82 01")
    assert "701 00" in rig.wait(0.05)
    assert rig.state() is State.OPERATION_ENABLED
    assert rig.read(0x1017) == 0
    assert rig.read(0x60FF) == MPS // 2


def test_nothing_is_heard_before_the_boot_up() -> None:
    rig = Rig()
    rig.tx("000 81 01")
    rig.tx("000 01 01")
    assert rig.tx("601 40 00 10 00 00 00 00 00") == []
    rig.wait(0.2)
    assert rig.node.state is NmtState.PRE_OPERATIONAL
