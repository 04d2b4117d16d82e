"""One cable with drives and a tool at several bit rates."""

from __future__ import annotations

import pytest

from canbase_config import bit_rate
from canbase_config.robot import Bus
from canbase_sim.cia305.bit_timing import BIT_RATES
from canbase_sim.frame import Frame
from canbase_sim.world.bench import Bench, BenchParameters
from canbase_sim.world.rated_wire import NO_ACKNOWLEDGE, PROTOCOL_ERROR, RatedWire
from support.sim_rig import robot

READ = Frame(0x601, bytes.fromhex("4000100000000000"))
RATES = (500_000, 125_000)


class Cable:
    """Two drives at 125 kbit/s, booted."""

    def __init__(self) -> None:
        self.bench = Bench(robot(), 0.0, parameters=BenchParameters(0.1, 0.0, factory_fresh=True))
        self.wire = RatedWire(self.bench, RATES)
        self.boot_ups = self.wire.tick(0.2)


def test_a_frame_at_the_rate_of_all_drives_is_answered_at_that_rate_and_an_error_at_the_other() -> None:
    cable = Cable()
    assert cable.wire.on_frame(READ, 125_000, 0.3) == []
    answers = cable.wire.tick(0.3)
    assert [(rate, frame.cob_id) for rate, frame, is_error in answers if not is_error] == [(125_000, 0x581)] * 2
    assert [(rate, frame) for rate, frame, is_error in answers if is_error] == [(500_000, PROTOCOL_ERROR)]


def test_a_frame_at_another_rate_reaches_nobody_and_its_sender_sees_an_error() -> None:
    cable = Cable()
    assert cable.wire.on_frame(READ, 500_000, 0.3) == [(500_000, PROTOCOL_ERROR, True)]
    assert cable.wire.tick(0.3) == []
    assert cable.wire.destroyed == 1


def test_nothing_passes_between_drives_of_two_rates() -> None:
    cable = Cable()
    cable.bench.nodes[2].lss.bitrate = 500_000
    for rate in RATES:
        assert cable.wire.on_frame(READ, rate, 0.3) == [(rate, PROTOCOL_ERROR, True)]


def test_where_no_drive_is_on_the_cable_nobody_acknowledges() -> None:
    cable = Cable()
    for node in cable.bench.nodes.values():
        node.lss.switch_at = 9.0
    assert cable.wire.on_frame(READ, 125_000, 0.3) == [(125_000, NO_ACKNOWLEDGE, True)]


def test_a_channel_for_each_rate_of_a_simulated_bus() -> None:
    udp = Bus(interface="udp_multicast", channel="239.74.163.2", extra={"port": 43000})
    ports = {bit_rate.bus_at(udp, rate).arguments()["port"] for rate in bit_rate.BIT_RATES}
    assert len(ports) == len(bit_rate.BIT_RATES)
    assert bit_rate.bus_at(udp, udp.bitrate).arguments() == udp.arguments()
    highest = Bus(interface="udp_multicast", channel="239.74.163.2", extra={"port": 65535})
    assert all(bit_rate.bus_at(highest, rate).arguments()["port"] <= 65535 for rate in bit_rate.BIT_RATES)
    virtual = Bus(interface="virtual", channel="bench", extra={})
    assert bit_rate.bus_at(virtual, 125_000).channel == "bench at 125000"
    slcan = Bus(interface="slcan", channel="/dev/ttyACM0", extra={})
    assert bit_rate.bus_at(slcan, 125_000).arguments()["bitrate"] == 125_000


@pytest.mark.parametrize("index", sorted(BIT_RATES))
def test_tool_and_drive_have_the_same_numbers_for_bit_rates(index: int) -> None:
    from canbase_commissioning.lss.protocol import BIT_TIMINGS

    assert BIT_TIMINGS[BIT_RATES[index]] == index
    assert BIT_RATES[index] in bit_rate.BIT_RATES
