"""Node guarding of a simulated drive: answers, the toggle bit, and life guarding (CiA 301, 7.2.8.2.2)."""

from __future__ import annotations

import pytest

from canbase_sim.faults import apply
from canbase_sim.frame import Frame
from canbase_sim.world.bench import Bench
from support.crews import robot_with

GUARD_MS, FACTOR = 60, 4


class Guarded:
    """A technosoft drive without a master, in steps of 1 ms; `sent`: its frames 701h and 081h."""

    def __init__(self, kind: str = "technosoft") -> None:
        self.bench = Bench(robot_with(kind))
        self.now_s = 0.0
        self.sent: list[bytes] = []
        self.run(1.0)
        self.sent.clear()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 1000)):
            self.now_s = round(self.now_s + 0.001, 6)
            frames = self.bench.tick(self.now_s)
            self.sent += [frame.data for frame in frames if frame.cob_id in (0x701, 0x081)]

    def request(self) -> bytes | None:
        """What a remote frame gets."""
        self.sent.clear()
        self.bench.on_frame(Frame(0x701, remote=True), self.now_s)
        self.run(0.001)
        return self.sent[0] if self.sent else None

    def write(self, index: int, value: int, size: int) -> None:
        code = {1: 0x2F, 2: 0x2B}[size]
        head = bytes([code]) + index.to_bytes(2, "little") + b"\0"
        self.bench.on_frame(Frame(0x601, head + value.to_bytes(4, "little")), self.now_s)
        self.run(0.01)
        self.sent.clear()

    def be_guarded(self) -> None:
        self.write(0x100C, GUARD_MS, 2)
        self.write(0x100D, FACTOR, 1)

    @property
    def emergencies(self) -> list[bytes]:
        return [data[:2] for data in self.sent if len(data) == 8]


def test_answers_alternate_their_toggle_bit_and_an_nmt_reset_begins_with_0() -> None:
    drive = Guarded()
    assert [drive.request() for _ in range(3)] == [b"\x7f", b"\xff", b"\x7f"]
    drive.bench.on_frame(Frame(0x000, b"\x01\x01"), drive.now_s)  # NMT start
    assert [drive.request() for _ in range(2)] == [b"\x85", b"\x05"]
    drive.bench.on_frame(Frame(0x000, b"\x82\x01"), drive.now_s)  # reset communication
    drive.run(1.0)
    assert drive.request() == b"\x7f"


# 60 ms × 4: request ── 0.239 s nothing ── 0.242 s life guarding event
def test_a_drive_that_was_guarded_misses_its_guard_after_its_life_time() -> None:
    drive = Guarded()
    drive.be_guarded()
    drive.run(1.0)
    assert not drive.emergencies  # it begins with the first request
    drive.request()
    drive.run(0.237)
    assert not drive.emergencies
    drive.run(0.005)
    assert drive.emergencies == [b"\x30\x81"]
    assert drive.bench.lost_heartbeats() == [(1, 0)]
    drive.run(1.0)
    assert len(drive.emergencies) == 1
    drive.request()
    assert drive.emergencies == [b"\x00\x00"]  # it is guarded again


def test_requests_in_time_keep_it_alive() -> None:
    drive = Guarded()
    drive.be_guarded()
    for _ in range(20):
        assert drive.request() is not None
        drive.run(0.2)
    assert not drive.emergencies


@pytest.mark.parametrize(("index", "size"), [(0x100C, 2), (0x100D, 1)])
def test_without_guard_time_or_factor_it_answers_and_monitors_nothing(index: int, size: int) -> None:
    drive = Guarded()
    drive.be_guarded()
    drive.write(index, 0, size)
    assert drive.request() is not None
    drive.run(2.0)
    assert not drive.emergencies


def test_a_node_that_produces_heartbeats_answers_no_request_and_monitors_no_guard() -> None:
    drive = Guarded()
    drive.be_guarded()
    drive.request()
    drive.write(0x1017, 500, 2)
    drive.run(0.1)
    assert drive.request() is None
    drive.run(0.4)
    assert not drive.emergencies


@pytest.mark.parametrize("kind", ["epos4", "elmo_gold", "zlac8015d"])
def test_a_kind_without_100ch_answers_nothing(kind: str) -> None:
    assert Guarded(kind).request() is None


def test_a_stuck_toggle_bit_and_a_line_without_remote_frames_are_faults() -> None:
    drive = Guarded()
    apply(drive.bench.nodes, 1, "guard_stuck", drive.now_s, {})
    assert [drive.request() for _ in range(3)] == [b"\x7f"] * 3
    apply(drive.bench.nodes, 1, "no_requests", drive.now_s, {})
    assert drive.request() is None
    apply(drive.bench.nodes, 1, "heal", drive.now_s, {})
    assert [drive.request() for _ in range(2)] == [b"\x7f", b"\xff"]


def test_a_drive_that_hears_nothing_or_starts_answers_nothing() -> None:
    drive = Guarded()
    drive.bench.nodes[1].line.deaf = True
    assert drive.request() is None
    drive.bench.nodes[1].line.deaf = False
    drive.bench.nodes[1].power_cycle(drive.now_s)
    assert drive.request() is None
