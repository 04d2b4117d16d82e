"""`python -m campaign.refusals`: docs/refusals.md, what the boot does and says for each object that a drive refuses.

Every sentence is the boot's own: a drive of a few lines refuses one object with one abort code, and is booted.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from canbase_driver.cia301.sdo_client import abort_text
from support.fake_drive import Bench, FakeDrive, Key, robot, u8, u16, u32

PAGE = Path(__file__).parents[2] / "docs" / "refusals.md"
CLASSES = {
    "does not exist": 0x0602_0000,
    "is read-only": 0x0601_0002,
    "takes no such value": 0x0609_0030,
    "has another width": 0x0607_0010,
    "cannot be mapped": 0x0604_0041,
    "not in this state": 0x0800_0022,
    "general error": 0x0800_0000,
}
"""Classes of SDO abort codes (CiA 301), each with the code that stands for it."""
ALL = tuple(CLASSES)
WRITES = tuple(name for name in CLASSES if name not in ("does not exist", "cannot be mapped"))
MAPS = tuple(name for name in CLASSES if name not in ("takes no such value", "does not exist"))
CHANNEL = tuple(name for name in CLASSES if name not in ("does not exist", "cannot be mapped", "has another width"))
READS = ("does not exist", "general error")
BEGIN, END = "<!-- make refusals: begin -->", "<!-- make refusals: end -->"
WRONG_STATE = (
    "The state of the drive forbids it, and the boot is tried again each second. If this goes on, switch the drive off "
    "and on again, and let no other master control it."
)
"""Ends the message where an object is refused in this state, whatever the object: above the table, not in its rows."""
COLUMNS = "| object | the drive's answer | the boot |\n|---|---|---|\n"


@dataclass(frozen=True, slots=True)
class Refusal:
    """One object that a drive refuses to have read, written, or both, in some ways."""

    key: Key
    what: str
    ways: tuple[str, ...] = ALL
    reads: bool = True
    writes: bool = True


REFUSALS = (
    Refusal((0x1000, 0), "device type", READS, writes=False),
    Refusal((0x1016, 0), "number of watched heartbeats", READS),
    Refusal((0x1016, 1), "watched heartbeat", WRITES, reads=False),
    Refusal((0x1017, 0), "its own heartbeat"),
    Refusal((0x1018, 1), "vendor", READS),
    Refusal((0x1019, 0), "counter in SYNC", READS),
    Refusal((0x1029, 1), "behaviour without masters"),
    Refusal((0x1201, 1), "COB-ID of a second SDO channel, open", READS),
    Refusal((0x1201, 1), "COB-ID of a second SDO channel, open", CHANNEL, reads=False),
    Refusal((0x1400, 1), "COB-ID of the setpoints", WRITES, reads=False),
    Refusal((0x1400, 2), "type of the setpoints", WRITES, reads=False),
    Refusal((0x1403, 1), "COB-ID of the watchdog's quick stop", ("does not exist",)),
    Refusal((0x1403, 2), "type of the watchdog's quick stop", WRITES, reads=False),
    Refusal((0x1600, 1), "6040h in a PDO", MAPS, reads=False),
    Refusal((0x1600, 2), "60FFh in a PDO", MAPS, reads=False),
    Refusal((0x1800, 1), "COB-ID of status and position", WRITES, reads=False),
    Refusal((0x1800, 2), "type of status and position", WRITES, reads=False),
    Refusal((0x1A00, 1), "6041h in a PDO", MAPS, reads=False),
    Refusal((0x1A00, 2), "6064h in a PDO", MAPS, reads=False),
    Refusal((0x1A01, 1), "606Ch in a PDO", MAPS, reads=False),
    Refusal((0x1A01, 2), "6077h in a PDO", MAPS, reads=False),
    Refusal((0x6007, 0), "reaction without masters"),
    Refusal((0x6041, 0), "statusword", READS, writes=False),
    Refusal((0x605A, 0), "how a quick stop stops"),
    Refusal((0x605E, 0), "how a fault stops"),
    Refusal((0x6060, 0), "mode", WRITES, reads=False),
    Refusal((0x6061, 0), "mode display", READS, writes=False),
    Refusal((0x6077, 0), "torque", READS, writes=False),
    Refusal((0x6083, 0), "acceleration"),
    Refusal((0x6084, 0), "deceleration"),
    Refusal((0x6085, 0), "deceleration of a quick stop"),
    Refusal((0x60FF, 0), "target velocity", WRITES, reads=False),
)


def page(before: str) -> str:
    """The page with its table renewed."""
    head, rest = before.split(BEGIN)
    table = COLUMNS + "".join(f"| {row} |\n" for row in rows())
    return f"{head}{BEGIN}\n{table}{END}{rest.split(END)[1]}"


def rows() -> Iterator[str]:
    """Ways of one object that lead to the same sentence are one row."""
    for refusal in REFUSALS:
        told = [(way, outcome(refusal, CLASSES[way])) for way in refusal.ways]
        told = [(way, sentence) for way, sentence in told if not sentence.endswith(WRONG_STATE)]
        for sentence, ways in groupby(sorted(told, key=lambda each: each[1]), key=lambda each: each[1]):
            name = f"{refusal.key[0]:04X}h:{refusal.key[1]} {refusal.what}"
            yield " | ".join((name, ", ".join(way for way, _ in ways), sentence))


def outcome(refusal: Refusal, code: int) -> str:
    """What the boot does and says; the abort code in words is left out."""
    drive = FakeDrive()
    drive.objects[0x1400, 2] = drive.objects[0x1403, 2] = drive.objects[0x1800, 2] = u8(0)
    for key, value in (((0x6084, 0), u32(100_000)), ((0x6085, 0), u32(100_000)), ((0x1019, 0), u8(0))):
        drive.objects[key] = value
    drive.objects.setdefault((0x6061, 0), u8(3))
    drive.objects[0x605A, 0] = u16(6)
    if refusal.key[0] == 0x1201:
        drive.objects |= {(0x1201, 1): u32(0x6A1), (0x1201, 2): u32(0x6C1)}
        drive.refuse[0x1201, 2] = code
    if code == CLASSES["does not exist"]:
        drive.objects.pop(refusal.key, None)
    if refusal.reads and code != CLASSES["is read-only"]:
        drive.refuse_read[refusal.key] = code
    if refusal.writes:
        drive.refuse[refusal.key] = code
    boot = Bench(drive, robot()).run()
    if boot.error is not None:
        said = f"**error**: {boot.error}"
    else:
        notes = boot.report.notes if boot.report is not None else ()
        said = f"note: {'; '.join(notes)}" if notes else "boots"
    return said.replace("node 1: ", "").replace(abort_text(code), "…").replace("|", "/")


def main() -> int:
    """Writes the page."""
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
