"""LSS of the simulated drive, frame by frame (CiA 305): two drives fresh from the box on one bus."""

from __future__ import annotations

from canbase_sim.cia301.dictionary import key
from canbase_sim.world.bench import Bench, BenchParameters
from support.sim_rig import Rig, robot

ASK = "7E5 "
WAITING, CONFIGURATION = ASK + "04 00 00 00 00 00 00 00", ASK + "04 01 00 00 00 00 00 00"
NO_NODE_ID = ASK + "11 FF 00 00 00 00 00 00"
STORE = ASK + "17 00 00 00 00 00 00 00"
SCAN_AGAIN = ASK + "51 00 00 00 00 80 00 00"
IDENTIFIED = "7E4 4F 00 00 00 00 00 00 00"
SELECT_2 = (
    ASK + "40 00 00 00 00 00 00 00",
    ASK + "41 02 B4 0C 00 00 00 00",
    ASK + "42 00 00 01 00 00 00 00",
    ASK + "43 02 00 00 00 00 00 00",
)


class FreshRig(Rig):
    """Drives with node id 1 and 125 kbit/s, serials 1 and 2."""

    def __init__(self) -> None:
        super().__init__()
        self.bench = Bench(robot(), self.now_s, parameters=BenchParameters(0.1, 0.0, factory_fresh=True))
        self.wait(0.2)

    @property
    def node_ids(self) -> list[int]:
        return [node.node_id for node in self.bench.nodes.values()]


def test_both_drives_have_the_factory_settings_and_both_answer() -> None:
    rig = FreshRig()
    assert [(node.node_id, node.bitrate) for node in rig.bench.nodes.values()] == [(1, 125_000), (1, 125_000)]
    answers = rig.tx("601 40 18 10 04 00 00 00 00") + rig.wait(0.01)
    assert answers == ["581 43 18 10 04 01 00 00 00", "581 43 18 10 04 02 00 00 00"]


def test_one_drive_is_selected_by_its_identity_and_gets_a_node_id_that_counts_after_reset_communication() -> None:
    rig = FreshRig()
    assert [rig.tx(frame) for frame in SELECT_2] == [[], [], [], ["7E4 44 00 00 00 00 00 00 00"]]
    assert rig.tx(ASK + "5E 00 00 00 00 00 00 00") == ["7E4 5E 01 00 00 00 00 00 00"]
    assert rig.tx(ASK + "5D 00 00 00 00 00 00 00") == ["7E4 5D 02 00 00 00 00 00 00"]
    assert rig.tx(ASK + "11 05 00 00 00 00 00 00") == ["7E4 11 00 00 00 00 00 00 00"]
    rig.tx(WAITING)
    assert rig.node_ids == [1, 1]
    rig.tx("000 82 00")
    assert sorted(rig.wait(0.05)) == ["701 00", "705 00"]
    assert rig.tx("605 40 18 10 04 00 00 00 00") == ["585 43 18 10 04 02 00 00 00"]
    tpdo = rig.bench.nodes[2].dictionary.values[key(0x1800, 1)]
    assert tpdo & 0x7FF == 0x185


def test_what_is_not_stored_is_lost_with_the_power_and_what_is_stored_is_not() -> None:
    rig = FreshRig()
    for stores, node_id in ((False, 1), (True, 5)):
        for frame in (*SELECT_2, ASK + "11 05 00 00 00 00 00 00", *((STORE,) if stores else ()), WAITING):
            rig.tx(frame)
        rig.bench.nodes[2].power_cycle(rig.now_s)
        rig.wait(1.0)
        assert rig.node_ids == [1, node_id]


def test_a_drive_without_a_node_id_speaks_lss_alone_and_starts_by_itself_when_it_gets_one() -> None:
    rig = FreshRig()
    assert rig.tx(SCAN_AGAIN) == []
    rig.tx(CONFIGURATION)
    assert rig.tx(NO_NODE_ID) == ["7E4 11 00 00 00 00 00 00 00"] * 2
    rig.tx(WAITING)
    assert rig.tx(SCAN_AGAIN) == []
    rig.tx("000 82 00")
    assert rig.wait(0.1) == []
    assert rig.tx("601 40 00 10 00 00 00 00 00") + rig.wait(0.01) == []
    assert rig.tx(SCAN_AGAIN) == [IDENTIFIED] * 2
    unconfigured = ASK + "4C 00 00 00 00 00 00 00"
    assert rig.tx(unconfigured) == ["7E4 50 00 00 00 00 00 00 00"] * 2
    for frame in (*SELECT_2, ASK + "11 07 00 00 00 00 00 00"):
        rig.tx(frame)
    assert rig.tx(unconfigured) == ["7E4 50 00 00 00 00 00 00 00"]
    rig.tx(WAITING)
    assert rig.wait(0.05) == ["707 00"]


def test_fastscan_goes_on_with_those_whose_bits_fit_and_ends_with_one_in_configuration() -> None:
    rig = FreshRig()
    for frame in (CONFIGURATION, NO_NODE_ID, WAITING, "000 82 00"):
        rig.tx(frame)
    rig.wait(0.1)
    assert rig.tx(SCAN_AGAIN) == [IDENTIFIED] * 2
    assert rig.tx(ASK + "51 01 00 00 00 00 00 01") == []  # another vendor
    assert rig.tx(ASK + "51 00 00 00 00 00 00 01") == [IDENTIFIED] * 2
    assert rig.tx(ASK + "51 02 B4 0C 00 00 01 02") == [IDENTIFIED] * 2
    assert rig.tx(ASK + "51 00 00 01 00 00 02 03") == [IDENTIFIED] * 2
    assert rig.tx(ASK + "51 00 00 00 00 02 03 03") == [IDENTIFIED] * 2  # bits 2 and up of both serials are 0
    assert rig.tx(ASK + "51 00 00 00 00 01 03 03") == [IDENTIFIED]
    assert rig.tx(ASK + "51 01 00 00 00 00 03 00") == [IDENTIFIED]
    assert rig.tx(ASK + "5D 00 00 00 00 00 00 00") == ["7E4 5D 01 00 00 00 00 00 00"]
    assert rig.tx(SCAN_AGAIN) == [IDENTIFIED]


def test_error_codes() -> None:
    rig = FreshRig()
    for frame in SELECT_2:
        rig.tx(frame)
    assert rig.tx(ASK + "11 80 00 00 00 00 00 00") == ["7E4 11 01 00 00 00 00 00 00"]
    assert rig.tx(ASK + "13 00 05 00 00 00 00 00") == ["7E4 13 01 00 00 00 00 00 00"]
    assert rig.tx(ASK + "13 01 02 00 00 00 00 00") == ["7E4 13 01 00 00 00 00 00 00"]
    rig.bench.nodes[2].lss.memory_fails = True
    assert rig.tx(STORE) == ["7E4 17 02 00 00 00 00 00 00"]
    assert rig.tx("7E5 17") == []  # not eight bytes


def test_the_bit_rate_changes_after_the_delay_and_the_drive_is_silent_as_long_again() -> None:
    rig = FreshRig()
    node = rig.bench.nodes[2]
    for frame in (*SELECT_2, ASK + "13 00 02 00 00 00 00 00", ASK + "15 C8 00 00 00 00 00 00"):
        rig.tx(frame)
    rig.wait(0.19)
    assert (node.lss.bitrate, node.bitrate) == (125_000, 0)
    rig.wait(0.1)
    assert (node.lss.bitrate, node.bitrate) == (500_000, 0)
    rig.wait(0.12)
    assert node.bitrate == 500_000
    node.power_cycle(rig.now_s)
    assert node.lss.bitrate == 125_000
