"""The campaign's bus with what nobody drew before: no acknowledgement, batches, a babbling node."""

from __future__ import annotations

from random import Random

from canbase_campaign.can_bus import QUEUE, UNACKNOWLEDGED, CanBus, Receiver
from canbase_campaign.clock import Clock


class Ear(Receiver):
    """Notes what it receives, with its time."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.heard: list[tuple[float, int]] = []

    def hear(self, cob_id: int, data: bytes) -> None:
        self.heard.append((self._clock.now_s, cob_id))


def bus_of(bitrate: int = 500_000) -> tuple[Clock, CanBus]:
    clock = Clock(0.0)
    return clock, CanBus(clock, Random(0), bitrate)


def test_frames_that_nobody_acknowledges_wait_and_are_sent_in_a_burst() -> None:
    """t   0 to 1.0 s nobody acknowledges; 100 setpoints are sent, of which 13 fit"""
    clock, bus = bus_of()
    ear = Ear(clock)
    bus.join("drive1", ear)
    driver, other = bus.join("driver", Receiver()), bus.join("drive2", Receiver())
    driver.hold(True)
    taken = [driver.send(0x201, bytes([number])) for number in range(QUEUE)]
    assert taken == [True] * UNACKNOWLEDGED + [False] * (QUEUE - UNACKNOWLEDGED)
    other.send(0x182, b"")
    clock.run_until(1.0)
    assert [cob_id for _, cob_id in ear.heard] == [0x182], "the others go on"
    driver.hold(False)
    clock.run_until(1.1)
    late = [at for at, cob_id in ear.heard if cob_id == 0x201]
    assert len(late) == UNACKNOWLEDGED
    assert 1.0 < late[0] < late[-1] < 1.003


def test_a_frame_that_is_on_the_bus_when_the_acknowledgement_ends_is_the_last_one() -> None:
    clock, bus = bus_of()
    ear = Ear(clock)
    bus.join("drive1", ear)
    driver = bus.join("driver", Receiver())
    driver.send(0x201, b"")
    driver.send(0x202, b"")
    driver.hold(True)
    clock.run_until(0.1)
    assert [cob_id for _, cob_id in ear.heard] == [0x201]
    driver.hold(False)
    clock.run_until(0.2)
    assert [cob_id for _, cob_id in ear.heard] == [0x201, 0x202]


def test_an_adapter_passes_frames_in_batches_and_in_order() -> None:
    """Batches of 10 ms between the computer and the drives; the drives among themselves receive at once."""
    clock, bus = bus_of()
    driver_ear, drive_ear = Ear(clock), Ear(clock)
    driver = bus.join("driver", driver_ear)
    drive = bus.join("drive1", Receiver())
    bus.join("drive2", drive_ear)
    bus.disturbance.batch_s = 0.01
    assert not bus.disturbance.quiet
    clock.run_until(0.011)
    drive.send(0x181, b"")
    drive.send(0x281, b"")
    driver.send(0x201, b"")
    clock.run_until(0.1)
    assert [(round(at, 6), cob_id) for at, cob_id in driver_ear.heard] == [(0.02, 0x181), (0.02, 0x281)]
    assert [at < 0.012 for at, cob_id in drive_ear.heard if cob_id != 0x201] == [True, True]
    assert [round(at, 6) for at, cob_id in drive_ear.heard if cob_id == 0x201] == [0.02]


def test_a_babbling_node_lets_nothing_else_through() -> None:
    clock, bus = bus_of()
    ear = Ear(clock)
    bus.join("ear", ear)
    babbler, driver = bus.join("intruder", Receiver()), bus.join("driver", Receiver())
    for _ in range(80):
        babbler.send(0x001, bytes(8))
    driver.send(0x080, b"")
    clock.run_until(0.015)
    assert {cob_id for _, cob_id in ear.heard} == {0x001}
    clock.run_until(0.1)
    assert ear.heard[-1][1] == 0x080
