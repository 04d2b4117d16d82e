"""Two drives fresh from their boxes, both node 1 at 125 kbit/s, become nodes 1 and 2 at 500 kbit/s: in virtual time."""

from __future__ import annotations

from canbase_commissioning.census import require_no_power, take_census
from canbase_commissioning.lss import master
from canbase_commissioning.lss.adoption import discover, is_anybody_here, look, require_lss, take_into_use
from canbase_commissioning.lss.protocol import Identity
from canbase_sim.cia301.dictionary import key
from canbase_sim.cia402.states import POWERED, State
from support.rated_world import RatedWorld

FIRST = Identity(0, 0xCB402, 0x10000, 0x1A2B)
SECOND = Identity(0, 0xCB402, 0x10000, 0x1A2C)
NODE_IDS = {FIRST: 1, SECOND: 2}
LSS_ANSWER = 0x7E4


def test_two_drives_of_one_node_id_become_two_nodes_at_another_bit_rate_in_a_minute_and_stay_so() -> None:
    world = RatedWorld()
    began_s = world.now_s
    census = world.talk(look(125_000))
    assert (census.node_ids, census.twins, census.identities) == ((1,), frozenset({1}), {})

    found = world.talk(discover(census, 125_000))
    assert found == [FIRST, SECOND]
    world.talk(master.set_up_all(NODE_IDS, 500_000))
    world.talk(master.change_rate(found, 0.5))
    world.bitrate = 500_000
    world.wait(1.0)
    world.talk(master.keep_all(NODE_IDS))
    world.talk(take_into_use(NODE_IDS, 500_000))

    assert world.settings == [(1, 500_000), (2, 500_000)]
    assert world.now_s - began_s < 30.0
    assert not {axis.state for node in world.nodes for axis in node.axes} & POWERED
    world.power_cycle()
    assert world.settings == [(1, 500_000), (2, 500_000)]
    again = world.talk(take_census(500_000, one_drive_each=True))
    assert again.identities == {1: FIRST, 2: SECOND}


def test_where_one_node_id_answers_its_serial_number_is_not_read_as_two_answers_may_have_become_one() -> None:
    world = RatedWorld()
    world.nodes[1].line.silent = True
    census = world.talk(take_census(125_000, one_drive_each=False))
    assert (census.node_ids, census.twins, census.identities) == ((1,), frozenset(), {})
    assert not [frame for frame in world.received if frame.data[1:4] == bytes.fromhex("181004")]


def test_what_was_not_stored_is_gone_after_a_power_cycle() -> None:
    world = RatedWorld()
    found = world.talk(discover(world.talk(look(125_000)), 125_000))
    world.talk(master.set_up_all(NODE_IDS, 500_000))
    world.talk(master.change_rate(found, 0.5))
    world.wait(1.0)
    assert [rate for _, rate in world.settings] == [500_000, 500_000]
    world.power_cycle()
    assert world.settings == [(1, 125_000), (1, 125_000)]


def test_a_motor_with_power_ends_it_before_anything_was_sent_but_reads() -> None:
    world = RatedWorld()
    world.nodes[1].dictionary.set_data(0x6060, 0, b"\3")
    for word in (6, 7, 15):
        world.nodes[1].dictionary.set_data(0x6040, 0, bytes((word, 0)))
        world.wait(0.01)
    assert world.nodes[1].axes[0].state is State.OPERATION_ENABLED
    assert world.why(look(125_000)) == ("node 1 is in operation enabled: its motor may have power. Switch it off first")
    assert world.settings == [(1, 125_000), (1, 125_000)]


def test_a_drive_that_does_not_report_its_state_may_have_power() -> None:
    world = RatedWorld(factory_fresh=False, bitrate=500_000)
    assert world.why(require_no_power((1, 2, 3), 500_000)) == (
        "node 3 does not answer 6041h: whether it has power is unknown"
    )


# an encoder or an I/O module on the same bus: it refuses 6041h (0602 0000h)
def test_a_device_that_is_no_drive_ends_it_before_anything_was_sent_but_reads() -> None:
    world = RatedWorld(factory_fresh=False, bitrate=500_000)
    dictionary = world.nodes[1].dictionary
    dictionary.entries = {k: entry for k, entry in dictionary.entries.items() if k != key(0x6041)}
    assert world.why(look(500_000)).startswith("node 2 refuses 6041h, so it is no CiA 402 drive")
    assert world.settings == [(1, 500_000), (2, 500_000)]
    assert not [frame for frame in world.received if frame.cob_id == LSS_ANSWER]


def test_at_a_wrong_bit_rate_nobody_answers_and_the_frames_are_errors() -> None:
    world = RatedWorld(bitrate=250_000)
    assert not world.talk(is_anybody_here(250_000))
    assert world.errors > 100
    world.bitrate = 125_000
    assert world.talk(is_anybody_here(125_000))


def test_drives_of_different_bit_rates_destroy_each_others_frames() -> None:
    world = RatedWorld()
    world.nodes[1].lss.bitrate = 250_000
    for bitrate in (125_000, 250_000):
        world.bitrate = bitrate
        assert not world.talk(is_anybody_here(bitrate))


def test_a_drive_that_refuses_the_bit_rate_ends_it_with_nothing_in_use() -> None:
    world = RatedWorld()
    world.talk(discover(world.talk(look(125_000)), 125_000))
    world.nodes[1].lss._set_bit_timing = lambda table, index: (  # type: ignore[method-assign]
        world.nodes[1].lss._answer(0x13, b"\1\0")
    )
    why = world.why(master.set_up_all(NODE_IDS, 500_000))
    assert why == "serial 1A2Ch (0:CB402:10000), 500000 bit/s: it does not support this bit rate"
    world.power_cycle()
    assert world.settings == [(1, 125_000), (1, 125_000)]


def test_a_memory_that_cannot_be_written_is_named_with_what_is_stored_so_far() -> None:
    world = RatedWorld()
    world.talk(discover(world.talk(look(125_000)), 125_000))
    world.talk(master.set_up_all(NODE_IDS, None))
    world.nodes[1].lss.memory_fails = True
    why = world.why(master.keep_all(NODE_IDS))
    assert "serial 1A2Ch (0:CB402:10000), store: its memory cannot be written. Stored so far: serial 1A2Bh" in why


def test_a_third_drive_that_speaks_no_lss_is_named() -> None:
    world = RatedWorld(factory_fresh=False, bitrate=500_000)
    world.nodes[1].lss.on_frame = lambda data, now_s: None  # type: ignore[method-assign]
    world.nodes[1]._route()
    census = world.talk(look(500_000))
    assert census.identities == {1: FIRST, 2: SECOND}
    assert world.why(require_lss(census)).startswith("node 2 answers SDO and takes no LSS")
    assert world.settings == [(1, 500_000), (2, 500_000)]
    assert "node 2 answers SDO and takes no LSS" in world.why(discover(census, 500_000))


def test_drives_that_take_lss_keep_their_node_ids_while_they_are_counted() -> None:
    world = RatedWorld(factory_fresh=False, bitrate=500_000)
    world.talk(require_lss(world.talk(look(500_000))))
    assert world.settings == [(1, 500_000), (2, 500_000)]
    for node in world.nodes:
        node.lss.on_frame = lambda data, now_s: None  # type: ignore[method-assign]
        node._route()
    assert world.why(require_lss(world.talk(look(500_000)))).startswith("no drive answers LSS")


def test_drives_without_lss_are_told_from_an_empty_bus() -> None:
    world = RatedWorld()
    for node in world.nodes:
        node.lss.on_frame = lambda data, now_s: None  # type: ignore[method-assign]
        node._route()
    assert world.why(discover(world.talk(look(125_000)), 125_000)).startswith("no drive answers LSS")
