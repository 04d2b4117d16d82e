"""Recordings on disk: each format, and everything that can be wrong with a file."""

from __future__ import annotations

import contextlib
import itertools
import random
import tempfile
from collections.abc import Iterable
from pathlib import Path

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_driver.runtime.black_box import Recording, asc_lines
from canbase_recording.entry import Entry, FrameKind, Note, RecordedFrame
from canbase_recording.recording_file import NoRecordingError, RecordingFile

FRAMES = [(0.01 * i, 0x181 + i % 2, bytes([i % 256, 1, 2]), i % 3 == 0) for i in range(300)]
"""Time, COB-ID, data, sent."""


def read(path: Path, channel: str | None = None) -> tuple[list[Entry], RecordingFile]:
    with RecordingFile(path, channel) as recording:
        return list(recording.entries()), recording


def messages(start_s: float = 1_700_000_000.0) -> Iterable[can.Message]:
    for at_s, cob_id, data, sent in FRAMES:
        yield can.Message(start_s + at_s, cob_id, is_extended_id=False, data=data, is_rx=not sent, channel="can0")


def black_box(path: Path) -> Path:
    frames = tuple((at_s, cob_id, data, not sent) for at_s, cob_id, data, sent in FRAMES)
    notes = ((0.505, "cmd_vel 0.3000 m/s 0.0000 rad/s"), (1.0, "motor_driver LATCHED: drive fault (node 1)"))
    title = "stop by motor_driver: drive fault (node 1)"
    path.write_text("".join(asc_lines(Recording(frames, notes, 1_700_000_000.0), title)), encoding="utf-8")
    return path


def test_a_black_box_gives_its_frames_and_notes_in_the_order_of_time(tmp_path: Path) -> None:
    entries, recording = read(black_box(tmp_path / "stop.asc"))
    frames = [entry for entry in entries if isinstance(entry, RecordedFrame)]
    assert [(round(f.at_s, 6), f.cob_id, f.data, f.sent) for f in frames] == [
        (round(a, 6), b, c, d) for a, b, c, d in FRAMES
    ]
    assert [entry for entry in entries if isinstance(entry, Note)] == [
        Note(0.0, "stop by motor_driver: drive fault (node 1)"),
        Note(0.505, "cmd_vel 0.3000 m/s 0.0000 rad/s"),
        Note(1.0, "motor_driver LATCHED: drive fault (node 1)"),
    ]
    times = [entry.at_s for entry in entries]
    assert times == sorted(times)
    assert (recording.format, recording.problems.sentences) == ("ASC", [])
    assert recording.began_s == pytest.approx(1_700_000_000.0, abs=0.01)


@pytest.mark.parametrize(("suffix", "form"), [(".asc", "ASC"), (".log", "candump"), (".blf", "BLF"), (".trc", "TRC")])
def test_what_python_can_writes_is_read(tmp_path: Path, suffix: str, form: str) -> None:
    path = tmp_path / f"bus{suffix}"
    with can.Logger(path) as logger:
        for message in messages():
            logger.on_message_received(message)
    entries, recording = read(path)
    assert recording.format == form
    assert [(e.cob_id, e.data) for e in entries if isinstance(e, RecordedFrame)] == [(b, c) for _, b, c, _ in FRAMES]
    assert entries[-1].at_s - entries[0].at_s == pytest.approx(2.99, abs=0.001)
    assert recording.problems.sentences == []


def test_a_trc_file_with_the_date_of_its_start_begins_at_zero(tmp_path: Path) -> None:
    path = tmp_path / "bus.trc"
    path.write_text(
        ";$FILEVERSION=2.1\n;$STARTTIME=44654.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
        "      1      1000.000 DT 1      0181 Rx -  2    37 02\n"
        "      2      1250.000 DT 1      0080 Rx -  0    \n"
    )
    entries, recording = read(path)
    assert [entry.at_s for entry in entries] == pytest.approx([0.0, 0.25])
    assert recording.began_s == pytest.approx((44654.5 - 25569.0) * 86_400.0 + 1.0)


def test_a_trc_file_of_another_manufacturer_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bus.trc"
    path.write_text("ASCII Trace IXXAT Automation GmbH  V1.1\n(00:00:01.500) 181 Std 37 02\n")
    with pytest.raises(NoRecordingError, match="it begins with 'ASCII Trace"):
        RecordingFile(path)


def test_what_candump_prints_on_a_screen_is_read_too(tmp_path: Path) -> None:
    path = tmp_path / "screen.txt"
    path.write_text(
        " (1700000000.000000)  can0  181   [6]  37 02 05 00 00 00\n"
        " (1700000000.010000)  can0  701   [0]  remote request\n"
        " (1700000000.020000)  can0  TX - -  201   [2]  0F 00\n (1700000000.030000)  can0  080   [0] \n rubbish\n"
    )
    entries, recording = read(path)
    assert [(e.cob_id, e.kind, e.sent) for e in entries if isinstance(e, RecordedFrame)] == [
        (0x181, FrameKind.DATA, False), (0x701, FrameKind.REMOTE, False), (0x201, FrameKind.DATA, True),
        (0x080, FrameKind.DATA, False),
    ]  # fmt: skip
    assert recording.problems.broken == 1


@pytest.mark.parametrize(
    "junk", ["(12.5) can0", "(x) can0 181#00", "(1700000000.5) can0 181#0G", "\x00\x01", "#" * 40_000]
)
def test_broken_lines_are_counted_and_the_rest_is_read(tmp_path: Path, junk: str) -> None:
    lines = [f"({1_700_000_000.0 + at_s:.6f}) can0 {cob_id:03X}#{data.hex()}" for at_s, cob_id, data, _ in FRAMES]
    path = tmp_path / "bus.log"
    path.write_text("\n".join([*lines[:100], junk, *lines[100:200], junk, *lines[200:]]))
    entries, recording = read(path)
    assert len(entries) == len(FRAMES)
    assert recording.problems.broken == 2
    assert "2 lines or objects could not be read" in recording.problems.sentences[0]


@pytest.mark.parametrize("line", ["0.5 1 181 Rx d 8 01 ZZ", "0.5 1 Rx d", "0.5 1 181 Rx d x 01", "nonsense"])
def test_broken_lines_of_an_asc_file_too(tmp_path: Path, line: str) -> None:
    path = black_box(tmp_path / "stop.asc")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:150], line, *lines[150:]]))
    entries, recording = read(path)
    assert sum(isinstance(entry, RecordedFrame) for entry in entries) == len(FRAMES)
    assert recording.problems.broken == 1


@pytest.mark.parametrize("suffix", [".asc", ".log", ".blf"])
@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_a_file_that_ends_early_is_read_up_to_there(tmp_path: Path, suffix: str, share: float) -> None:
    path = tmp_path / f"bus{suffix}"
    with can.Logger(path) as logger:
        for _, message in itertools.product(range(40), messages()):
            logger.on_message_received(message)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    entries, recording = read(path)
    assert 0 <= len(entries) < 40 * len(FRAMES)
    if suffix == ".blf":
        assert recording.problems.truncated
    else:
        assert len(entries) > 0.8 * share * 40 * len(FRAMES)


def test_a_clock_that_steps_back_is_said_and_time_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    times = [100.0, 100.1, 40.0, 40.1, 40.05, 40.2]
    path.write_text("".join(f"({1_700_000_000.0 + at_s:.6f}) can0 080#\n" for at_s in times))
    entries, recording = read(path)
    assert [entry.at_s for entry in entries] == pytest.approx([0.0, 0.1, 0.1, 0.2, 0.2, 0.3])
    assert recording.problems.backward == 1
    assert "stepped backward 1 times, by 60.100 s" in recording.problems.sentences[0]


def test_one_channel_is_read_and_the_others_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    path.write_text("".join(f"({at}.0) can{at % 2} {at:03X}#00\n" for at in range(1, 7)))
    entries, recording = read(path)
    assert [e.cob_id for e in entries if isinstance(e, RecordedFrame)] == [1, 3, 5]
    assert "3 of can0" in recording.problems.sentences[0]
    other, _ = read(path, "can0")
    assert [e.cob_id for e in other if isinstance(e, RecordedFrame)] == [2, 4, 6]


@pytest.mark.parametrize("content", [b"", b"hello\nworld\n", b"\x89PNG\r\n", b"name: robot\n", b"\xff" * 100])
def test_a_file_that_is_no_recording_is_refused_with_its_begin(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "file"
    path.write_bytes(content)
    with pytest.raises(NoRecordingError, match=r"file: no recording that is known here"):
        RecordingFile(path)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(NoRecordingError, match="cannot be read: No such file"):
        RecordingFile(tmp_path / "nothing.asc")


HEADS = (
    b"",
    b"LOGG",
    b"\x89MCAP0\r\n",
    b"base hex  timestamps absolute\n",
    b"(1.0) can0 181#00\n",
    b";$FILEVERSION=1.1\n",
)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(HEADS), st.binary(max_size=600))
def test_random_bytes_never_raise(head: bytes, rest: bytes) -> None:
    with tempfile.NamedTemporaryFile() as file:
        file.write(head + rest)
        file.flush()
        try:
            with RecordingFile(Path(file.name)) as recording:
                entries = list(recording.entries())
        except NoRecordingError:
            return
    times = [entry.at_s for entry in entries]
    assert times == sorted(times)


@pytest.mark.parametrize("suffix", [".asc", ".log", ".blf"])
@pytest.mark.parametrize("seed", range(20))
def test_bytes_that_flipped_never_raise(tmp_path: Path, suffix: str, seed: int) -> None:
    path = tmp_path / f"bus{suffix}"
    with can.Logger(path) as logger:
        for message in messages():
            logger.on_message_received(message)
    data, draw = bytearray(path.read_bytes()), random.Random(seed)
    for _ in range(30):
        data[draw.randrange(200 if suffix == ".blf" else 0, len(data))] = draw.randrange(256)
    path.write_bytes(data)
    with contextlib.suppress(NoRecordingError):
        entries, _ = read(path)
        assert all(entry.at_s >= 0.0 for entry in entries)
