"""What single kinds of drives do on the bus that the generic one does not, as a master sees it. Times in seconds."""

from __future__ import annotations

import pytest

from canbase_sim.cia301.nmt import NmtState
from canbase_sim.cia402.raw_units import Scale
from canbase_sim.cia402.states import State
from canbase_sim.faults import apply
from canbase_sim.personality import PERSONALITIES
from support.sim_rig import Rig, robot

BOOT_UP = "701 00"
INVALID = "06090030"


def rig_with(kind: str, wait_s: float = 1.0, **changes: object) -> Rig:
    """Two drives of this kind, booted."""
    unit = changes.pop("velocity_unit", None)
    left: dict[str, object] = {"joint": "left", "node_id": 1, "side": "left", "profile": kind, "velocity_unit": unit}
    right = {"joint": "right", "node_id": 2, "side": "right", "direction": -1, "profile": kind, "velocity_unit": unit}
    if kind == "zlac8015d":
        right |= {"node_id": 1, "axis": 1}
    rig = Rig(robot(left | changes, right | changes))
    rig.wait(wait_s)
    return rig


def boot_ups(rig: Rig) -> list[float]:
    return [when for when, text in rig.heard if text == BOOT_UP]


@pytest.mark.parametrize("kind", ["technosoft", "zlac8015d"])
def test_no_heartbeat_consumer(kind: str) -> None:
    rig = rig_with(kind)
    assert rig.tx("601 40 16 10 01 00 00 00 00") == ["581 80 16 10 01 00 00 02 06"]


@pytest.mark.parametrize(("kind", "entries"), [("roboteq", 4), ("epos4", 2), ("dryve_d1", 1)])
def test_so_many_heartbeats_are_watched(kind: str, entries: int) -> None:
    rig = rig_with(kind, velocity_unit="rpm")
    assert rig.read(0x1016) == entries
    assert rig.write(0x1016, 0x7E0064, sub=entries) == "ok"
    assert rig.tx(f"601 40 16 10 {entries + 1:02X} 00 00 00 00") == [f"581 80 16 10 {entries + 1:02X} 11 00 09 06"]


def test_roboteq_refuses_a_cob_id_without_bit_30() -> None:
    rig = rig_with("roboteq")
    assert rig.read(0x1800, sub=1) == 0x4000_0181
    assert rig.write(0x1800, 0x8000_0181, sub=1) == INVALID
    assert rig.write(0x1800, 0xC000_0181, sub=1) == "ok"


def test_roboteq_has_no_sync_and_takes_no_synchronous_pdo() -> None:
    rig = rig_with("roboteq")
    assert rig.tx("601 40 05 10 00 00 00 00 00") == ["581 80 05 10 00 00 00 02 06"]
    rig.tx("000 80 01")
    assert rig.write(0x1800, 1, sub=2) == INVALID
    assert rig.write(0x1800, 255, sub=2) == "ok"


@pytest.mark.parametrize(
    ("kind", "index", "sub", "raw"),
    [
        ("generic", 0x6079, 0, 23_889),
        ("elmo_gold", 0x6079, 0, 23_889),
        ("epos4", 0x2200, 1, 239),
        ("roboteq", 0x210D, 2, 239),
    ],
)
def test_each_kind_shows_its_supply_where_its_eds_has_it(kind: str, index: int, sub: int, raw: int) -> None:
    rig = rig_with(kind, velocity_unit="rpm")
    rig.node._supply_v = lambda: 23.889
    assert rig.read(index, sub=sub) == raw


@pytest.mark.parametrize("kind", ["epos4", "roboteq", "zlac8015d", "tmcm1636", "dryve_d1"])
def test_a_kind_whose_eds_has_no_6079h_refuses_it(kind: str) -> None:
    rig = rig_with(kind, velocity_unit="rpm" if kind == "dryve_d1" else None)
    assert rig.tx("601 40 79 60 00 00 00 00 00") == ["581 80 79 60 00 00 00 02 06"]


def test_roboteq_goes_to_operational_by_itself() -> None:
    rig = rig_with("roboteq")
    assert rig.node.state is NmtState.OPERATIONAL


def test_roboteq_motors_stop_1_s_after_the_last_command_and_go_on_with_the_next() -> None:
    rig = rig_with("roboteq")
    rig.tx("000 80 01")
    for sub, value in ((1, 0xC000_0201), (1, 0x4000_0201)):
        assert rig.write(0x1400, 0xC000_0201, sub=1) == "ok"
        assert rig.write(0x1600, 0, sub=0) == "ok"
        assert rig.write(0x1600, 0x6040_0010, sub=1) == "ok"
        assert rig.write(0x1600, 0x60FF_0020, sub=2) == "ok"
        assert rig.write(0x1600, 2, sub=0) == "ok"
        assert rig.write(0x1400, value, sub=sub) == "ok"
    rig.enable()
    rig.tx("000 01 01")
    rig.tx("201 0F 00 64 00 00 00")  # 100 rpm
    rig.wait(0.99)
    moving = rig.axis.motor.speed_mps
    rig.wait(1.5)
    assert moving > 0.1
    assert rig.axis.motor.speed_mps == pytest.approx(0.0, abs=1e-6)
    assert rig.state() is State.OPERATION_ENABLED
    rig.tx("201 0F 00 64 00 00 00")
    rig.wait(0.9)
    assert rig.axis.motor.speed_mps > 0.1


def test_an_inverter_follows_6042h_with_all_three_bits_of_its_ramp_and_within_6046h() -> None:
    rig = rig_with("inverter")
    for index, sub, value in ((0x6060, 0, 2), (0x6048, 1, 1000), (0x6049, 1, 1000), (0x6042, 0, 200)):
        assert rig.write(index, value, sub=sub) == "ok"
    for word in (0x06, 0x07, 0x0F):
        assert rig.write(0x6040, word) == "ok"
    rig.wait(1.0)
    assert rig.read(0x6044) == 0  # bits 4 to 6 are 0
    assert rig.write(0x6040, 0x7F) == "ok"
    rig.wait(1.0)
    assert rig.read(0x6044) == 200
    assert rig.write(0x6040, 0x5F) == "ok"
    assert rig.write(0x6042, 0) == "ok"
    rig.wait(1.0)
    assert rig.read(0x6044) == 200  # bit 5 is 0: the ramp is locked
    assert rig.write(0x6040, 0x7F) == "ok"
    for target, shown in ((0, 0), (-10, -30), (9000, 1500)):  # 6046h: 30 to 1500 rpm
        assert rig.write(0x6042, target) == "ok"
        rig.wait(3.0)
        assert rig.read(0x6044) == shown
    assert rig.tx("601 40 FF 60 00 00 00 00 00") == ["581 80 FF 60 00 00 00 02 06"]


def test_zlac_shows_both_motors_behind_one_controlword() -> None:
    rig = rig_with("zlac8015d")
    for index, sub, value in ((0x6083, 1, 500), (0x6083, 2, 500), (0x6060, 0, 3), (0x60FF, 1, 20), (0x60FF, 2, -30)):
        assert rig.write(index, value, sub=sub) == "ok"
    for word in (0x06, 0x07, 0x0F):
        assert rig.write(0x6040, word) == "ok"
    rig.wait(1.0)
    status = rig.read(0x6041)
    assert (status & 0x6F, status >> 16 & 0x6F) == (0x27, 0x27)
    assert (rig.read(0x606C, sub=1), rig.read(0x606C, sub=2)) == (200, -300)  # 0.1 rpm
    assert rig.tx("601 40 41 68 00 00 00 00 00") == ["581 80 41 68 00 00 00 02 06"]


def test_zlac_watches_its_commands_only_where_2000h_says_so() -> None:
    rig = rig_with("zlac8015d")
    assert rig.read(0x2000) == 0
    assert rig.write(0x2000, 300) == "ok"


def test_kinco_shows_no_mode_without_power() -> None:
    rig = rig_with("kinco")
    assert rig.node.dictionary.values[0x6061 << 8] == 0
    assert rig.tx("601 2F 60 60 00 03 00 00 00") == []
    assert "581 60 60 60 00 00 00 00 00" in rig.wait(0.01)
    assert rig.node.dictionary.values[0x6061 << 8] == 0
    for word in ("06", "07", "0F"):
        rig.tx(f"601 2B 40 60 00 {word} 00 00 00")
        rig.wait(0.01)
    assert rig.state() is State.OPERATION_ENABLED
    assert rig.node.dictionary.values[0x6061 << 8] == 3


def test_kinco_answers_after_4_ms() -> None:
    rig = rig_with("kinco")
    rig.tx("601 40 00 10 00 00 00 00 00")
    assert rig.wait(0.003) == []
    assert [text[:15] for text in rig.wait(0.002)] == ["581 43 00 10 00"]


def test_nanotec_boots_twice_and_answers_after_the_second_time() -> None:
    rig = rig_with("nanotec", wait_s=0.15, velocity_unit="rpm")
    assert rig.tx("601 40 00 10 00 00 00 00 00") == []
    rig.wait(0.2)
    assert boot_ups(rig) == [pytest.approx(0.1, abs=0.002), pytest.approx(0.4, abs=0.002)]
    assert rig.tx("601 40 00 10 00 00 00 00 00") != []


def test_technosoft_boots_late() -> None:
    assert boot_ups(rig_with("technosoft")) == [pytest.approx(0.6, abs=0.002)]


def test_epos4_keeps_the_fault_of_a_lost_heartbeat_until_its_communication_is_reset() -> None:
    rig = rig_with("epos4")
    assert rig.write(0x6007, 1) == "ok"
    assert rig.write(0x1016, 0x7E0064, sub=1) == "ok"
    rig.tx("000 01 01")
    rig.tx("77E 05")
    rig.wait(0.15)
    assert rig.state() is State.FAULT
    for _ in range(2):
        rig.tx("77E 05")
        rig.write(0x6040, 0x00)
        rig.write(0x6040, 0x80)
    assert rig.state() is State.FAULT
    rig.tx("000 82 01")
    rig.wait(0.2)
    rig.write(0x6040, 0x00)
    rig.write(0x6040, 0x80)
    assert rig.state() is State.SWITCH_ON_DISABLED


def test_a_lost_boot_up_and_an_emergency_message_of_three_bytes() -> None:
    rig = rig_with("generic", velocity_unit="rpm")
    apply(rig.bench.nodes, 1, "mute_boot", rig.now_s, {})
    apply(rig.bench.nodes, 1, "short_emcy", rig.now_s, {})
    rig.heard.clear()
    rig.node.power_cycle(rig.now_s, 0.1)
    rig.wait(0.5)
    rig.node.fail(0, 0x2310)
    rig.wait(0.01)
    assert [text for _, text in rig.heard] == ["081 10 23 03"]


@pytest.mark.parametrize(
    ("kind", "raw_per_rps", "raw_per_rps2"),
    [
        ("epos4", 60.0, 60.0),
        ("roboteq", 60.0, 600.0),
        ("kinco", 16.384 * 4096, 0.016384 * 4096),
        ("technosoft", 65.536 * 4096, 0.065536 * 4096),
        ("elmo_gold", 4096.0, 4096.0),
    ],
)
def test_units(kind: str, raw_per_rps: float, raw_per_rps2: float) -> None:
    drive = robot({"joint": "l", "node_id": 1, "side": "left", "profile": kind, "velocity_unit": None}, RIGHT).drives[0]
    scale = Scale.of(drive, 10.0 / 6.283185307179586, PERSONALITIES[kind])  # gear 10: 1 m for each motor revolution
    assert 1.0 / scale.target_mps == pytest.approx(raw_per_rps)
    assert 1.0 / scale.slope(1) == pytest.approx(raw_per_rps2)


RIGHT: dict[str, object] = {"joint": "right", "node_id": 2, "side": "right"}


def test_a_ramp_in_ms_counts_to_the_full_speed() -> None:
    drive = robot({"joint": "l", "node_id": 1, "side": "left", "profile": "zlac8015d", "velocity_unit": None}, RIGHT)
    scale = Scale.of(drive.drives[0], 10.0 / 6.283185307179586, PERSONALITIES["zlac8015d"])
    assert scale.slope(500) == pytest.approx(1000.0 / 60.0 / 0.5)
    assert scale.slope(0) == float("inf")
