"""Recordings of strangers: whatever is in a file, a tool ends soon, in little memory, and with a sentence."""

from __future__ import annotations

import contextlib
import json
import random
import struct
import zlib
from pathlib import Path
from typing import Any

import can
import pytest
import zstandard

from canbase_recording import foreign_reader
from canbase_recording.entry import RecordedFrame
from canbase_recording.explain_file import explain_file
from canbase_recording.explain_json import as_json
from canbase_recording.explain_text import text_lines
from canbase_recording.mcap_export import export
from canbase_recording.recording_file import NoRecordingError, RecordingFile

SOURCE = Path(__file__).parent / "data" / "cable_of_left_wheel_cut.asc"
FRAMES = 300
MUTANTS = {".asc": 40, ".log": 40, ".trc": 40, ".blf": 8, ".mcap": 8}
"""Of each format; a binary one takes a process each."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A recording in each format."""
    folder = tmp_path_factory.mktemp("whole")
    with RecordingFile(SOURCE) as recording:
        frames = [entry for entry in recording.entries() if isinstance(entry, RecordedFrame)][:FRAMES]
    for suffix in MUTANTS:
        if suffix != ".mcap":
            with can.Logger(folder / f"whole{suffix}") as logger:
                for frame in frames:
                    logger.on_message_received(message(frame, 0 if suffix == ".blf" else "can0"))
    export(folder / "whole.log", folder / "whole.mcap", None, None)
    return {suffix: (folder / f"whole{suffix}").read_bytes() for suffix in MUTANTS}


def message(frame: RecordedFrame, channel: Any) -> can.Message:
    at_s = 1.7e9 + frame.at_s
    return can.Message(at_s, frame.cob_id, is_extended_id=False, data=frame.data, is_rx=not frame.sent, channel=channel)


def mutant(whole: bytes, seed: int) -> bytes:
    draw, data = random.Random(seed), bytearray(whole)
    for _ in range(draw.choice((1, 3, 20))):
        at = draw.randrange(len(data))
        change = draw.randrange(4)
        if change == 0:
            data[at] = draw.randrange(256)
        elif change == 1:
            del data[at : at + draw.randrange(1, 40)]
        elif change == 2:
            data[at:at] = draw.randbytes(draw.randrange(1, 9))
        else:
            data[at : at + 8] = draw.choice((b"99999999", b"\xff" * 8, bytes(8), b"-1e309  ", b"((((####"))
    return bytes(data)


def use(path: Path) -> None:
    """As the tools do: explained in both forms, and exported."""
    with contextlib.suppress(NoRecordingError):
        facts, explanation = explain_file(path)
        assert list(text_lines(facts, explanation))
        assert json.dumps(as_json(facts, explanation))
        target = path.with_suffix(".out")
        target.unlink(missing_ok=True)
        export(path, target, None, None)


@pytest.mark.parametrize("suffix", MUTANTS)
def test_no_mutant_of_a_recording_raises(tmp_path: Path, whole: dict[str, bytes], suffix: str) -> None:
    path = tmp_path / f"mutant{suffix}"
    for seed in range(MUTANTS[suffix]):
        path.write_bytes(mutant(whole[suffix], seed))
        use(path)


@pytest.mark.parametrize(
    "line",
    ["(99999999999.0) can0 181#00", "(1e308) can0 181#00", "(2147483646.999999999) can0 181#00"],
)
def test_a_time_that_no_ros_message_holds_is_none(tmp_path: Path, line: str) -> None:
    path = tmp_path / "late.log"
    path.write_text(f"(1700000000.0) can0 181#00\n{line}\n")
    use(path)


def test_an_identifier_of_more_than_29_bits_is_left_out_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "wide.asc"
    path.write_text("base hex  timestamps absolute\ninternal events logged\n 0.1 1  FFFFFFFFFFx  Rx   d 1 00\n")
    with RecordingFile(path) as recording:
        assert list(recording.entries()) == []
        assert recording.problems.broken == 1


def blf(container: bytes, compressed: bytes | None = None) -> bytes:
    """A file of one container, which is compressed."""
    head = struct.Struct("<4sLBBBBBBBBQQLL8H8H72x").pack(b"LOGG", 144, 0, 0, 0, 0, 2, 6, 8, 1, 0, 0, 0, 0, *16 * [0])
    packed = zlib.compress(container) if compressed is None else compressed
    body = struct.pack("<H6xL4x", 2, len(container)) + packed
    return head + struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(body), 10) + body


def problem(path: Path) -> str:
    with RecordingFile(path) as recording:
        list(recording.entries())
        return recording.problems.truncated


def test_an_object_without_a_length_ends_when_its_time_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(foreign_reader, "CPU_S", 1)
    path = tmp_path / "endless.blf"
    path.write_bytes(blf(struct.pack("<4sHHLL", b"LOBJ", 16, 1, 0, 96) + bytes(64)))
    assert problem(path) == "the library that reads BLF took too long"


def packed(compressor: Any) -> bytes:
    """More zeros than a reader may hold."""
    pieces = [compressor.compress(bytes(1_000_000)) for _ in range(foreign_reader.MEMORY_BYTES // 1_000_000)]
    return b"".join([*pieces, compressor.flush()])


def mcap_chunk(records: bytes) -> bytes:
    """A file that ends behind one chunk."""
    body = struct.pack("<QQQI", 0, 0, foreign_reader.MEMORY_BYTES, 0) + struct.pack("<I", 4) + b"zstd"
    body += struct.pack("<Q", len(records)) + records
    return b"\x89MCAP0\r\n" + struct.pack("<BQ", 1, 8) + bytes(8) + struct.pack("<BQ", 6, len(body)) + body


def test_a_small_file_that_unpacks_to_gigabytes_ends_for_want_of_memory(tmp_path: Path) -> None:
    size = foreign_reader.MEMORY_BYTES
    bombs = {
        "BLF": blf(b"", packed(zlib.compressobj())),
        "MCAP": mcap_chunk(packed(zstandard.ZstdCompressor().compressobj(size=size))),
    }
    for form, content in bombs.items():
        path = tmp_path / form
        path.write_bytes(content)
        assert len(content) < size / 500
        assert "MemoryError" in problem(path)


def test_a_reader_that_dies_or_says_nothing_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "short.blf"
    path.write_bytes(blf(b""))
    monkeypatch.setattr(foreign_reader, "module_command", lambda *words: ["false"])
    assert problem(path) == "the library that reads BLF has died (exit code 1)"
    monkeypatch.setattr(foreign_reader, "module_command", lambda *words: ["sleep", "60"])
    monkeypatch.setattr(foreign_reader, "SILENT_S", 0.01)
    assert problem(path).startswith("the library that reads BLF found no frame")
