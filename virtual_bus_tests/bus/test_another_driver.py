"""A driver of another computer on the same bus: heard before the first frame of this one, which then ends."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from canbase_base.frame_socket import BusError
from canbase_base.single_instance import TakenError
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_driver.cia301.frame import Frame
from canbase_driver.runtime.claim import Claim

pytestmark = pytest.mark.bus

LISTEN_S = 0.3
OTHER_DRIVER = [(0x080, b""), (0x080, b"\x01"), (0x77F, b"\x05")]


@pytest.fixture
def robot(request: pytest.FixtureRequest) -> Robot:
    """The bench on a bus that this test has for itself."""
    bench = load_robot(sample("bench")).robot
    bus = bench.bus.model_copy(update={"interface": "virtual", "channel": request.node.name, "extra": {}})
    return bench.model_copy(update={"bus": bus})


@pytest.fixture
def other(robot: Robot) -> Iterator[can.BusABC]:
    with can.Bus(**robot.bus.arguments()) as bus:
        yield bus


@pytest.fixture
def claim(robot: Robot, tmp_path: Path) -> Iterator[Claim]:
    claimed = Claim(robot, tmp_path)
    yield claimed
    claimed.close()


def listen(claim: Claim, other: can.BusABC, cob_id: int, data: bytes) -> None:
    """It listens, and after 0.1 s the frame comes."""
    message = can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)
    timer = threading.Timer(0.1, other.send, (message,))
    timer.start()
    try:
        claim.listen()
        assert other.recv(0.0) is None  # nothing was sent
    finally:
        timer.join()


@pytest.mark.parametrize(("cob_id", "data"), OTHER_DRIVER)
def test_sync_and_the_heartbeat_of_a_driver_are_another_driver(
    claim: Claim, other: can.BusABC, cob_id: int, data: bytes
) -> None:
    with pytest.raises(TakenError, match="another driver is on the bus"):
        listen(claim, other, cob_id, data)


@pytest.mark.parametrize(("cob_id", "data"), [(0x701, b"\x7f"), (0x77E, b"\x05"), (0x1FE, bytes(8)), (0x181, bytes(6))])
def test_drives_and_the_watchdog_are_none(claim: Claim, other: can.BusABC, cob_id: int, data: bytes) -> None:
    listen(claim, other, cob_id, data)


@pytest.mark.parametrize(("cob_id", "data"), OTHER_DRIVER)
def test_what_came_while_this_one_started_is_heard_as_well(
    claim: Claim, other: can.BusABC, cob_id: int, data: bytes
) -> None:
    """The bus is open at 0 s, the frame comes, ROS is imported until 0.5 s."""
    other.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
    time.sleep(0.5)

    with pytest.raises(TakenError, match="another driver is on the bus"):
        claim.listen()


def test_the_time_since_the_bus_was_opened_counts(claim: Claim) -> None:
    time.sleep(LISTEN_S + 0.1)
    began_s = time.monotonic()
    claim.listen()
    assert time.monotonic() - began_s < LISTEN_S - 0.01


def test_a_bus_that_cannot_be_listened_to_is_not_taken_for_free(claim: Claim, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_timeout_s: float) -> None:
        raise MemoryError("no room for a frame")

    monkeypatch.setattr(claim.bus, "receive", broken)
    with pytest.raises(MemoryError):
        claim.listen()


def test_a_bus_that_is_never_read_empty_is_not_taken_for_free(claim: Claim, monkeypatch: pytest.MonkeyPatch) -> None:
    """A flood: another driver's frames may be among those that were lost."""
    monkeypatch.setattr("canbase_driver.runtime.claim.LONGEST_S", 0.6)
    monkeypatch.setattr(claim.bus, "receive", lambda _timeout_s: Frame(0x181, bytes(6)))
    with pytest.raises(BusError, match="something floods it"):
        claim.listen()


def test_the_frames_of_others_do_not_keep_it_from_its_end(claim: Claim, other: can.BusABC) -> None:
    """Two frames in each turn of the listening thread."""
    began_s = time.monotonic()
    task = other.send_periodic(can.Message(arbitration_id=0x181, data=bytes(6), is_extended_id=False), 0.005)
    claim.listen()
    task.stop()
    assert time.monotonic() - began_s < 2 * LISTEN_S


def test_a_claim_that_is_given_up_listens_no_longer(claim: Claim) -> None:
    began_s = time.monotonic()
    claim.close()
    assert time.monotonic() - began_s < LISTEN_S - 0.1


def test_a_bus_that_was_just_opened_is_listened_to_for_the_whole_time(claim: Claim) -> None:
    began_s = time.monotonic()
    claim.listen()
    assert time.monotonic() - began_s >= LISTEN_S - 0.05


def test_another_driver_of_this_computer_has_the_bus_until_it_closes_its_claim(
    robot: Robot, claim: Claim, tmp_path: Path
) -> None:
    with pytest.raises(TakenError, match="another driver has"):
        Claim(robot, tmp_path / "other")
    claim.close()
    Claim(robot, tmp_path / "other").close()
