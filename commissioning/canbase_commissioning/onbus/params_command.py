"""`canbase bus params save` and `diff` on the bus. `commissioning/parameters` decides what is read and compared."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Final

from canbase_base.own_folder import replaced
from canbase_commissioning.bus_monitor import Listener, ListenSession
from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.onbus.bus_session import BusSession, open_line
from canbase_commissioning.onbus.params_source import read_drive
from canbase_commissioning.parameters.boot_values import boot_values
from canbase_commissioning.parameters.comparison import Comparison, Difference, compare
from canbase_commissioning.parameters.dcf_reader import read_parameters
from canbase_commissioning.parameters.dcf_writer import Heading, dcf_text
from canbase_commissioning.parameters.saved import Parameters
from canbase_config.eds_file import Eds, EdsError, read_eds, read_text
from canbase_config.robot import Bus, Robot
from canbase_runtime.terminal import FAILED, WRONG_INPUT, CommandError, fail, warn

LISTEN_S: Final = 0.4
DIFFERENT: Final = 3
"""Exit code of a comparison that found differences."""
BOOT: Final = "boot"
SHOWN: Final = 5
"""Objects that are named for one reason; the file has all of them."""


@dataclass(frozen=True, slots=True)
class Side:
    """One side of a comparison: a node on the bus, a file, or the boot."""

    node: int | None = None
    file: Path | None = None

    @classmethod
    def of(cls, word: str) -> Side:
        """A number is a node id, `boot` the boot of robot.yaml, everything else a file. Raises CommandError."""
        if word.isdecimal():
            if not 1 <= int(word) <= 127:
                fail(f"{word} is no node id: expected 1 to 127, or a file", WRONG_INPUT)
            return cls(node=int(word))
        return cls() if word == BOOT else cls(file=Path(word))

    @property
    def is_boot(self) -> bool:
        """Whether it is what the boot sets."""
        return self.node is None and self.file is None


def read_maker_eds(path: Path) -> Eds:
    """Exits with 2 for a file that is no EDS."""
    try:
        return read_eds(path)
    except EdsError as error:
        fail(str(error), WRONG_INPUT)


def run_save(
    bus: Bus, robot: Robot | None, node: int, eds_file: Path, out: Path, timeout_s: float, *, overwrite: bool
) -> None:
    """Reads the drive and writes the file; exits with 1 when the drive does not answer, 2 for wrong files."""
    if out.exists() and (not overwrite or out.samefile(eds_file)):
        fail(f"{out} is there already: another name, or --overwrite (never over the EDS itself)", WRONG_INPUT)
    eds = read_maker_eds(eds_file)
    with open_line(bus) as line:
        found = read_drive(line, listen(line), node, eds, timeout_s)
    now = datetime.now(tz=timezone.utc).astimezone()
    bitrate = bus.bitrate if robot is not None else None
    heading = Heading(out.name, now.strftime("%m-%d-%Y"), now.strftime("%I:%M%p"), bitrate)
    text, encoding = read_text(eds.path)
    try:
        with replaced(out) if overwrite else out.open("xb") as file:
            file.write(dcf_text(text, eds, found, heading).encode(encoding))
    except OSError as error:
        fail(f"{out} cannot be written: {error.strerror or error}", FAILED)
    print(f"node {node}: {found.identity}")
    print(f"{out}: {len(found.values)} objects, {len(found.refused)} without a value")
    tell_refused(found.refused)


def listen(line: BusSession) -> Listener:
    """What is on the bus."""
    listening = ListenSession(LISTEN_S)
    line.run(listening)
    return listening.heard


def tell_refused(refused: Mapping[Address, str]) -> None:
    """Each reason, with the objects that it was given for."""
    by_reason: dict[str, list[Address]] = defaultdict(list)
    for at, why in refused.items():
        by_reason[why].append(at)
    for why, places in by_reason.items():
        more = f" and {len(places) - SHOWN} more" if len(places) > SHOWN else ""
        print(f"  {why}: {', '.join(map(str, places[:SHOWN]))}{more}")


def run_diff(
    bus: Bus | None,
    robot: Robot | None,
    first: str,
    second: str,
    eds_file: Path | None,
    timeout_s: float,
    *,
    all_: bool,
) -> None:
    """Prints what differs; exits with 3 when anything does. `bus`: None where no side is a drive."""
    sides = (Side.of(first), Side.of(second))
    eds = read_maker_eds(eds_file) if eds_file else None
    if all(side.is_boot for side in sides):
        fail("boot has to be compared with a file or a node", WRONG_INPUT)
    files = [_file(side.file) if side.file else None for side in sides]
    eds = eds or next((found[1] for found in files if found), None)
    if eds is None:
        fail("--eds is missing: the EDS file names the objects of a drive", WRONG_INPUT)
    found = [read[0] if read else None for read in files]
    if bus is not None:
        with open_line(bus) as line:
            heard = listen(line)
            for i, side in enumerate(sides):
                found[i] = read_drive(line, heard, side.node, eds, timeout_s) if side.node else found[i]
    eds = replace(
        eds, objects={**{at: e for read in files if read for at, e in read[1].objects.items()}, **eds.objects}
    )
    if any(side.is_boot for side in sides):
        _diff_with_boot(next(each for each in found if each is not None), eds, robot, boot_first=sides[0].is_boot)
        return
    left, right = (each for each in found if each is not None)
    _tell(left, right, compare(left, right, eds, everything=all_))


def _file(path: Path) -> tuple[Parameters, Eds]:
    try:
        return read_parameters(path)
    except EdsError as error:
        fail(str(error), WRONG_INPUT)


def _tell(first: Parameters, second: Parameters, found: Comparison) -> None:
    print(f"{first.source}: {first.identity}")
    print(f"{second.source}: {second.identity}")
    for problem in (found.product, found.firmware and f"other firmware: {found.firmware}"):
        if problem:
            warn(problem)
    _lines(found.differences)
    if not found.compared:
        fail("the two have no object in common", FAILED)
    print(f"{len(found.differences)} of {found.compared} objects differ")
    if not found.alike:
        raise CommandError("", DIFFERENT)


def _lines(differences: tuple[Difference, ...]) -> None:
    for each in differences:
        print(str(each))


def _diff_with_boot(saved: Parameters, eds: Eds, robot: Robot | None, *, boot_first: bool) -> None:
    if robot is None:
        fail("--config is missing: the robot.yaml whose boot is meant", WRONG_INPUT)
    drives = tuple(drive for drive in robot.drives if drive.node_id == saved.node_id)
    if not drives:
        nodes = ", ".join(str(node) for node in sorted({drive.node_id for drive in robot.drives}))
        fail(f"robot.yaml has no drive with node id {saved.node_id}, only {nodes}", WRONG_INPUT)
    found = boot_values(saved, eds, drives, robot)
    print(f"{saved.source}: {saved.identity}")
    written = found.written
    if boot_first:
        written = tuple(replace(each, first=each.second, second=each.first) for each in written)
    _lines(written)
    for note in found.notes:
        print(f"  note: {note}")
    if found.problem:
        fail(f"the boot would fail: {found.problem}", FAILED)
    print(f"the boot sets {len(written)} objects to another value")
    if written:
        raise CommandError("", DIFFERENT)
