"""What a restart finds of a latched stop: only a whole, readable CLEAR of this robot and computer is not latched."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_base import latch_record
from canbase_base.latch_record import SLOT, Defect, Found, Mark, Record, WriteAhead, owner_of, place_of, read, slot

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


def test_a_version_from_the_future(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latch_record, "VERSION", 2)
    future = file_after()
    monkeypatch.undo()
    found = read(future, OWNER)
    assert found.defect is Defect.VERSION
    assert "version 2" in found.sentence


def test_slots_that_do_not_belong_together() -> None:
    for first, second in ((1, 1), (2, 1), (1, 4), (3, 6), (0, 1)):
        data = slot(Record(), first, OWNER) + slot(Record(), second, OWNER)
        assert read(data, OWNER).latched, (first, second)


def test_an_unknown_mark() -> None:
    data = slot(replace(Record(), mark=9), 1, OWNER) + slot(Record(), 2, OWNER)  # type: ignore[arg-type]
    assert read(data, OWNER).defect is Defect.GARBAGE


def test_long_texts_are_cut_in_whole_characters() -> None:
    found = read(file_after(Record(Mark.LATCHED, 0, "ä" * 99, "€" * 999)), OWNER)
    assert found.record.cause == "ä" * 32
    assert found.record.detail == "€" * 170


@given(data=st.binary(max_size=3 * SLOT))
def test_garbage_never_raises_and_is_latched(data: bytes) -> None:
    assert read(data, OWNER).latched


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


@pytest.mark.parametrize(
    "change", [{"mark": Mark.LIVE}, {"code": 4}, {"cause": "lease lost"}, {"detail": "no lease for 0.3 s"}], ids=str
)
def test_any_other_content_is_a_new_wish_and_the_same_is_none(change: dict[str, Any]) -> None:
    trip: dict[str, Any] = {"mark": Mark.LATCHED, "code": 3, "cause": "driver silent", "detail": "no heartbeat"}
    ledger = WriteAhead(Found())
    ledger.want(**trip)
    first = ledger.wanted
    ledger.on_written(first, "")
    ledger.want(**trip)
    assert ledger.wanted is first
    assert ledger.is_on_disk
    ledger.want(**trip | change)
    assert ledger.wanted == replace(first, number=2, **change)
    assert not ledger.is_on_disk


@pytest.mark.parametrize("defect", [defect for defect in Defect if defect is not Defect.NONE])
def test_a_record_that_cannot_be_used_is_never_on_disk(defect: Defect) -> None:
    ledger = WriteAhead(Found(defect=defect))
    assert not ledger.is_on_disk


def test_without_a_keeper_every_wish_is_on_disk() -> None:
    ledger = WriteAhead(None)
    ledger.want(Mark.LIVE)
    assert ledger.is_on_disk


@pytest.mark.parametrize(
    ("found", "sentence"),
    [
        (Found(), ""),
        (Found(defect=Defect.MISSING, detail="/x"), "there is no record of stops (/x), so the last stop is taken for"),
        (Found(Record(Mark.LIVE)), "it ended while there was power: killed"),
        (Found(LATCHED), "latched since before the start: left_wheel: node 1 is in fault"),
        (Found(Record(Mark.LATCHED, 7, "drive fault")), "latched since before the start: drive fault"),
        (Found(Record(Mark.LATCHED, 7, "", "latched since before the start: x")), "latched since before the start: x"),
    ],
    ids=str,
)
def test_a_latched_record_says_why_and_a_clear_one_nothing(found: Found, sentence: str) -> None:
    assert found.sentence.startswith(sentence)
    assert bool(found.sentence) is bool(sentence) is found.latched


def test_a_clear_record_without_a_code_says_nothing_and_every_other_one_something() -> None:
    assert Found().says_nothing
    assert not Found(Record(code=1)).says_nothing
    assert not Found(Record(Mark.LIVE)).says_nothing
