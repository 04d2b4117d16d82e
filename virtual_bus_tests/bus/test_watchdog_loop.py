"""The watchdog's loop in real time on python-can's `virtual` bus; fake drives, driver and filter in a thread."""

from __future__ import annotations

import logging
import math
import os
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import can
import pytest

from canbase_base.frame_socket import BusError
from canbase_watchdog import loop
from canbase_watchdog.bus_port import BusPort
from canbase_watchdog.frames import Frame
from canbase_watchdog.lease_socket import LeaseSocket, LeaseSocketError
from canbase_watchdog.loop import BusDeadError, Loop
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import Watchdog
from support.watchdog_live import LiveRobot
from support.watchdog_story import config

pytestmark = pytest.mark.bus

ME = os.geteuid()
QUICK_STOP = Frame(0x501, bytes.fromhex("02 00"))


class Rig:
    """A watchdog's loop in a thread, and the robot that it watches."""

    def __init__(self, channel: str, path: str) -> None:
        arguments = {"interface": "virtual", "channel": channel}
        # Test and watchdog share an interpreter here: late turns of the loop are no news.
        self.config = replace(config(), bus_arguments=arguments, lease_socket=path, loop_late_s=1.0)
        self.watchdog = Watchdog(self.config, time.monotonic())
        self.robot = LiveRobot(arguments, path)
        self.asked = threading.Event()
        self.thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        with BusPort(self.config.bus_arguments) as bus, LeaseSocket(self.config.lease_socket, ME) as leases:
            Loop(self.watchdog, bus, leases).run(self.asked.is_set)


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    it = Rig(str(tmp_path), str(tmp_path / "run" / "lease"))
    it.thread.start()
    with it.robot:
        it.robot.first(0x1FE, 0.0)
        yield it
        it.asked.set()
        it.thread.join(timeout=3.0)
    assert not it.thread.is_alive()


def cause(rig: Rig) -> TripCause:
    return rig.watchdog.status.verdict.cause


# driving ── CLOCK_BOOTTIME is 60 s ahead of CLOCK_MONOTONIC at once: the computer was suspended ── quick stop
def test_a_suspend_at_speed_stops_the_base(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.robot.drive_at(300)
    begin, before_s = time.monotonic(), loop.suspended_s()
    monkeypatch.setattr(loop, "suspended_s", lambda: before_s + 60.0)
    at, frame = rig.robot.first(0x501, begin)
    assert frame == QUICK_STOP
    assert at - begin < 0.1
    assert cause(rig) is TripCause.LOOP_LATE


# driving ── once CLOCK_MONOTONIC is read late after CLOCK_BOOTTIME, as if 60 s less had been suspended ── no suspend
def test_a_pause_between_the_two_clocks_is_no_suspend(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.robot.drive_at(300)
    before_s = loop.suspended_s()
    readings = iter((before_s - 60.0,))
    monkeypatch.setattr(loop, "suspended_s", lambda: next(readings, before_s))
    time.sleep(0.3)
    assert next(readings, None) is None, "it was read"
    assert cause(rig) is TripCause.NONE


def test_every_change_is_one_line_in_the_log(rig: Rig, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        rig.robot.drive_at(300)
        rig.robot.filter = False
        rig.robot.wait_until_still()
        rig.robot.wait_for(lambda: rig.watchdog.status.settled, 1.0)
        time.sleep(0.05)
    lines = [record.message for record in caplog.records if record.name == "canbase.watchdog"]
    trips = [line for line in lines if line.startswith("tripped: lease lost: no valid lease for 0.2")]
    assert (len(trips), lines.count("ladder: quick stop"), lines.count("all drives at standstill")) == (1, 1, 1)
    assert len(lines) <= 4


# --- the shell's parts


class DeadBus(can.BusABC):
    """Everything that is asked of it fails."""

    channel_info = "dead"

    def __init__(self, channel: str, **kwargs: object) -> None:
        super().__init__(channel)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise can.CanOperationError("Network is down", 100)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        raise can.CanOperationError("Network is down", 100)


def test_a_bus_that_takes_nothing_for_a_second_ends_the_loop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("can.Bus", lambda **arguments: DeadBus("x"))
    begin = time.monotonic()
    with BusPort({}) as bus, LeaseSocket(str(tmp_path / "lease"), ME) as leases:
        dead = Loop(Watchdog(config(), begin), bus, leases)
        with pytest.raises(BusDeadError, match=r"no frame could be sent for 1\.0 s"):
            dead.run(lambda: False)
        assert 1.0 <= time.monotonic() - begin < 2.0
        assert bus.health.send_errors >= 10
        assert 10 <= bus.health.receive_errors <= 2000


def test_a_bus_that_cannot_be_opened_says_what_to_look_at() -> None:
    with pytest.raises(BusError, match=r"Check `bus` in robot\.yaml"):
        BusPort({"interface": "nonsense", "channel": "can0"})


def test_only_data_frames_with_11_bits_are_taken_in() -> None:
    with BusPort({"interface": "virtual", "channel": "kinds"}) as port, can.Bus("kinds", interface="virtual") as other:
        for kind in ({"is_extended_id": True}, {"is_remote_frame": True}, {"is_error_frame": True}, {}):
            other.send(can.Message(arbitration_id=0x701, data=b"", **{"is_extended_id": False} | kind))
        assert [frame[:2] for frame in port.receive(time.monotonic())] == [(0x701, b"")]


@pytest.mark.parametrize("set_by_s", [0.0, 3600.0, -3600.0])
def test_a_frame_has_the_time_at_which_it_came_and_not_that_of_its_taking(
    set_by_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0 ms a look, 20 ms a frame comes, 60 ms it is taken. A wall clock that was set in between says nothing."""
    with BusPort({"interface": "virtual", "channel": "times"}) as port, can.Bus("times", interface="virtual") as other:
        assert list(port.receive(time.monotonic())) == []
        time.sleep(0.02)
        before_s = time.monotonic()
        other.send(can.Message(arbitration_id=0x701, data=b"\5", is_extended_id=False))
        after_s = time.monotonic()
        time.sleep(0.04)
        wall_clock = time.time
        monkeypatch.setattr(time, "time", lambda: wall_clock() + set_by_s)
        now_s = time.monotonic()
        [(_, _, at_s)] = port.receive(now_s)

        if set_by_s == 0.0:
            assert before_s - 1e-5 <= at_s <= after_s + 1e-5
        else:
            assert at_s == now_s


def test_error_frames_tell_that_the_bus_fails_and_frames_that_it_works_again() -> None:
    bus_off = can.Message(arbitration_id=0x040, data=bytes(8), is_error_frame=True, is_extended_id=False)
    with BusPort({"interface": "virtual", "channel": "off"}) as port, can.Bus("off", interface="virtual") as other:
        before = time.monotonic()
        other.send(bus_off)
        assert list(port.receive(time.monotonic())) == []
        assert before <= port.health.failed_since <= time.monotonic()
        other.send(can.Message(arbitration_id=0x123, is_extended_id=True))
        assert list(port.receive(time.monotonic())) == []
        assert (port.health.failed_since, port.health.errors) == (math.inf, 1)


def test_the_lease_socket_is_for_its_owner_and_goes_with_the_process(tmp_path: Path) -> None:
    path = tmp_path / "run" / "lease"
    with LeaseSocket(str(path), ME):
        assert (path.stat().st_mode & 0o777, path.parent.stat().st_mode & 0o777) == (0o600, 0o700)
    assert not path.exists()


@pytest.mark.needs_root("give a socket to another user")
def test_the_lease_socket_of_another_user_can_be_written_by_it(tmp_path: Path) -> None:
    path = tmp_path / "run" / "lease"
    with LeaseSocket(str(path), 12345):
        found = path.stat()  # nobody else can fill its queue
        assert (found.st_mode & 0o777, found.st_uid) == (0o600, 12345)
        assert path.parent.stat().st_mode & 0o777 == 0o755


def test_without_root_no_socket_is_made_for_another_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    me = os.getuid() or 1000
    monkeypatch.setattr(os, "geteuid", lambda: me)
    path = tmp_path / "run" / "lease"
    with pytest.raises(LeaseSocketError, match=f"lease.uid is 12345, this is user {me}: only root"):
        LeaseSocket(str(path), 12345)
    assert not path.parent.exists()


@pytest.mark.needs_root("give a link to another user")
def test_a_folder_that_is_a_link_of_another_user_is_refused(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir(0o700)
    link = tmp_path / "run"
    link.symlink_to(tmp_path / "there")
    with LeaseSocket(str(link / "lease"), ME):
        pass
    os.lchown(link, 12345, -1)
    with pytest.raises(LeaseSocketError, match="is a link of user 12345"):
        LeaseSocket(str(link / "lease"), ME)


def test_a_folder_that_others_may_change_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    folder.chmod(0o777)
    with pytest.raises(LeaseSocketError, match="chmod go-w"):
        LeaseSocket(str(folder / "lease"), ME)
    folder.chmod(0o1777)  # as /tmp: others cannot remove or rename what is there
    with LeaseSocket(str(folder / "lease"), ME):
        pass


@pytest.mark.needs_root("give a folder to another user")
def test_a_folder_of_another_user_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir(0o755)
    os.chown(folder, 12345, -1)
    with pytest.raises(LeaseSocketError, match="belongs to user 12345"):
        LeaseSocket(str(folder / "lease"), ME)


def test_a_socket_that_a_killed_watchdog_left_is_taken_over(tmp_path: Path) -> None:
    path = tmp_path / "lease"
    left = LeaseSocket(str(path), ME)
    left._socket.close()
    with LeaseSocket(str(path), ME):
        assert path.is_socket()


def test_a_socket_in_use_and_a_file_are_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "lease"
    with LeaseSocket(str(path), ME), pytest.raises(LeaseSocketError, match="another watchdog listens"):
        LeaseSocket(str(path), ME)
    path.write_text("something")
    with pytest.raises(LeaseSocketError, match="is not a socket"):
        LeaseSocket(str(path), ME)
    assert path.read_text() == "something"


def test_a_path_that_cannot_be_made_says_so(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(LeaseSocketError, match=r"Check lease\.socket"):
        LeaseSocket(str(tmp_path / "file" / "lease"), ME)


class NoRemoteFrames(can.BusABC):
    """An adapter that has data frames alone."""

    def __init__(self, channel: object = None) -> None:
        super().__init__(channel="none")
        self.sent: list[can.Message] = []

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if msg.is_remote_frame:
            raise NotImplementedError("this adapter sends no remote frames")
        self.sent.append(msg)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        time.sleep(timeout or 0.0)
        return None, False


def test_an_adapter_without_remote_frames_is_reported_once_and_is_no_failed_bus(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    adapter = NoRemoteFrames()
    monkeypatch.setattr("can.Bus", lambda **arguments: adapter)
    plain = config()
    guarded = replace(plain, drives=tuple(replace(drive, guarded=True) for drive in plain.drives))
    with BusPort({}) as bus, LeaseSocket(str(tmp_path / "lease"), ME) as leases, caplog.at_level(logging.ERROR):
        turns = iter(range(200))
        Loop(Watchdog(guarded, time.monotonic()), bus, leases).run(lambda: next(turns, None) is None)
        assert bus.health.failed_since == math.inf
        assert bus.health.send_errors > 2
    told = [record.getMessage() for record in caplog.records if "remote frames" in record.getMessage()]
    assert len(told) == 1
    assert "self_stop.node_guarding: false" in told[0]
    assert "this adapter sends no remote frames" in told[0]
    assert adapter.sent
