"""The heartbeat consumer 1016h of the simulated drive, and what a loss does: EMCY, 1029h, 6007h."""

from __future__ import annotations

import pytest

from canbase_sim.cia301.nmt import NmtState
from canbase_sim.cia402.states import State
from support.sim_rig import MPS, Rig

DRIVER, WATCHDOG = 0x7F, 0x7E
LOST_DRIVER, CLEARED = "081 30 81 11 7F 00 00 00 00", "081 00 00 00 7F 00 00 00 00"


def _entry(node: int, milliseconds: int) -> int:
    return node << 16 | milliseconds


def _watching(rig: Rig | None = None) -> Rig:
    """Node 1 watches the driver with 300 ms and is OPERATIONAL."""
    rig = rig or Rig()
    assert rig.write(0x1016, _entry(DRIVER, 300), sub=1) == "ok"
    rig.tx("000 01 01")
    rig.wait(0.01)
    rig.heard.clear()
    return rig


def test_before_the_first_heartbeat_nothing_is_watched() -> None:
    """
    77F : ----------------------
    EMCY: ......................
    """
    rig = _watching()
    assert rig.wait(3.0) == []
    assert rig.node.state is NmtState.OPERATIONAL


def test_a_boot_up_does_not_start_the_watch() -> None:
    """
    77F : 0---------------------
    EMCY: ......................
    """
    rig = _watching()
    rig.tx("77F 00")
    assert rig.wait(3.0) == []


def test_silence_after_a_heartbeat_is_told_once_after_the_time() -> None:
    """
    t/ms: 0  100  200      500
    77F : H--H----H-------------------
    EMCY: ..................!.........
    """
    rig = _watching()
    for _ in range(3):
        rig.tx("77F 05")
        rig.wait(0.1)
    start = rig.now_s - 0.1
    said = rig.wait(2.0)
    assert said == [LOST_DRIVER]
    assert rig.heard[0][0] - start == pytest.approx(0.3, abs=0.003)


@pytest.mark.parametrize(("gap_s", "lost"), [(0.299, False), (0.302, True)])
def test_the_time_is_a_limit(gap_s: float, lost: bool) -> None:
    rig = _watching()
    rig.tx("77F 05")
    said = rig.wait(gap_s)
    assert (LOST_DRIVER in said) is lost


def test_a_boot_up_of_a_live_producer_is_a_loss() -> None:
    """
    77F : H--H--0
    EMCY: ......!       it restarted
    """
    rig = _watching()
    rig.tx("77F 05")
    rig.wait(0.1)
    assert rig.tx("77F 00") == [LOST_DRIVER]


def test_a_heartbeat_after_the_loss_clears_the_error_and_watches_again() -> None:
    """
    77F : H----------H-----------
    EMCY: .....!.....0.....!.....
    """
    rig = _watching()
    rig.write(0x6007, 0)
    rig.tx("77F 05")
    rig.wait(1.0)
    assert rig.tx("77F 05") == [CLEARED]
    assert rig.read(0x1001) == 0
    assert rig.wait(1.0) == [LOST_DRIVER]


def test_two_producers_are_watched_each_by_itself() -> None:
    rig = _watching()
    assert rig.write(0x1016, _entry(WATCHDOG, 100), sub=2) == "ok"
    for _ in range(10):
        rig.tx("77F 05")
        rig.wait(0.1)
    rig.tx("77E 05")
    said = []
    for _ in range(10):
        rig.tx("77F 05")
        said += rig.wait(0.1)
    assert said == ["081 30 81 11 7E 00 00 00 00"]


def test_one_producer_in_two_entries_is_refused() -> None:
    rig = _watching()
    assert rig.write(0x1016, _entry(DRIVER, 100), sub=2) == "06040043"
    assert rig.write(0x1016, _entry(DRIVER, 100), sub=1) == "ok"  # the same entry may change


@pytest.mark.parametrize("entry", [_entry(0, 300), _entry(128, 300), _entry(DRIVER, 0), 1 << 24 | _entry(DRIVER, 300)])
def test_an_entry_that_makes_no_sense_watches_nothing(entry: int) -> None:
    rig = Rig()
    assert rig.write(0x1016, entry, sub=1) == "ok"
    rig.tx("77F 05")
    assert rig.wait(2.0) == []


@pytest.mark.parametrize(
    ("behaviour", "before", "after"),
    [
        (0, NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL),
        (0, NmtState.STOPPED, NmtState.STOPPED),
        (1, NmtState.OPERATIONAL, NmtState.OPERATIONAL),
        (2, NmtState.OPERATIONAL, NmtState.STOPPED),
    ],
)
def test_error_behaviour_1029_decides_the_nmt_state(behaviour: int, before: NmtState, after: NmtState) -> None:
    rig = _watching()
    rig.write(0x1029, behaviour, sub=1)
    rig.tx("000 02 01" if before is NmtState.STOPPED else "000 01 01")
    rig.tx("77F 05")
    rig.wait(0.5)
    assert rig.node.state is after


@pytest.mark.parametrize(
    ("option", "state", "stands"),
    [
        (0, State.OPERATION_ENABLED, False),
        (1, State.FAULT, True),
        (2, State.SWITCH_ON_DISABLED, True),
        (3, State.QUICK_STOP_ACTIVE, True),
    ],
)
def test_6007_decides_what_the_motor_does(option: int, state: State, stands: bool) -> None:
    """Both drives watch the driver; with 6007h = 0 they drive on for ever."""
    rig = Rig()
    for node in (1, 2):
        rig.write(0x6007, option, node=node)
        rig.write(0x605A, 6, node=node)
        rig.write(0x1016, _entry(DRIVER, 300), sub=1, node=node)
    rig.tx("000 01 00")
    rig.drive(MPS // 2, MPS // 2, 0.25)
    rig.tx("77F 05")
    rig.wait(0.25)
    assert rig.bench.base.v_mps > 0.4
    rig.wait(3.0)
    assert rig.state() is state
    assert (abs(rig.bench.base.v_mps) < 0.001) is stands


def test_the_fault_of_a_lost_heartbeat_can_be_reset_only_when_it_is_back() -> None:
    rig = _watching()
    rig.tx("77F 05")
    rig.wait(0.5)
    assert rig.state() is State.FAULT
    assert rig.read(0x603F) == 0x8130
    for word in (0x00, 0x80, 0x00):
        rig.write(0x6040, word)
    assert rig.state() is State.FAULT
    rig.tx("77F 05")
    rig.write(0x6040, 0x80)
    assert rig.state() is State.SWITCH_ON_DISABLED


def test_a_cut_cable_is_noticed_by_the_drive_itself() -> None:
    rig = _watching()
    rig.tx("77F 05")
    rig.node.line.cut = True
    for _ in range(5):
        rig.tx("77F 05")
        assert rig.wait(0.1) == []  # it cannot tell anybody
    assert rig.state() is State.FAULT
