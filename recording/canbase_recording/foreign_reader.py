"""Binary recordings, by the libraries of their formats, in a process of their own: its memory and its time are bounded.

A file of a stranger may keep such a library busy for ever, or make it unpack gigabytes. `python -m` with a format reads
stdin and writes a line of JSON for each frame or note; `messages` runs it and reads those lines.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import IO, TYPE_CHECKING, Any, BinaryIO, Final

import can

from canbase_recording.entry import Note
from canbase_runtime.own_modules import module_command

if TYPE_CHECKING:
    from canbase_recording.recording_file import Problems

MEMORY_BYTES: Final = 512_000_000
"""Address space of the process."""
CPU_S: Final = 10
"""Processor time of the process, and as much again for each MB of the file [s]."""
SILENT_S: Final = 30.0
"""Without a frame for so long it is killed [s]."""
LINE_BYTES: Final = 1_000_000
_CHUNK: Final = 1 << 16
_POSITION_EVERY: Final = 5_000
"""Messages."""


def messages(form: str, file: BinaryIO, size: int, problems: Problems) -> Iterator[can.Message | Note | int]:
    """In the order of the file; numbers are how many of its bytes have been read. `problems`: what ends it early."""
    cpu_s = CPU_S + CPU_S * size // 1_000_000
    process = subprocess.Popen(
        module_command("canbase_recording.foreign_reader", form, str(size), str(cpu_s)),
        stdin=file,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    assert process.stdout is not None
    try:
        for line in _lines(process.stdout):
            said = json.loads(line)
            if isinstance(said, dict):
                problems.truncated, problems.broken = said["ended"], said["broken"]
                return
            yield _message(said)
        problems.truncated = f"the library that reads {form} {_death(process)}"
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def _lines(stream: IO[bytes]) -> Iterator[bytes]:
    rest = b""
    while select.select([stream], [], [], SILENT_S)[0] and (data := os.read(stream.fileno(), _CHUNK)):
        *lines, rest = (rest + data).split(b"\n")
        yield from lines
        if len(rest) > LINE_BYTES:
            return


def _death(process: subprocess.Popen[bytes]) -> str:
    with contextlib.suppress(subprocess.TimeoutExpired):
        if process.wait(1.0) == -signal.SIGXCPU:
            return "took too long"
        return f"has died (exit code {process.returncode})"
    return f"found no frame for {SILENT_S:.0f} s"


def _message(said: Any) -> can.Message | Note | int:
    if isinstance(said, int):
        return said
    if len(said) == 2:
        return Note(*said)
    at_s, cob_id, data, channel, sent, remote, extended, error = said
    return can.Message(
        timestamp=at_s, arbitration_id=cob_id, data=bytes.fromhex(data), channel=channel, is_rx=not sent,
        is_remote_frame=remote, is_extended_id=extended, is_error_frame=error, is_fd=len(data) > 16,
    )  # fmt: skip


def _main(form: str, size: str, cpu_s: str) -> None:
    """The process."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (int(cpu_s), int(cpu_s) + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    ended, broken = "", 0
    try:
        for number, message in enumerate(_READERS[form](sys.stdin.buffer, int(size))):
            if message is None:
                broken += 1
            else:
                sys.stdout.write(f"{json.dumps(_said(message))}\n")
            if number % _POSITION_EVERY == 0:
                sys.stdout.write(f"{sys.stdin.buffer.tell()}\n")
    except Exception as error:  # noqa: BLE001 - of a library that reads a stranger's file: whatever it raises ends it
        text = " ".join(f"{type(error).__name__} {error}".split())[:200].strip()
        ended = f"at {sys.stdin.buffer.tell()} of {size} bytes ({text})"
    sys.stdout.write(f"{json.dumps({'ended': ended, 'broken': broken})}\n")
    sys.stdout.flush()


def _said(message: can.Message | Note) -> list[Any]:
    if isinstance(message, Note):
        return [message.at_s, message.text]
    channel = None if message.channel is None else str(message.channel)
    return [
        message.timestamp, message.arbitration_id, message.data.hex(), channel, not message.is_rx,
        message.is_remote_frame, message.is_extended_id, message.is_error_frame,
    ]  # fmt: skip


def _blf(file: BinaryIO, size: int) -> Iterator[can.Message]:
    reader = can.BLFReader(file)
    yield from reader
    if reader.file_size > size:
        raise EOFError(f"the file had {reader.file_size} bytes once")


def _mcap(file: BinaryIO, _size: int) -> Iterator[can.Message | Note | None]:
    from canbase_recording.mcap_import import messages as of_mcap

    return of_mcap(file)


_READERS: Final[dict[str, Callable[[BinaryIO, int], Iterator[can.Message | Note | None]]]] = {
    "BLF": _blf,
    "MCAP": _mcap,
}

if __name__ == "__main__":
    _main(*sys.argv[1:])
