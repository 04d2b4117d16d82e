"""Drive profiles: the files that come with canbase, their sources, and how robot.yaml names them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from canbase_config.errors import ConfigError, Loc
from canbase_config.load import leaf_keys, load_robot
from canbase_config.object_map import Place, place
from canbase_config.profile import Layout, Profile
from canbase_config.profile_file import guess, load_profile, profile_names, profile_path
from canbase_config.units import ramp_raw
from canbase_config.yaml_file import YamlFile, read_yaml
from support.robot_files import write

NAMES = profile_names()
FREE = {"title", "notes", "unproven", "emcy", "writes"}
"""Keys whose values are sentences, or carry their source beside the whole entry."""


def rows(file: YamlFile) -> dict[Loc, str]:
    """Every plain value that has to name its source, with the text of its line."""
    text = file.path.read_text(encoding="utf-8").splitlines()
    leaves = (loc for loc in leaf_keys(file.values) if loc[0] not in FREE)
    return {loc: text[(file.line(loc) or 1) - 1] for loc in leaves}


def test_all_eleven_kinds_of_drives_come_with_canbase() -> None:
    kinds = "dryve_d1 elmo_gold epos4 generic inverter kinco nanotec roboteq technosoft tmcm1636 zlac8015d"
    assert tuple(kinds.split()) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_every_value_of_a_profile_names_its_source_or_says_that_it_has_none(name: str) -> None:
    without = [loc for loc, line in rows(read_yaml(profile_path(name))).items() if "#" not in line]
    assert without == []


@pytest.mark.parametrize("name", NAMES)
def test_every_emergency_code_names_a_source_of_the_files_head(name: str) -> None:
    lines = profile_path(name).read_text(encoding="utf-8").splitlines()
    head = "\n".join(line for line in lines if line.startswith("#"))
    sources = [line.rpartition("# ")[2] for line in lines if line.startswith("  0x")]
    assert len(sources) == len(load_profile(name).emcy)
    assert [source for source in sources if not source.startswith("[") or source not in head] == []


@pytest.mark.parametrize("name", NAMES)
def test_what_a_comment_calls_unproven_the_profile_calls_unproven(name: str) -> None:
    file = read_yaml(profile_path(name))
    marked = {line for line in rows(file).values() if "unproven" in line}
    listed = {tuple(path.split(".")) for path in load_profile(name).unproven}
    lines = file.path.read_text(encoding="utf-8").splitlines()
    assert {lines[(file.line(loc) or 1) - 1] for loc in listed} == marked


def test_the_generic_profile_has_the_defaults_alone() -> None:
    given = load_profile("generic")
    assert given.model_copy(update={"notes": ()}) == Profile(title=given.title)


@pytest.mark.parametrize(
    ("vendor", "product", "name"),
    [
        (0xFB, 0x61500000, "epos4"),
        (0x286, 0x664, "tmcm1636"),
        (0x286, 0x665, None),
        (0x3FE, 0x3E9, "dryve_d1"),
        (None, None, None),
        (0x12345, 1, None),
    ],
)
def test_a_profile_is_guessed_by_vendor_and_product(vendor: int | None, product: int | None, name: str | None) -> None:
    assert guess(vendor, product) == name


OFFSET = Profile(title="offset")
ARRAYS = load_profile("zlac8015d")
VL = load_profile("inverter")
NARROW = Profile(title="narrow", layout=Layout(target_bits=16))


@pytest.mark.parametrize(
    ("profile", "index", "axis", "expected"),
    [
        (OFFSET, 0x60FF, 0, Place(0x60FF, 0, 32)),
        (OFFSET, 0x60FF, 1, Place(0x68FF, 0, 32)),
        (OFFSET, 0x6041, 1, Place(0x6841, 0, 16)),
        (ARRAYS, 0x60FF, 0, Place(0x60FF, 1, 32)),
        (ARRAYS, 0x60FF, 1, Place(0x60FF, 2, 32)),
        (ARRAYS, 0x6084, 1, Place(0x6084, 2, 32)),
        (ARRAYS, 0x6040, 1, Place(0x6040, 0, 16)),
        (ARRAYS, 0x6041, 0, Place(0x6041, 0, 32, 0)),
        (ARRAYS, 0x6041, 1, Place(0x6041, 0, 32, 16)),
        (ARRAYS, 0x6060, 1, Place(0x6060, 0, 8)),
        (NARROW, 0x60FF, 0, Place(0x60FF, 0, 16)),
        (VL, 0x60FF, 0, Place(0x6042, 0, 16)),
        (VL, 0x606C, 0, Place(0x6044, 0, 16)),
        (VL, 0x6064, 0, Place(0x6064, 0, 32)),
    ],
)
def test_where_an_object_is(profile: Profile, index: int, axis: int, expected: Place) -> None:
    assert place(profile, index, axis) == expected


VL_KEYS: dict[str, Any] = {"title": "vl", "modes": [2], "layout": {"target_bits": 16, "velocity_bits": 16}}


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({"modes": [2, 3]}, "it is the only one of a profile"),
        ({"layout": {"velocity_bits": 16}}, "6042h and 6044h of mode 2 have 16 bits"),
        ({"layout": {"target_bits": 16}}, "6042h and 6044h of mode 2 have 16 bits"),
        ({"layout": VL_KEYS["layout"] | {"second_axis": "sub_index"}}, "the second axis is at \\+ 800h"),
        ({"units": {"acceleration": "rpm/s"}}, "ramps of mode 2 are in the unit of 6042h per second"),
    ],
)
def test_mode_2_has_objects_widths_and_ramps_of_its_own(keys: dict[str, Any], why: str) -> None:
    assert Profile.model_validate(VL_KEYS).is_vl
    with pytest.raises(ValidationError, match=why):
        Profile.model_validate(VL_KEYS | keys)


def test_a_mapping_entry_has_index_sub_index_and_length() -> None:
    assert place(ARRAYS, 0x606C, 1).mapping_entry == 0x606C0220


@pytest.mark.parametrize(("index", "axis"), [(0x60FF, 2), (0x60FF, -1), (0x60FE, 0)])
def test_no_place_for_an_axis_or_object_that_is_not_there(index: int, axis: int) -> None:
    with pytest.raises(ValueError, match="expected an axis below 2"):
        place(OFFSET, index, axis)


@pytest.mark.parametrize(
    ("name", "counts", "rev_per_s2", "raw"),
    [
        ("generic", 4096, 10.0, 600.0),  # rpm/s
        ("roboteq", 4096, 10.0, 6000.0),  # 0.1 rpm/s
        ("kinco", 10_000, 10.0, 10 * 65536 * 10_000 / 4e6),  # its manual's formula
        ("zlac8015d", 4096, 10.0, 1000 * (1000 / 60) / 10),  # ms from stand to 1000 rpm
        ("technosoft", 2000, 10.0, 10 * 2000 * 65536 / 1e6),  # counts/ms², 16.16
        ("elmo_gold", 4096, 10.0, 40_960.0),  # counts/s²
    ],
)
def test_ramps_in_the_drives_own_unit(name: str, counts: int, rev_per_s2: float, raw: float) -> None:
    units = load_profile(name).units
    assert units.target_velocity is not None
    assert ramp_raw(units, units.target_velocity, counts, rev_per_s2) == pytest.approx(raw)


def test_robot_yaml_names_a_profile_and_takes_its_units(tmp_path: Path) -> None:
    robot = load_robot(write(tmp_path, {7: "    node_id: 1\n    profile: kinco"})).robot
    assert robot.drives[0].kind.title == "Kinco FD5"
    assert robot.drives[0].target_unit == "counts/ms/16384"
    assert robot.drives[1].target_unit == "0.1rpm"  # given in the file, before the generic profile's rpm


def test_a_profile_of_ones_own_lies_beside_robot_yaml(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("title: mine\nunits: {target_velocity: rev/s, actual_velocity: rev/s}\n")
    robot = load_robot(write(tmp_path, {7: "    node_id: 1\n    profile: mine.yaml"})).robot
    assert robot.drives[0].target_unit == "rev/s"


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("profile: epos", "did you mean epos4?"),
        ("profile: nothing.yaml", "no such file"),
        ("profile: nanotec", "drives[0].profile: velocity_unit is missing: with Nanotec"),
        ("profile: epos4\n    axis: 1", "drives[0].axis: a maxon EPOS4 turns 1 motor(s)"),
        ("profile: technosoft\n    mode: 9", "takes velocities in mode 3, not in 9"),
        ("profile: zlac8015d\n    velocity_unit: rpm", "have different units; leave it out"),
    ],
)
def test_a_drive_that_does_not_fit_its_profile(tmp_path: Path, line: str, text: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_robot(write(tmp_path, {7: f"    node_id: 1\n    {line}"}))
    assert text in str(error.value)


def test_a_slip_in_a_profile_is_told_with_its_line_and_the_right_key(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("title: mine\npdo:\n  rpdo: 4\n")
    with pytest.raises(ConfigError) as error:
        load_profile(str(file))
    assert "mine.yaml:3: pdo.rpdo: unknown key" in str(error.value)
    assert "did you mean rpdos?" in str(error.value)


def test_an_unproven_key_must_be_one(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("title: mine\nunproven: [units.speed]\n")
    with pytest.raises(ConfigError, match=r"units\.speed is no key of a profile"):
        load_profile(str(file))


def test_node_guarding_and_heartbeats_exclude_each_other(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("title: mine\nself_stop:\n  node_guarding: true\n  heartbeat_entries: 1\n")
    with pytest.raises(
        ConfigError, match=r"node guarding excludes heartbeats \(CiA 301\): it needs heartbeat_entries: 0"
    ):
        load_profile(str(file))
    file.write_text("title: mine\nself_stop:\n  node_guarding: true\n  heartbeat_entries: 0\n")
    assert load_profile(str(file)).self_stop.node_guarding


@pytest.mark.parametrize(
    ("index", "key"),
    [
        (0x1016, "self_stop.heartbeat_entries"),
        (0x100C, "self_stop.node_guarding"),
        (0x100D, "self_stop.node_guarding"),
        (0x1029, "self_stop.error_behaviour"),
        (0x6007, "self_stop.abort_connection_code"),
        (0x6807, "self_stop.abort_connection_code"),
        (0x605A, "options.quick_stop_code"),
        (0x685A, "options.quick_stop_code"),
        (0x605E, "options.fault_reaction_code"),
        (0x2000, "self_stop.vendor_watchdog"),
    ],
)
def test_a_write_at_the_end_of_the_boot_cannot_undo_what_makes_the_drive_stop(
    tmp_path: Path, index: int, key: str
) -> None:
    """The boot has read it back before, and reports that the drive stops by itself; a proof stays valid as well."""
    own = "self_stop: {vendor_watchdog: {index: 0x2000, text: its own}}\n"
    entry = f"{{index: {index:#06x}, value: 0, bits: 16}}"
    file = tmp_path / "own.yaml"
    file.write_text(f"title: own\n{own}writes: {{after_mapping: [{entry}]}}\n")
    with pytest.raises(ConfigError, match=re.escape(f"{index:04X}h decides how the drive stops: set {key} instead")):
        load_profile(str(file))
    file.write_text(f"title: own\n{own}writes: {{before_mapping: [{entry}]}}\n")
    load_profile(str(file))


@pytest.mark.parametrize("when", ["before_mapping", "after_mapping"])
def test_a_write_of_the_profile_opens_no_further_sdo_channel(tmp_path: Path, when: str) -> None:
    file = tmp_path / "own.yaml"
    file.write_text(f"title: own\nwrites: {{{when}: [{{index: 0x1201, sub: 1, value: 0x641, bits: 32}}]}}\n")
    with pytest.raises(
        ConfigError, match="1201h is an SDO channel: take this entry out; the boot closes all but the default one"
    ):
        load_profile(str(file))
