"""`python -m campaign.drive_pages`: the generated parts of docs/drives/KIND.md, a page for each kind of drive.

What the boot writes, read from a boot of the simulated drive; how it stops, from docs/stop_times.md (`make kinds`);
what its profile calls unproven, with the comment beside it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final

from campaign.kinds import COMMAND as KINDS
from campaign.kinds import TABLE as STOPS
from canbase_config.eds_file import read_eds
from canbase_config.profile_file import load_profile, profile_names, profile_path
from canbase_config.yaml_file import read_yaml
from canbase_driver.cia301.nmt import NmtCommand
from canbase_driver.drive_units import AxisUnits
from exit_matrix.page_table import NOTHING
from support.boot_record import BootRecord, Written, boot_record
from support.marked_page import rewritten, section

DOCS: Final = Path(__file__).parents[2] / "docs"
FOLDER: Final = DOCS / "drives"
BOOT, STOP, UNPROVEN = (f"make drive-pages, {part}" for part in ("boot", "stops", "unproven"))
"""Names the parts of a page that are generated."""
EDS = read_eds(profile_path("generic").parents[1] / "eds" / "canbase_cia402.eds")
OWN_NAMES = {
    0x2000: "communication offline time",
    0x200F: "targets of both motors",
    0x6046: "vl velocity min max amount",
    0x6048: "vl velocity acceleration",
    0x6049: "vl velocity deceleration",
    0x604A: "vl velocity quick stop",
    0x604C: "vl dimension factor",
}
"""Objects of manufacturers and of mode 2, which our EDS does not have."""
MEANINGS: dict[int, dict[int, str]] = {
    0x6007: {0: "nothing", 1: "fault", 2: "disable voltage", 3: "quick stop"},
    0x605A: {2: "stop by the quick stop ramp, then without power"},
    0x605E: {2: "stop by the quick stop ramp"},
    0x6060: {2: "velocity (vl)", 3: "profile velocity", 9: "cyclic synchronous velocity", -3: "velocity at once"},
    0x1029: {0: "pre-operational when a heartbeat is lost"},
    0x200F: {0: "apart"},
}
NMT = {
    NmtCommand.RESET_COMMUNICATION: "reset communication",
    NmtCommand.RESET_NODE: "reset node",
    NmtCommand.ENTER_PRE_OPERATIONAL: "enter pre-operational",
}
HOW_TO_READ: Final = "In this order ([how to read it](../drive_types.md#how-to-read-the-page-of-a-drive-type)):"
MILLISECONDS = (0x1017, 0x100C, 0x2000)
RAMPS = (0x6083, 0x6084, 0x6085)
PDO_OFF = 1 << 31
OFF = " | off"


def page(kind: str, before: str) -> str:
    """The page of a kind with its generated parts renewed. Raises ValueError when it lacks their marks."""
    after = rewritten(before, BOOT, boot_section(boot_record(kind)))
    after = rewritten(after, STOP, stop_section(kind))
    return rewritten(after, UNPROVEN, unproven_section(kind))


def boot_section(record: BootRecord) -> str:
    """What the boot wrote, a row for each object, one for each PDO; and what it notes."""
    rows = "\n".join(f"| {cells} |" for cells in _joined(_boot_rows(record)))
    notes = "".join(f"\n- {note}" for note in record.report.notes)
    told = f"Notes of this boot, in /diagnostics:\n{notes}" if notes else "This boot has no notes."
    return f"{HOW_TO_READ}\n\n| object | set to |\n|---|---|\n{rows}\n\n{told}"


def _joined(rows: Iterable[str]) -> Iterator[str]:
    """PDOs that are switched off one after the other are one row."""
    for is_off, group in groupby(rows, key=lambda row: row.endswith(OFF)):
        if is_off:
            yield ", ".join(row.removesuffix(OFF) for row in group) + OFF
        else:
            yield from group


def _boot_rows(record: BootRecord) -> Iterator[str]:
    for name, steps in groupby(record.steps, key=_group):
        found = list(steps)
        if name:
            yield _pdo_row(name, [step for step in found if isinstance(step, Written)])
            continue
        for step in found:
            if isinstance(step, NmtCommand):
                yield f"NMT | {NMT[step]}"
            else:
                value = f"{step.value:0{2 * step.size}X}h{_meaning(step, record)}"
                yield f"{step.index:04X}h:{step.sub} {_name(step)} | {value}"


def _group(step: Written | NmtCommand) -> str:
    """The PDO that a write is about; empty: none."""
    if isinstance(step, Written) and 0x1400 <= step.index < 0x1C00:
        return f"{'RPDO' if step.index < 0x1800 else 'TPDO'}{(step.index & 0x1FF) + 1}"
    return ""


def _pdo_row(name: str, steps: Sequence[Written]) -> str:
    """All that was written to the communication and the mapping of one PDO."""
    communication = 0x1400 if name.startswith("RPDO") else 0x1800
    settings = {step.sub: step.value for step in steps if step.index < communication + 0x200}
    carried = {step.sub: step.value for step in steps if step.index >= communication + 0x200 and step.sub}
    index = communication + int(name[4:]) - 1
    if settings[1] & PDO_OFF:
        return f"{name} ({index:04X}h){OFF}"
    what = f"on, COB-ID {settings[1] & 0x7FF:03X}h"
    what += f"; carries {', '.join(map(_mapped, carried.values()))}" if carried else ""
    what += f"; type {settings[2]}" if 2 in settings else ""
    what += f"; inhibit time {settings[3] / 10:g} ms" if 3 in settings else ""
    what += f"; event timer {settings[5]} ms" if 5 in settings else ""
    return f"{name} ({index:04X}h, {index + 0x200:04X}h) | {what}"


def _mapped(entry: int) -> str:
    return f"{entry >> 16:04X}h:{entry >> 8 & 0xFF}"


def _name(step: Written) -> str:
    index = _first_axis(step.index)
    name = (OWN_NAMES.get(index) or EDS.names[index]).removeprefix("Axis 0 ")
    return name[:1].lower() + name[1:] + (", second motor" if index != step.index else "")


def _first_axis(index: int) -> int:
    return index - 0x800 if 0x6800 <= index < 0x7000 else index


def _meaning(step: Written, record: BootRecord) -> str:
    index = _first_axis(step.index)
    signed = step.value - (step.value >> 8 * step.size - 1 << 8 * step.size)
    if index == 0x1016:
        return f": node {step.value >> 16 & 0x7F}, {step.value & 0xFFFF} ms"
    if index in MILLISECONDS:
        return f": {step.value} ms"
    if index in RAMPS:
        mps2 = AxisUnits(record.drives[0], record.robot.base).acceleration_mps2(step.value)
        return f": {mps2:.2f} m/s² at the rim"
    text = MEANINGS.get(index, {}).get(signed, "")
    return f": {text}" if text else ""


def stop_section(kind: str) -> str:
    """The row of `make kinds`, a line for each failure."""
    measured = STOPS.rows(section((DOCS / "stop_times.md").read_text(encoding="utf-8"), KINDS))
    (by, row), *_ = [(key[1], row) for key, row in measured.items() if key[0] == kind]
    lines = "\n".join(f"| {failure} | {row[failure]} |" for failure in STOPS.columns)
    by = "nothing that makes it stop by itself" if by == NOTHING else by
    return f"The boot sets and confirms: {by}.\n\n| failure | standstill after (p50, max) |\n|---|---:|\n{lines}"


def unproven_section(kind: str) -> str:
    """The keys of the profile without a source, with what stands beside them."""
    file = read_yaml(profile_path(kind))
    text = file.path.read_text(encoding="utf-8").splitlines()
    rows = []
    for path in load_profile(kind).unproven:
        line = text[(file.line(tuple(path.split("."))) or 1) - 1]
        rows.append(f"- `{path}`: {line.partition('#')[2].strip()}")
    return "\n".join(rows) or "The profile calls none of its values unproven."


def main() -> int:
    """Writes the pages."""
    for kind in profile_names():
        file = FOLDER / f"{kind}.md"
        file.write_text(page(kind, file.read_text(encoding="utf-8")), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
