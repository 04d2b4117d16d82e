"""The files of latch records, and the thread that writes them."""

from __future__ import annotations

import errno
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canbase_base import latch_file
from canbase_base.latch_file import LatchFile, LatchKeeper, create_first
from canbase_base.latch_folder import latch_folder
from canbase_base.latch_record import SIZE, Mark, Record

PARTS = ("driver", "watchdog")


class Kept:
    """The record of one part, and who keeps it."""

    def __init__(self, part: str, folder: Path, robot: str = "carl") -> None:
        file = LatchFile(folder, part, robot)
        self.path, self.keeper = file.path, LatchKeeper(file)
        self.latched, self.mark = self.keeper.found.latched, self.keeper.found.record.mark

    def write(self, mark: int) -> bool:
        """What it wants is on disk within a second, or it has said why not."""
        self.keeper.problem = ""
        wanted = Record(Mark(mark), number=mark + 1)
        if not self.keeper.is_alive():
            self.keeper.start()
        self.keeper.want(wanted)
        self.keeper.want(wanted)
        end = time.monotonic() + 1.0
        while self.keeper.written is not wanted and not self.keeper.problem and time.monotonic() < end:
            time.sleep(0.001)
        return self.keeper.written is wanted

    def finish(self) -> None:
        assert self.keeper.finish(1.0)
        assert not self.keeper.is_alive()


@pytest.fixture(params=PARTS)
def part(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "canbase" / "carl"
    assert create_first(folder, "carl")
    return folder


def test_a_robot_that_never_had_a_folder_begins_clear_and_only_then(tmp_path: Path, part: str) -> None:
    folder = tmp_path / "a" / "carl"
    assert create_first(folder, "carl")
    assert not Kept(part, folder).latched
    assert Kept(part, folder, robot="rosa").latched
    (folder / f"{part}.latch").unlink()
    assert not create_first(folder, "carl")
    assert Kept(part, folder).latched
    assert list(folder.parent.iterdir()) == [folder]


@pytest.mark.parametrize("mark", [0, 1, 2])
def test_what_is_written_is_found_by_the_next(folder: Path, part: str, mark: int) -> None:
    for _ in range(3):
        kept = Kept(part, folder)
        assert kept.write(1)
        assert kept.write(mark) or mark == 1
        kept.finish()
        assert Kept(part, folder).mark == mark
    assert kept.path.stat().st_size == SIZE


def test_a_missing_file_counts_as_latched_and_is_made_by_the_next_write(folder: Path, part: str) -> None:
    path = folder / f"{part}.latch"
    path.unlink()
    kept = Kept(part, folder)
    assert kept.latched
    assert kept.write(0)
    kept.finish()
    assert not Kept(part, folder).latched
    assert sorted(each.name for each in folder.iterdir()) == ["driver.latch", "velocity.latch", "watchdog.latch"]


def _fifo(path: Path) -> None:
    os.mkfifo(path)


def _link(path: Path) -> None:
    path.with_name("elsewhere").write_bytes(b"x")
    path.symlink_to("elsewhere")


def _huge(path: Path) -> None:
    path.touch(0o600)
    os.truncate(path, 1 << 40)


def _empty(path: Path) -> None:
    path.touch(0o600)


def _garbage(path: Path) -> None:
    path.write_bytes(os.urandom(SIZE))


def _others_may_write(path: Path) -> None:
    path.touch(0o600)
    path.chmod(0o622)


@pytest.mark.parametrize("make", [_fifo, _link, _huge, _empty, _garbage, _others_may_write])
def test_what_is_no_record_counts_as_latched_and_is_replaced(
    folder: Path, part: str, make: Callable[[Path], None]
) -> None:
    path = folder / f"{part}.latch"
    path.unlink()
    make(path)
    kept = Kept(part, folder)
    assert kept.latched
    assert kept.write(0)
    kept.finish()
    assert not Kept(part, folder).latched


@pytest.mark.needs_root("give a file to another user")
@pytest.mark.parametrize("name", ["", "file"])
def test_a_record_of_another_user_counts_as_latched(folder: Path, part: str, name: str) -> None:
    os.chown(folder / f"{part}.latch" if name else folder, 12345, -1)
    assert Kept(part, folder).latched


def test_a_folder_that_others_may_write_to_counts_as_latched(folder: Path, part: str) -> None:
    folder.chmod(0o777)
    assert Kept(part, folder).latched


def test_a_read_only_disk_tells_what_was_and_says_why_nothing_is_written(
    folder: Path, part: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    really = os.open

    def read_only(path: Any, flags: int, *arguments: Any, **more: Any) -> int:
        if flags & (os.O_RDWR | os.O_WRONLY):
            raise OSError(errno.EROFS, "Read-only file system")
        return really(path, flags, *arguments, **more)

    monkeypatch.setattr(os, "open", read_only)
    kept = Kept(part, folder)
    assert not kept.latched
    assert not kept.write(1)
    assert "Read-only file system" in kept.keeper.problem
    monkeypatch.undo()
    assert kept.write(2)  # it is writable again
    assert kept.keeper.problem == ""
    kept.finish()
    assert Kept(part, folder).mark == 2


def test_a_full_disk_loses_nothing_of_a_file_that_is_there(
    folder: Path, part: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is overwritten in place: no new blocks, no new name, and on disk before it is said to be."""
    kept = Kept(part, folder)
    number, calls = kept.path.stat().st_ino, []
    really = os.fsync

    def fsync(descriptor: int) -> None:
        calls.append(kept.keeper.written)
        really(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    assert kept.write(1)
    assert calls == [None]
    kept.finish()
    assert kept.path.stat().st_ino == number


def test_a_write_that_fails_is_tried_again(folder: Path, part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    left = [OSError(errno.ENOSPC, "No space left on device")]
    really = os.pwrite

    def pwrite(*arguments: Any) -> int:
        if left:
            raise left.pop()
        return really(*arguments)

    monkeypatch.setattr(latch_file, "RETRY_S", 0.01)
    monkeypatch.setattr(os, "pwrite", pwrite)
    kept = Kept(part, folder)
    kept.write(2)
    end = time.monotonic() + 2.0
    while kept.keeper.written is None and time.monotonic() < end:
        time.sleep(0.001)
    assert kept.keeper.problem == ""
    kept.finish()
    assert Kept(part, folder).mark == 2


@pytest.mark.parametrize(
    ("environment", "folder"),
    [
        ({}, "/home/u/.local/state/canbase/carl"),
        ({"XDG_STATE_HOME": "/state"}, "/state/canbase/carl"),
        ({"STATE_DIRECTORY": "/var/lib/canbase", "XDG_STATE_HOME": "/state"}, "/var/lib/canbase/carl"),
        ({"STATE_DIRECTORY": "/var/lib/canbase:/var/lib/canbase/front"}, "/var/lib/canbase/front"),
    ],
)
def test_where_the_records_are(environment: dict[str, str], folder: str) -> None:
    assert latch_folder(environment, Path("/home/u"), "carl") == Path(folder)


def test_the_thread_has_a_small_stack_as_the_watchdogs_memory_is_locked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """mlockall makes all of a stack resident. Threads that start later have theirs as before."""
    sizes, begin, usual = [], threading.Thread.start, threading.stack_size()

    def start(thread: threading.Thread) -> None:
        sizes.append(threading.stack_size())
        begin(thread)

    monkeypatch.setattr(threading.Thread, "start", start)
    keeper = LatchKeeper(LatchFile(tmp_path, "watchdog", "carl"))
    keeper.start()
    assert sizes == [512 * 1024]
    assert threading.stack_size() == usual
    keeper.finish(5.0)
