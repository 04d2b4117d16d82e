"""Whatever is in a robot.yaml or an EDS: it ends soon, in an error of our own that names file and line, and is short.

Soon is counted in calls of Python functions, not by a clock: the sample robot takes some 60,000.
"""

from __future__ import annotations

import os
import random
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest

from canbase_config import bounded_file
from canbase_config.eds_file import EdsError, number, read_eds
from canbase_config.errors import MOST_TOLD, ConfigError, Problem, printable
from canbase_config.from_eds import draft
from canbase_config.load import load_robot, sample
from canbase_config.yaml_limits import MAX_BYTES, MAX_DEPTH, MAX_DIGITS, MAX_VALUES
from support.robot_files import GOOD

MOST_CALLS = 3_000_000
LONGEST = 30_000
"""Characters of all that is printed."""


class TooMuchWorkError(Exception):
    """More calls than MOST_CALLS."""


@contextmanager
def counted() -> Iterator[None]:
    """Ends the block after MOST_CALLS calls of Python functions."""
    calls = 0

    def count(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal calls
        calls += event == "call"
        if calls > MOST_CALLS:
            raise TooMuchWorkError

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        yield
    finally:
        sys.setprofile(before)


def aliases(levels: int, width: int) -> str:
    """A few lines that stand for width ** levels values."""
    lines = ["a0: &a0 [x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * width)}]" for n in range(1, levels)]
    return "\n".join(lines)


def merges(levels: int, width: int) -> str:
    lines = ["a0: &a0 {x: 1, y: 2}"]
    lines += [f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * width)}]}}" for n in range(1, levels)]
    return "\n".join(lines)


BOMBS: dict[str, tuple[str, str]] = {
    "aliases": (aliases(9, 10), ":5: more than 5000 values, with every alias"),
    "aliases of two": (aliases(40, 2), "more than 5000 values"),
    "a chain of aliases": (aliases(5000, 1), "nested too deeply"),
    "merged keys": (merges(12, 9), "more than 5000 values"),
    "in a twist_mux list": (GOOD + f"mux:\n  twist_mux: [{'[' * 100}{']' * 100}]\n", "nested too deeply"),
    "depth": ("a: " + "[" * 100_000, "nested too deeply: more than 32 levels"),
    "depth of sections": ("\n".join(" " * n + "a:" for n in range(400)), "nested too deeply"),
    "many values": ("a: [" + "1, " * 80_000 + "1]", "more than 5000 values"),
    "many keys": ("\n".join(f"k{n}: 1" for n in range(20_000)), "more than 5000 values"),
    "digits": (GOOD.replace("node_id: 1\n", f"node_id: {'9' * 100_000}\n"), ":7: a value of 100000 digits"),
    "hexadecimal digits": (GOOD.replace("node_id: 1\n", f"node_id: 0x{'f' * 5_000}\n"), "digits, expected at most 40"),
    "decimals": (GOOD.replace("track_m: 0.5", f"track_m: 0.{'1' * 5_000}"), "digits, expected at most 40"),
    "a long text": (f"name: {'a' * 100_000}\n", ":1: a value of 100000 characters, expected at most 4000"),
    "a long key": (f"{'a' * 900}: 1\n", "unknown key"),
    "a huge file": ("# " + "a" * MAX_BYTES, f"larger than {MAX_BYTES} bytes"),
    "dots of ROS": (f"canbase:\n  ros__parameters:\n    {'a.' * 400}a: 1\n", "nested too deeply"),
    "an exponent": (GOOD.replace("track_m: 0.5", "track_m: 1e999999999"), "base.track_m: got .inf"),
    "unknown keys": (GOOD + "".join(f"unknown_key_{n}: 1\n" for n in range(500)), "and 480 more"),
    "wrong entries": (GOOD.replace("extra: {}", f"extra: [{'x, ' * 500}]"), "bus.extra: got a list"),
    "wrong drives": (GOOD.replace("drives:", "drives:" + "\n  - {joint: 1, side: 2}" * 200), "more"),
}


@pytest.mark.parametrize(("text", "told"), BOMBS.values(), ids=BOMBS)
def test_a_robot_yaml_beyond_every_measure_ends_in_a_short_error_of_our_own(
    tmp_path: Path, text: str, told: str
) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(text)

    with counted(), pytest.raises(ConfigError) as caught:
        load_robot(file)

    said = str(caught.value)
    assert said.startswith(str(file))
    assert told in said
    assert len(said) < LONGEST
    assert len(said.splitlines()) <= 2 * MOST_TOLD + 1


def test_a_pipe_is_read_to_its_end_and_no_longer_than_its_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`canbase config check <(generator)`; and a pipe or device that never ends."""
    monkeypatch.setattr(bounded_file, "WAIT_S", 0.0)
    reader, writer = os.pipe()
    os.write(writer, GOOD.encode())
    with pytest.raises(ConfigError, match=rf"^/dev/fd/{reader}: cannot be read: a pipe or device without an end"):
        load_robot(f"/dev/fd/{reader}")
    os.write(writer, GOOD.encode())
    os.close(writer)
    assert load_robot(f"/dev/fd/{reader}").robot.drives
    os.close(reader)
    os.mkfifo(tmp_path / "robot.yaml")
    for name, why in ((str(tmp_path / "robot.yaml"), "without an end"), ("/dev/zero", "larger than")):
        with pytest.raises(ConfigError, match=f"^{name}: .*{why}"):
            load_robot(name)


def test_what_is_within_every_limit_is_read(tmp_path: Path) -> None:
    """Aliases are good for what drives have in common; a comment may be long."""
    text = GOOD.replace("gear_ratio: 20.0", "gear_ratio: &ratio 20.0", 1).replace(
        "gear_ratio: 20.0", "gear_ratio: *ratio"
    )
    file = tmp_path / "robot.yaml"
    file.write_text(text + "#" * (MAX_BYTES - len(text)))

    with counted():
        robot = load_robot(file).robot

    assert [drive.gear_ratio for drive in robot.drives] == [20.0, 20.0]
    assert MAX_VALUES > 1_000
    assert (MAX_DEPTH, MAX_DIGITS) == (32, 40)


def mutants(text: str, how_many: int) -> Iterator[str]:
    """The same for every run: pieces cut, doubled, exchanged, and characters that mean something to YAML."""
    chance = random.Random(53)
    signs = [
        *"[]{}&*!|>'\"%@`#:-?,~\t\n\x00\x1b\ufeff\u2028",
        "<<: ",
        "&a ",
        "*a ",
        "!!int ",
        "!!binary ",
        "%YAML 1.1\n---\n",
        "0x",
        "1e",
    ]
    for _ in range(how_many):
        mutant = text
        for _ in range(chance.randrange(1, 6)):
            at, length = chance.randrange(len(mutant) + 1), chance.randrange(30)
            piece = chance.choice([chance.choice(signs) * chance.randrange(1, 50), mutant[at : at + length] * 3, ""])
            mutant = mutant[:at] + piece + mutant[at + chance.randrange(length + 1) :]
        yield mutant


def outcome(read: Callable[[Path], object], file: Path, ours: type[Exception]) -> str:
    """What it says; empty: it could be read. Anything but an error of our own goes through."""
    try:
        with counted():
            read(file)
    except ours as error:
        return str(error)
    return ""


@pytest.mark.filterwarnings("ignore")  # ruamel.yaml says where an anchor is used twice
def test_no_mutant_of_a_robot_yaml_ends_otherwise(tmp_path: Path) -> None:
    file, refused = tmp_path / "robot.yaml", 0
    for mutant in mutants(GOOD, 60):
        file.write_text(mutant, encoding="utf-8", errors="surrogateescape")
        said = outcome(load_robot, file, ConfigError)
        refused += bool(said)
        assert len(said) < LONGEST, mutant
        assert said == "" or said.startswith(str(file)), mutant
        assert printable(said.replace("\n", ""), LONGEST) == said.replace("\n", "")
    assert refused > 30


def test_no_mutant_of_an_eds_ends_otherwise(tmp_path: Path) -> None:
    whole = (sample("bench").parents[1] / "eds" / "canbase_cia402.eds").read_text()
    file = tmp_path / "drive.eds"
    for mutant in mutants(whole[:4_000], 40):
        file.write_text(mutant, encoding="utf-8")
        outcome(lambda path: draft(read_eds(path)), file, EdsError)


@pytest.mark.parametrize(
    "value",
    ["9" * 100_000, "0x" + "f" * 100_000, "$NODEID" * 50_000, "+".join(["1"] * 50_000), "0" * 100_000],
)
def test_a_number_of_an_eds_without_end_is_none(tmp_path: Path, value: str) -> None:
    assert number(value) is None
    file = tmp_path / "drive.eds"
    file.write_text(f"[DeviceInfo]\n[6040]\nDataType=7\nDefaultValue={value}\n")

    eds = read_eds(file)

    assert eds.default(0x6040) is None
    assert any("is no number" in note for note in eds.notes)


def test_an_eds_of_oddities_has_a_limited_list_of_them(tmp_path: Path) -> None:
    file = tmp_path / "drive.eds"
    file.write_text("[6040]\nDataType=7\n" + "odd\n" * 50_000)

    assert len(read_eds(file).notes) == 1_000


def test_what_a_terminal_would_obey_is_shown_as_text() -> None:
    problem = str(Problem("robot.yaml", 1, "key\x1b[2J", 'got "\x1b]0;title\x07"', hint="a\u202eb"))

    assert problem == 'robot.yaml:1: key\\x1b[2J: got "\\x1b]0;title\\x07"\n    a\\u202eb'
