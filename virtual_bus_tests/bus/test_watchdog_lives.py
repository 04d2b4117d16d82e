"""A watchdog whose bus is not there, or goes: it opens it again, and begins as a new process does. In a thread."""

from __future__ import annotations

import gc
import logging
import os
import threading
import time
import weakref
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast
from unittest.mock import Mock

import can
import pytest
from can.interfaces import BACKENDS
from can.interfaces.virtual import VirtualBus

from canbase_base.latch_file import LatchFile, LatchKeeper, create_first
from canbase_base.latch_record import Mark
from canbase_base.single_instance import TakenError
from canbase_watchdog import bus_port as watchdog_bus_port
from canbase_watchdog import frames, life, loop, main, realtime
from canbase_watchdog.bus_port import BusPort
from canbase_watchdog.frames import Frame
from canbase_watchdog.lease_socket import LeaseSocket
from canbase_watchdog.loop import BusDeadError, Loop
from canbase_watchdog.observer import Observer
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import Answer, State, Watchdog
from support.flaky_bus import FlakyBus
from support.watchdog_live import LiveRobot
from support.watchdog_story import config

pytestmark = pytest.mark.bus

LONG_S = 20.0
"""A busy computer may take this long for what takes a second."""
PATIENCE_S = 1.0
RETRY_S = 0.3
"""Between two tries to open the bus [s], for the tests' sake."""
QUICK_STOP = Frame(0x501, bytes.fromhex("02 00"))
GIVES_LEAVE = (frames.STATE, frames.WATCHDOG_HEARTBEAT)


class Rig:
    """The lives of a watchdog in a thread, on a bus handle that can be broken; the robot's own one never breaks."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        bus = {"interface": "virtual", "channel": f"lives-{folder}"}
        # Test and watchdog share an interpreter here, on a computer that may be busy: what is late is no news.
        self.config = replace(
            config(),
            bus_arguments=bus,
            lease_socket=str(folder / "run" / "lease"),
            lease_uid=os.getuid(),
            loop_late_s=PATIENCE_S,
            drive_heartbeat_s=PATIENCE_S,
            lease_timeout_s=PATIENCE_S,
            feedback_timeout_s=PATIENCE_S,
        )
        self.record = folder / "state" / self.config.robot / "watchdog.latch"
        create_first(self.record.parent, self.config.robot)
        self.robot = LiveRobot(bus, self.config.lease_socket)
        self.told: list[str] = []
        self.asked: list[int] = []
        self.thread = threading.Thread(target=self._run)
        self.failure: BaseException | None = None
        monkeypatch.setitem(BACKENDS, "virtual", ("support.flaky_bus", "FlakyBus"))
        monkeypatch.setenv("XDG_STATE_HOME", str(folder / "recordings"))
        monkeypatch.setattr(main, "RETRY_S", RETRY_S)
        for module in (main, life):
            monkeypatch.setattr(module, "notify", self.told.append)
        for part in ("lock_memory", "raise_priority"):
            monkeypatch.setattr(realtime, part, lambda: None)

    def _run(self) -> None:
        try:
            main._live_until_signal(self.config, self.record, self.asked)
        except BaseException as error:  # noqa: BLE001 - the test looks at it
            self.failure = error

    def end(self) -> None:
        """As by a signal."""
        self.asked.append(15)
        self.thread.join(timeout=LONG_S)
        assert not self.thread.is_alive()

    def states(self, since_s: float) -> list[bytes]:
        """State frames since then."""
        return [frame.data for at, frame in list(self.robot.heard) if at >= since_s and frame.cob_id == frames.STATE]

    def watches(self, since_s: float) -> None:
        """Wait until it says so in a frame that came after then."""
        self.robot.wait_for(lambda: any(data[0] == State.WATCHING for data in self.states(since_s)), LONG_S)

    def told_once(self, text: str) -> None:
        """Wait until systemd was told."""
        self.robot.wait_for(lambda: any(text in each for each in self.told), LONG_S)


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Rig]:
    FlakyBus.heal()
    it = Rig(tmp_path, monkeypatch)
    with it.robot:
        yield it
        FlakyBus.heal()
        if it.thread.is_alive():
            it.end()
    gc.unfreeze()
    gc.enable()


def reset(rig: Rig, number: int) -> int:
    """Its answer, byte 7 of the state frame."""
    asked_s = time.monotonic()
    with VirtualBus(rig.config.bus_arguments["channel"]) as bus:
        bus.send(can.Message(arbitration_id=frames.RESET_REQUEST, data=bytes([number]) + b"RST", is_extended_id=False))
        rig.robot.wait_for(lambda: any(data[6] == number for data in rig.states(asked_s)), LONG_S)
    return next(data[7] for data in rig.states(asked_s) if data[6] == number)


# no bus ── nothing is sent, systemd is told that the process is ready and lives ── the bus is there ── watching
def test_a_bus_that_is_not_there_at_the_start_is_opened_again(
    rig: Rig, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(main, "RETRY_S", 1.0)
    FlakyBus.broken = True
    with caplog.at_level(logging.INFO):
        rig.thread.start()
        rig.told_once("READY=1\nSTATUS=no bus, trying again: the CAN bus")
        rig.robot.wait_for(lambda: rig.told.count("WATCHDOG=1") >= 8, LONG_S)  # more than one try
        assert [frame for _, frame in rig.robot.heard if frame.cob_id in GIVES_LEAVE] == []
        FlakyBus.broken = False
        rig.watches(0.0)
    problems = [each.message for each in caplog.records if "cannot be opened" in each.message]
    assert len(problems) == 1
    assert problems[0].endswith("(ip -details link show). Trying again every 1 s; meanwhile no drive gets power")
    assert "the bus takes frames again" in caplog.messages


# driving ── its interface is down for seconds, the drives go on ── it is up ── quick stop before anything else, latched
# ── standstill ── reset: done ── watching, and no trip is on disk
def test_a_bus_that_comes_back_while_the_drives_run_is_a_latched_stop_until_a_reset(
    rig: Rig, caplog: pytest.LogCaptureFixture
) -> None:
    rig.thread.start()
    rig.watches(0.0)
    rig.robot.drive_at(300, LONG_S)
    FlakyBus.down = True
    with caplog.at_level(logging.INFO):
        rig.told_once("STATUS=no bus, trying again: no frame could be sent for 1.0 s")
        assert all(drive.speed[0] > 299 for drive in rig.robot.drives)  # nobody has stopped them
        up_s = time.monotonic()
        FlakyBus.down = False
        rig.robot.wait_until_still(LONG_S)
        rig.robot.wait_for(lambda: rig.states(up_s), LONG_S)
    since = [frame for at, frame in list(rig.robot.heard) if at >= up_s]
    assert since[0] == QUICK_STOP
    assert (rig.states(up_s)[0][0], rig.states(up_s)[0][1]) == (State.TRIPPED, TripCause.BUS_FAILED)
    assert any("since before the start: the bus takes no frames" in each for each in caplog.messages)
    number = 1
    while (answer := reset(rig, number)) != Answer.DONE and number < 100:
        number += 1
        time.sleep(0.1)
    assert answer == Answer.DONE
    rig.watches(time.monotonic())
    rig.end()
    assert LatchFile(rig.record.parent, "watchdog", rig.config.robot).open().record.mark is not Mark.LATCHED


# at rest, no power was ever there ── the bus is lost and found ── no trip
def test_without_power_the_loss_of_a_bus_is_no_trip(rig: Rig) -> None:
    rig.thread.start()
    rig.watches(0.0)
    FlakyBus.down = True
    rig.told_once("STATUS=no bus")
    up_s = time.monotonic()
    FlakyBus.down = False
    rig.watches(up_s)
    assert {data[0] for data in rig.states(up_s)} <= {State.STARTING, State.WATCHING}


class Other(threading.Thread):
    """The watchdog of another computer: its state frame, 100 times a second."""

    def __init__(self, channel: str) -> None:
        super().__init__()
        self._bus = VirtualBus(channel)
        self.goes = True

    def run(self) -> None:
        while self.goes:
            self._bus.send(can.Message(arbitration_id=frames.STATE, data=bytes(8), is_extended_id=False))
            time.sleep(0.01)
        self._bus.shutdown()


# cut off ── another computer's watchdog takes over ── it says nothing, until that one has ended
def test_what_was_cut_off_waits_while_another_watchdog_is_there(rig: Rig) -> None:
    rig.thread.start()
    rig.watches(0.0)
    FlakyBus.down = True
    rig.told_once("STATUS=no bus, trying again: no frame")
    other = Other(rig.config.bus_arguments["channel"])
    other.start()
    try:
        rig.robot.first(frames.STATE, time.monotonic(), LONG_S)
        up_s = time.monotonic()
        FlakyBus.down = False
        rig.told_once("STATUS=no bus, trying again: another watchdog is on the bus")
        assert [frame for at, frame in list(rig.robot.heard) if at >= up_s and frame.cob_id == 0x77E] == []
    finally:
        other.goes = False
        other.join()
    rig.robot.first(0x77E, time.monotonic(), LONG_S)


# driving ── a device with node id 126 is connected: its heartbeats could keep drives alive ── trip
def test_on_a_bus_that_gives_no_frame_back_another_77e_is_a_trip(rig: Rig) -> None:
    rig.thread.start()
    rig.watches(0.0)
    rig.robot.drive_at(300, LONG_S)
    with VirtualBus(rig.config.bus_arguments["channel"]) as bus:
        for _ in range(3):
            bus.send(can.Message(arbitration_id=frames.WATCHDOG_HEARTBEAT, data=b"\x05", is_extended_id=False))
            time.sleep(0.2)
        rig.robot.wait_for(lambda: any(data[0] == State.TRIPPED for data in rig.states(0.0)), LONG_S)
    tripped = next(data for data in rig.states(0.0) if data[0] == State.TRIPPED)
    assert tripped[1] == TripCause.FOREIGN_MASTER
    rig.robot.wait_until_still(LONG_S)


def test_another_watchdog_at_the_start_ends_this_one(rig: Rig) -> None:
    other = Other(rig.config.bus_arguments["channel"])
    other.start()
    try:
        rig.robot.first(frames.STATE, 0.0, LONG_S)
        rig.thread.start()
        rig.thread.join(timeout=LONG_S)
    finally:
        other.goes = False
        other.join()
    assert isinstance(rig.failure, TakenError)


def test_a_signal_ends_it_while_it_waits_for_its_bus(rig: Rig) -> None:
    FlakyBus.broken = True
    rig.thread.start()
    rig.told_once("STATUS=no bus")
    rig.end()
    assert rig.failure is None


# a trip that is not on disk: what is there would let the next life begin as if nothing had been
def test_no_life_follows_one_whose_record_could_not_be_written(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.thread.start()
    rig.watches(0.0)
    rig.robot.drive_at(300, LONG_S)

    def refuse(keeper: LatchKeeper, entry: object) -> bool:
        keeper.problem = f"{rig.record} cannot be written: Read-only file system"
        return False

    monkeypatch.setattr(LatchKeeper, "_attempt", refuse)
    FlakyBus.down = True
    rig.thread.join(timeout=LONG_S)
    assert isinstance(rig.failure, life.RecordError)
    assert "is not on disk" in str(rig.failure)
    assert "Read-only file system" in str(rig.failure)


def test_lives_leave_nothing_behind(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """A dead bus for a night is thousands of them."""
    observers: list[weakref.ref[Observer]] = []

    def noted(*arguments: Any, **named: Any) -> Watchdog:
        made = Watchdog(*arguments, **named)
        observers.append(weakref.ref(made._observer))  # a ring of references, which the collector alone breaks
        return made

    def fail() -> None:
        raise can.CanOperationError(
            "network is down"
        )  # a new one each time: an old one holds all that it passed through

    monkeypatch.setattr(FlakyBus, "check", staticmethod(fail))
    monkeypatch.setattr(life, "Watchdog", noted)
    monkeypatch.setattr(loop, "BUS_DEAD_S", 0.02)
    monkeypatch.setattr(main, "RETRY_S", 0.0)
    rig.thread.start()
    rig.robot.wait_for(lambda: len(observers) >= 3, LONG_S)
    before = len(os.listdir("/proc/self/fd"))
    rig.robot.wait_for(lambda: len(observers) >= 12, LONG_S)
    assert len(os.listdir("/proc/self/fd")) <= before + 6  # those of one life: bus, lease socket, record
    assert sum(each() is not None for each in observers) <= 4  # the last ones wait for the collector
    assert threading.active_count() < 12


class Toggled:
    """A relay that counts."""

    def __init__(self) -> None:
        self.times = 0

    def toggle(self) -> None:
        self.times += 1


# the bus was lost ── no toggle ── it takes a frame ── toggled
def test_a_safety_relay_stays_open_until_the_bus_takes_frames(rig: Rig) -> None:
    relay, asked = Toggled(), threading.Event()
    FlakyBus.down = True
    with (
        BusPort(rig.config.bus_arguments, after_loss=True) as bus,
        LeaseSocket(rig.config.lease_socket, os.getuid()) as leases,
    ):

        def turn() -> None:
            Loop(Watchdog(rig.config, time.monotonic()), bus, leases, cast(Any, relay)).run(asked.is_set)

        with pytest.raises(BusDeadError):
            turn()
        assert relay.times == 0
        FlakyBus.down = False
        thread = threading.Thread(target=turn)
        thread.start()
        rig.robot.wait_for(lambda: relay.times > 3, LONG_S)
        asked.set()
        thread.join(timeout=LONG_S)


# bus-off before this life ── the kernel takes frames, no toggle ── the carrier is back, a frame comes ── toggled
def test_a_safety_relay_stays_open_while_the_controller_is_bus_off(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    relay, asked, off = Toggled(), threading.Event(), [True]
    monkeypatch.setattr(watchdog_bus_port, "is_without_carrier", lambda _: off[0])
    alone = {"interface": "virtual", "channel": "off"}
    with BusPort(alone) as bus, LeaseSocket(rig.config.lease_socket, os.getuid()) as leases, VirtualBus("off") as other:
        assert (bus.health.takes_frames, bus.health.works) == (True, False)
        watchdog = Watchdog(rig.config, time.monotonic())
        thread = threading.Thread(target=lambda: Loop(watchdog, bus, leases, cast(Any, relay)).run(asked.is_set))
        thread.start()
        assert other.recv(LONG_S) is not None
        other.send(can.Message(arbitration_id=0x77F, data=b"\5", is_extended_id=False))  # the driver, on this computer
        time.sleep(0.2)
        assert (relay.times, bus.health.takes_frames) == (0, True)
        assert [record.message for record in caplog.records].count(loop.OFF_BEFORE) == 1
        off[0] = False
        other.send(can.Message(arbitration_id=0x701, data=b"\5", is_extended_id=False))
        rig.robot.wait_for(lambda: relay.times > 3, LONG_S)
        asked.set()
        thread.join(timeout=LONG_S)


# a full bus: no frame can be sent, 200 come in ── one tick: the file of the carrier is not read for each of them
@pytest.mark.parametrize("trouble", ["sending", "reading", "passive"])
def test_the_carrier_is_not_read_for_frames_that_come_while_the_controller_is_not_bus_off(
    monkeypatch: pytest.MonkeyPatch, trouble: str
) -> None:
    look = Mock(return_value=False)
    monkeypatch.setattr(watchdog_bus_port, "is_without_carrier", look)
    with BusPort({"interface": "virtual", "channel": "full"}) as bus, VirtualBus("full") as other:
        look.reset_mock()
        if trouble == "sending":
            bus.health.on_send_error(1.0)
        elif trouble == "reading":
            bus.health.on_receive_error(1.0)
        else:
            bus.health.on_error_frame(0x004, b"\x00\x20", 1.0)
        for _ in range(200):
            other.send(can.Message(arbitration_id=0x181, data=bytes(6), is_extended_id=False))
        assert len(list(bus.receive(time.monotonic()))) == 200
        look.assert_not_called()


def test_an_adapter_that_is_gone_may_refuse_to_be_closed(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(bus: FlakyBus) -> None:
        VirtualBus.shutdown(bus)
        raise can.CanOperationError("no such device")

    monkeypatch.setattr(FlakyBus, "shutdown", refuse)
    with BusPort(rig.config.bus_arguments):
        pass
