"""What any simulated drive can be made to do wrong, as a master sees it. docs/drive_types.md lists these switches."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_sim.cia301.nmt import NmtState
from canbase_sim.cia402.states import State
from canbase_sim.faults import KINDS, apply
from canbase_sim.personality import PERSONALITIES
from support.sim_rig import MPS, Rig

DEVICE_STATE = "08000022"
WATCHED = 0x7E_0064
"""1016h: node 126, 100 ms."""


@pytest.fixture
def rig() -> Rig:
    """Two plain drives, booted."""
    return Rig()


def broken(rig: Rig, kind: str, **arguments: object) -> None:
    rig.heard.clear()
    apply(rig.bench.nodes, 1, kind, rig.now_s, arguments)


def heard(rig: Rig, cob_id: str) -> list[str]:
    return [text[4:] for _, text in rig.heard if text.startswith(cob_id)]


def test_a_boot_up_message_too_many_changes_nothing_in_the_drive(rig: Rig) -> None:
    rig.enable()
    broken(rig, "extra_boot_up")
    rig.wait(0.01)
    assert heard(rig, "701") == ["00"]
    assert rig.state() is State.OPERATION_ENABLED


def test_aliases_have_the_same_lower_eleven_bits_and_other_bytes(rig: Rig) -> None:
    broken(rig, "aliases")
    rig.tx("601 40 00 10 00 00 00 00 00")
    assert [text for _, text in rig.heard] == ["581 43 00 10 00 92 01 02 00", "D81 BC FF EF FF 6D FE FD FF"]
    broken(rig, "heal")
    assert len(rig.tx("601 40 00 10 00 00 00 00 00")) == 1


@pytest.mark.parametrize(
    ("option", "state"), [(0, State.OPERATION_ENABLED), (1, State.FAULT), (3, State.SWITCH_ON_DISABLED)]
)
def test_bus_off_is_a_lost_connection_and_is_told_with_8140h_when_it_is_over(
    rig: Rig, option: int, state: State
) -> None:
    assert rig.write(0x6007, option) == "ok"
    rig.enable()
    rig.tx("000 01 01")
    broken(rig, "bus_off", off_s=0.3)
    rig.tx("601 40 00 10 00 00 00 00 00")
    rig.wait(0.299)
    assert rig.heard == []
    rig.wait(0.002)
    assert heard(rig, "081") == ["40 81 11 00 00 00 00 00"]
    assert rig.state() is state
    assert rig.node.state is NmtState.PRE_OPERATIONAL  # 1029h:1 = 0


def test_a_reset_from_inside_forgets_the_mapping_and_keeps_the_encoder(rig: Rig) -> None:
    assert rig.write(0x1017, 50) == "ok"
    before = rig.read(0x6064)
    broken(rig, "reset_node")
    rig.wait(0.3)
    assert heard(rig, "701") == ["00"]
    assert (rig.read(0x1017), rig.read(0x6064)) == (0, before)


@pytest.mark.parametrize(
    ("supply", "state", "voltage"),
    [("sto", State.SWITCH_ON_DISABLED, True), ("no_mains", State.READY_TO_SWITCH_ON, False)],
)
def test_without_sto_or_main_voltage_it_gets_no_further_until_they_are_back(
    rig: Rig, supply: str, state: State, voltage: bool
) -> None:
    broken(rig, supply)
    rig.enable()
    assert rig.state() is state
    assert bool(rig.read(0x6041) & 0x10) is voltage
    broken(rig, "heal")
    rig.enable()
    assert rig.state() is State.OPERATION_ENABLED


@pytest.mark.parametrize("supply", ["sto", "no_mains"])
def test_a_supply_that_is_lost_at_speed_lets_the_motor_coast(rig: Rig, supply: str) -> None:
    rig.drive(MPS // 2, MPS // 2, 1.0)
    broken(rig, supply)
    rig.wait(0.01)
    assert rig.state() in (State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON)
    assert not rig.axis.motor.powered
    assert rig.axis.motor.speed_mps > 0.4


def test_a_quick_stop_at_a_stand_shows_quick_stop_active_in_one_frame_at_most(rig: Rig) -> None:
    """605Ah = 2: a drive that need not brake is in switch on disabled before the next SYNC."""
    assert rig.write(0x1800, 0x8000_0181, sub=1) == "ok"
    assert rig.write(0x1A00, 0, sub=0) == "ok"
    assert rig.write(0x1A00, 0x6041_0010, sub=1) == "ok"
    assert rig.write(0x1A00, 1, sub=0) == "ok"
    assert rig.write(0x1800, 255, sub=2) == "ok"
    assert rig.write(0x1800, 0x0000_0181, sub=1) == "ok"
    rig.enable()
    rig.tx("000 01 01")
    rig.wait(0.01)
    rig.heard.clear()
    assert rig.write(0x6040, 0x02) == "ok"
    rig.wait(0.01)
    states = [int.from_bytes(bytes.fromhex(data), "little") & 0x6F for data in heard(rig, "181")]
    assert states.count(State.QUICK_STOP_ACTIVE.value) <= 1
    assert states[-1] == State.SWITCH_ON_DISABLED.value


def test_an_epos4_takes_its_option_codes_only_without_power() -> None:
    from unit.sim.test_personality import rig_with

    rig = rig_with("epos4")
    assert rig.write(0x605A, 2) == "ok"
    rig.enable()
    assert [rig.write(index, 1) for index in (0x6007, 0x605A, 0x605E)] == [DEVICE_STATE] * 3
    assert rig.write(0x6040, 0) == "ok"
    assert rig.write(0x605A, 2) == "ok"


def test_a_heartbeat_and_a_setpoint_that_stay_away_are_8130h_and_8250h(rig: Rig) -> None:
    assert rig.write(0x1016, WATCHED, sub=1) == "ok"
    assert rig.write(0x1400, 50, sub=5) == "ok"
    rig.tx("000 01 01")
    rig.tx("77E 05")
    rig.tx("201 06 00 00 00 00 00")
    rig.heard.clear()
    rig.wait(0.06)
    assert [data[:5] for data in heard(rig, "081")] == ["50 82"]
    rig.wait(0.1)
    assert [data[:5] for data in heard(rig, "081")] == ["50 82", "30 81"]


def test_a_sync_counter_is_expected_where_1019h_says_so(rig: Rig) -> None:
    assert [rig.write(0x1019, value) for value in (1, 240)] == ["06090030", "ok"]
    rig.tx("000 01 01")
    rig.heard.clear()
    rig.tx("080 01")
    assert heard(rig, "081") == []
    rig.tx("080")
    assert heard(rig, "081") == ["40 82 11 00 00 00 00 00"]


@pytest.mark.parametrize("name", sorted({*KINDS, *PERSONALITIES}))
def test_every_fault_and_every_kind_is_in_the_documentation(name: str) -> None:
    page = Path(__file__).parents[3] / "docs" / "drive_types.md"
    assert f"`{name}`" in page.read_text(encoding="utf-8")
