"""What a restart finds of a latched stop: only a whole, readable CLEAR of this robot and computer is not latched."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_runtime import latch_record
from canbase_runtime.latch_record import SLOT, Defect, Found, Mark, Record, WriteAhead, owner_of, place_of, read, slot
from canbase_watchdog import latch

OWNER = owner_of("driver", "carl", "machine")
LATCHED = Record(Mark.LATCHED, 7, "drive fault", "left_wheel: node 1 is in fault")


def file_after(*records: Record) -> bytes:
    """A new clear file, then these, each in place of the older slot."""
    data = bytearray(latch_record.whole(Record(), OWNER))
    for sequence, record in enumerate(records, 3):
        at = place_of(sequence)
        data[at : at + SLOT] = slot(record, sequence, OWNER)
    return bytes(data)


@pytest.mark.parametrize("mark", Mark)
def test_what_was_written_last_is_found(mark: Mark) -> None:
    record = Record(mark, 65535, "cause", "a wheel turned")
    for before in ((), (Record(Mark.LIVE),), (Record(Mark.LIVE), LATCHED)):
        found = read(file_after(*before, record), OWNER)
        assert found == Found(record, sequence=3 + len(before))
        assert found.latched == (mark is not Mark.CLEAR)


def test_every_changed_byte_counts_as_latched() -> None:
    clear = file_after(Record(Mark.LIVE), Record())
    assert not read(clear, OWNER).latched
    for at in range(len(clear)):
        data = bytearray(clear)
        data[at] ^= 0xFF
        assert read(bytes(data), OWNER).latched, at


@pytest.mark.parametrize("bit", range(8))
def test_every_bit_of_the_head_counts(bit: int) -> None:
    clear = file_after()
    for at in (*range(700), *range(SLOT, SLOT + 700)):
        data = bytearray(clear)
        data[at] ^= 1 << bit
        assert read(bytes(data), OWNER).latched, at


@pytest.mark.parametrize("length", [0, 1, SLOT - 1, SLOT, 2 * SLOT - 1, 2 * SLOT + 1, 100_000])
def test_a_file_of_another_size_counts_as_latched(length: int) -> None:
    data = file_after().ljust(length, b"\0")[:length]
    assert read(data, OWNER).defect is Defect.SIZE
    assert read(data, OWNER).latched


# power off ── the record is half overwritten ── power on
@pytest.mark.parametrize("new", [Record(Mark.LIVE), LATCHED, Record()])
@pytest.mark.parametrize("written", [1, 8, 100, 512, 1024, 4000, SLOT - 1])
def test_a_torn_write_counts_as_latched(new: Record, written: int) -> None:
    before, after = file_after(Record(Mark.LIVE)), slot(new, 4, OWNER)
    at = place_of(4)
    torn = before[:at] + after[:written] + before[at + written : at + SLOT] + before[at + SLOT :]
    assert read(torn, OWNER).latched


@pytest.mark.parametrize(
    ("owner", "defect"),
    [
        (owner_of("driver", "carl", "another machine"), Defect.OWNER),
        (owner_of("driver", "rosa", "machine"), Defect.OWNER),
        (owner_of("velocity", "carl", "machine"), Defect.OWNER),
        (OWNER, Defect.NONE),
    ],
)
def test_a_record_of_another_robot_computer_or_part(owner: bytes, defect: Defect) -> None:
    found = read(file_after(), owner)
    assert (found.defect, found.latched) == (defect, defect is not Defect.NONE)
    assert latch.decode(file_after(), owner).latched == found.latched


def test_a_version_from_the_future(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latch_record, "VERSION", 2)
    future = file_after()
    monkeypatch.undo()
    found = read(future, OWNER)
    assert found.defect is Defect.VERSION
    assert "version 2" in found.sentence
    assert latch.decode(future, OWNER).latched


def test_slots_that_do_not_belong_together() -> None:
    for first, second in ((1, 1), (2, 1), (1, 4), (3, 6), (0, 1)):
        data = slot(Record(), first, OWNER) + slot(Record(), second, OWNER)
        assert read(data, OWNER).latched, (first, second)
        assert latch.decode(data, OWNER).latched, (first, second)


def test_an_unknown_mark() -> None:
    data = slot(replace(Record(), mark=9), 1, OWNER) + slot(Record(), 2, OWNER)  # type: ignore[arg-type]
    assert read(data, OWNER).defect is Defect.GARBAGE
    assert latch.decode(data, OWNER).latched


def test_long_texts_are_cut_in_whole_characters() -> None:
    found = read(file_after(Record(Mark.LATCHED, 0, "ä" * 99, "€" * 999)), OWNER)
    assert found.record.cause == "ä" * 32
    assert found.record.detail == "€" * 170


@given(data=st.binary(max_size=3 * SLOT))
def test_garbage_never_raises_and_is_latched(data: bytes) -> None:
    assert read(data, OWNER).latched
    assert latch.decode(data, OWNER).latched


@given(
    mark=st.sampled_from(Mark), cause=st.integers(0, 255), node=st.integers(0, 127), detail=st.text(max_size=600),
    sequence=st.integers(1, 2**64 - 2), opened=st.booleans(),
)  # fmt: skip
def test_the_watchdogs_layout_is_the_same(
    mark: Mark, cause: int, node: int, detail: str, sequence: int, opened: bool
) -> None:
    owner = owner_of("watchdog", "carl", "machine")
    assert latch.owner("carl", "machine") == owner
    entry = latch.Entry(latch.Mark(mark), cause, node, detail, opened=opened)
    record = Record(mark, cause | node << 8 | opened << 15, "", detail)
    assert latch.page(entry, sequence, owner) == slot(record, sequence, owner)
    pages = sorted((sequence, sequence + 1), key=lambda each: each % 2 == 0)
    data = b"".join(latch.page(entry, each, owner) for each in pages)
    past, found = latch.decode(data, owner), read(data, owner)
    assert (int(past.entry.mark), past.entry.cause, past.entry.node_id) == (int(mark), cause, node)
    assert past.entry.opened is opened
    assert (past.entry.detail, past.sequence) == (found.record.detail, found.sequence)


def test_every_changed_byte_is_a_trip_for_the_watchdog() -> None:
    owner = latch.owner("carl", "machine")
    clear = latch.page(latch.Entry(), 3, owner) + latch.page(latch.Entry(), 2, owner)
    assert not latch.decode(clear, owner).latched
    for at in range(len(clear)):
        data = bytearray(clear)
        data[at] ^= 0xFF
        assert latch.decode(bytes(data), owner).latched, at


def test_on_disk_is_said_of_this_wish_alone() -> None:
    ledger = WriteAhead(Found())
    assert ledger.is_on_disk
    ledger.want(Mark.LIVE)
    first = ledger.wanted
    assert not ledger.is_on_disk
    ledger.on_written(None, "read-only")
    assert (ledger.is_on_disk, ledger.problem) == (False, "read-only")
    ledger.on_written(first, "")
    assert ledger.is_on_disk
    ledger.want(Mark.CLEAR)
    ledger.want(Mark.LIVE)  # before CLEAR was written: the LIVE that is on disk is about to be overwritten by it
    assert not ledger.is_on_disk


def test_the_watchdogs_ledger_likewise() -> None:
    ledger = latch.Ledger(latch.Past())
    ledger.want(latch.Mark.LIVE)
    first = ledger.wanted
    ledger.on_written(first, "")
    assert ledger.is_on_disk
    ledger.want(latch.Mark.CLEAR)
    ledger.want(latch.Mark.LIVE)
    assert not ledger.is_on_disk
    ledger.on_written(None, "full")
    assert (ledger.is_on_disk, ledger.problem) == (False, "full")


@pytest.mark.parametrize("defect", [defect for defect in Defect if defect is not Defect.NONE])
def test_a_record_that_cannot_be_used_is_never_on_disk(defect: Defect) -> None:
    ledger = WriteAhead(Found(defect=defect))
    assert not ledger.is_on_disk
    assert not latch.Ledger(latch.Past(problem=defect.value)).is_on_disk


def test_without_a_keeper_every_wish_is_on_disk() -> None:
    ledger, other = WriteAhead(None), latch.Ledger(None)
    ledger.want(Mark.LIVE)
    other.want(latch.Mark.LIVE)
    assert ledger.is_on_disk
    assert other.is_on_disk
