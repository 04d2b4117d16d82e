"""docs/drives/KIND.md: a page for each kind of drive, with the same headings, sources that are listed, and no drift."""

from __future__ import annotations

import re

import pytest

from campaign.drive_pages import BOOT, FOLDER, STOP, UNPROVEN, boot_section, page, stop_section, unproven_section
from canbase_config.load import load_robot, sample
from canbase_config.profile_file import load_profile, profile_names
from canbase_driver.cia301.nmt import NmtCommand
from support.boot_record import Written, boot_record
from support.marked_page import section

HEADINGS = (
    "Wiring",
    "As delivered",
    "Settings in the vendor's tool",
    "What the boot sets",
    "What stops it",
    "What is proven, and where",
    "Not known",
    "Sources",
)
TWO_SCREENS = 120
"""Lines."""


def read(kind: str) -> str:
    return (FOLDER / f"{kind}.md").read_text(encoding="utf-8")


def test_each_profile_has_a_page_and_each_page_a_profile() -> None:
    assert tuple(sorted(file.stem for file in FOLDER.iterdir())) == profile_names()
    drives = (FOLDER.parent / "drives.md").read_text(encoding="utf-8")
    assert all(f"](drives/{kind}.md)" in drives for kind in profile_names())


@pytest.mark.parametrize("kind", profile_names())
def test_a_page_has_the_fixed_headings_and_fits_on_two_screens(kind: str) -> None:
    text = read(kind)
    assert tuple(re.findall(r"^## (.*)$", text, re.MULTILINE)) == HEADINGS
    assert text.startswith("# ")
    assert f"(`{kind}`)\n" in text
    assert text.count("\n") <= TWO_SCREENS


@pytest.mark.parametrize("kind", profile_names())
def test_every_source_that_a_page_names_is_listed_and_every_listed_one_is_used(kind: str) -> None:
    text, _, sources = read(kind).partition("## Sources")
    generated = section(text, UNPROVEN)  # its keys name the sources of the profile
    own = text.replace(generated, "")
    cited = set(re.findall(r"\[([A-Z][A-Z0-9]*)\](?!\()", own))
    listed = set(re.findall(r"\[([A-Z][A-Z0-9]*)\](?!\()", sources))
    unused = {name for name in listed - cited if f"[{name}]" not in generated}
    assert (cited - listed, unused) == (set(), set())


@pytest.mark.parametrize("kind", profile_names())
def test_the_generated_parts_are_up_to_date(kind: str) -> None:
    before = read(kind)
    assert page(kind, before) == before, "make drive-pages"


def test_no_drive_is_called_tested_on_hardware_while_the_table_of_such_tests_is_empty() -> None:
    drives = (FOLDER.parent / "drives.md").read_text(encoding="utf-8")
    table = drives.partition("## Hardware-tested by")[2].partition("\n## ")[0]
    assert len(re.findall(r"^\|", table, re.MULTILINE)) == 2, "a row: name its kind on the page of the drive, and here"
    assert all("hardware: no." in read(kind) for kind in profile_names())


def test_the_page_of_the_kind_that_independent_stacks_have_driven_says_so_and_no_other_one() -> None:
    """The robot of the Linux guest, which drives slaves of ros2_canopen, has the drives of the sample."""
    yes = "[Independent CANopen stacks](../verification.md#independent-canopen-stacks): yes."
    named = {kind for kind in profile_names() if yes in read(kind)}
    assert named == {drive.profile for drive in load_robot(sample("example_can0")).robot.drives}
    others = set(profile_names()) - named
    assert all("independent CANopen stack, hardware: no." in read(kind) for kind in others)


def test_the_boot_of_a_record_is_that_of_the_drive() -> None:
    """EPOS4: NMT reset first, both heartbeats, 605Ah from 6 to 2, PDOs off before they are mapped."""
    steps = boot_record("epos4").steps
    assert steps[:2] == (NmtCommand.RESET_COMMUNICATION, NmtCommand.ENTER_PRE_OPERATIONAL)
    assert Written(0x1016, 1, 0x007E_012C, 4) in steps
    assert Written(0x605A, 0, 2, 2) in steps
    off, on = steps.index(Written(0x1400, 1, 0xC000_0201, 4)), steps.index(Written(0x1400, 1, 0x4000_0201, 4))
    mapped = [i for i, step in enumerate(steps) if isinstance(step, Written) and step.index == 0x1600]
    assert off < min(mapped)
    assert max(mapped) < on


def test_a_record_of_a_drive_for_two_motors_has_both() -> None:
    assert [drive.axis for drive in boot_record("roboteq").drives] == [0, 1]
    assert "carries 6840h:0, 68FFh:0" in boot_section(boot_record("roboteq"))


def test_a_page_shows_what_does_not_stop_and_what_has_no_source() -> None:
    assert "| computer dies | goes on |" in stop_section("tmcm1636")
    assert "nothing that makes it stop by itself" in stop_section("tmcm1636")
    assert all(f"- `{key}`: " in unproven_section("kinco") for key in load_profile("kinco").unproven)
    assert unproven_section("generic") == "The profile calls none of its values unproven."


def test_a_page_without_a_mark_is_an_error_that_names_it() -> None:
    for part in (BOOT, STOP, UNPROVEN):
        with pytest.raises(ValueError, match=re.escape(part)):
            page("generic", read("generic").replace(f"<!-- {part}: begin -->\n", ""))
