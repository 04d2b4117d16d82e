"""What messages name exists: commands of canbase with their options, keys of robot.yaml and of drive profiles, objects.

A name that is gone sends a person the wrong way. Messages are the string constants of the packages, what the boot says
about refusals (docs/refusals.md), and what `--help` shows; pages are README and docs/.
"""

from __future__ import annotations

import re
from typing import Final

import pytest

from campaign.refusals import PAGE
from canbase_campaign.advice import has_key, is_key, read_advice
from canbase_config.drive import Drive
from canbase_config.eds_file import read_eds
from canbase_config.object_map import VL_OBJECTS
from canbase_config.profile import SDO_SERVERS, Profile
from canbase_config.profile_file import profile_path
from canbase_config.robot import Robot
from canbase_config.scale_objects import SCALE_OBJECTS
from canbase_driver.boot.vl_settings import MIN_MAX, RAMPS
from support.messages_in_code import Text, calls, code_texts, commands, help_texts, page_texts, what_is_wrong

COMMANDS: Final = commands()
MESSAGES: Final = tuple(code_texts())
PROSE: Final = frozenset(
    [
        "again",
        "asks",
        "cannot",
        "does",
        "drives",
        "included",
        "is",
        "it",
        "itself",
        "may",
        "motor",
        "needs",
        "publishes",
        "reacts",
        "refuses",
        "robot",
        "sets",
        "stopped",
        "that",
        "writes",
        "·",
    ]
)
"""What follows "canbase" in messages and is no command. A new word that is one too goes here."""
EDS: Final = read_eds(profile_path("generic").parents[1] / "eds" / "canbase_cia402.eds")
OBJECTS: Final = frozenset((*EDS.names, *SCALE_OBJECTS, *VL_OBJECTS.values(), MIN_MAX, *RAMPS.values(), *SDO_SERVERS))
"""The objects that canbase knows: those of its EDS, those of the units, those of mode 2, SDO channels."""
OTHERS: Final = (0x6000, 0x607F, 0x6080)
"""Where the objects of the first axis begin; max profile velocity, max motor speed (CiA 402-2): only named."""
_DOTTED: Final = re.compile(r"(?<![\w/.@-])[a-z][a-z_]*(?:\.[a-z_0-9]+)+(?![\w/(-])")
_QUOTED_KEY: Final = re.compile(r"`([a-z][a-z_0-9.]*)(?:: [^`]*)?`")
_QUOTED_LINE: Final = re.compile(r"`(canbase [^`]*)`")
_OBJECT: Final = re.compile(r"\b([1-9A-F][0-9A-F]{3})h\b")
FILES: Final = ("yaml", "md", "py", "msg", "eds", "asc", "dcf")
SECTIONS: Final = frozenset((*Robot.model_fields, *Profile.model_fields))


def table() -> list[str]:
    rows = PAGE.read_text(encoding="utf-8").splitlines()
    return [row for row in rows if re.match(r"\| [0-9A-F]{4}h:", row)]


def wrong_calls(texts: tuple[Text, ...], prose: frozenset[str]) -> list[str]:
    found = ((each.where, what_is_wrong(words, COMMANDS)) for each in texts for words in calls(each.text))
    return [f"{where}: {wrong}" for where, wrong in found if wrong and wrong not in prose]


def test_every_command_in_a_message_exists_and_takes_its_options() -> None:
    assert len(MESSAGES) > 5000
    assert wrong_calls((*MESSAGES, *help_texts()), PROSE) == []


def test_every_command_that_a_page_shows_exists_and_takes_its_options() -> None:
    """In prose, "canbase" may have any word behind it: there options alone are looked at."""
    pages = tuple(page_texts())
    quoted = tuple(Text(each.where, line) for each in pages for line in _QUOTED_LINE.findall(each.text))
    assert len(quoted) > 200
    assert wrong_calls(quoted, frozenset()) == []
    assert [wrong for wrong in wrong_calls(pages, frozenset()) if " takes no " in wrong] == []


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("set it with canbase adpot", ["adpot"]),
        ("set it with canbase bus adpot", ["adpot"]),
        ("first canbase setup commission --steps directions,scale; then canbase doctor.", []),
        ("first canbase setup commission --stages directions", ["setup commission takes no --stages"]),
        ("`canbase bus sdo read 1 6041 --chanel can0`", ["bus sdo read takes no --chanel"]),
        ("canbase drive 1.0 --ros-args -p x:=1 --anything", []),
        ("(canbase bus scan), or --this of another tool", []),
        ("run canbase bus scan. --this begins another sentence", []),
        ("see /etc/canbase and canbase.service", []),
    ],
)
def test_a_command_line_is_read_out_of_a_sentence(text: str, wrong: list[str]) -> None:
    assert [told for words in calls(text) if (told := what_is_wrong(words, COMMANDS))] == wrong


def test_every_key_in_a_sentence_about_a_refusal_exists() -> None:
    rows = table()
    assert len(rows) > 60
    named = {key for row in rows for key in (*_QUOTED_KEY.findall(row), *_DOTTED.findall(row))} - {"robot.yaml"}
    assert {"self_stop.node_guarding", "options.torque", "mode", "axis", "watchdog.stand_proof"} <= named
    assert [key for key in sorted(named) if not (is_key(key) or has_key(Drive, key))] == []


def test_every_key_below_a_section_in_a_message_exists() -> None:
    named = {
        (key, each.where)
        for each in MESSAGES
        if " " in each.text
        for key in _DOTTED.findall(each.text)
        if key.partition(".")[0] in SECTIONS and key.rpartition(".")[2] not in FILES
    }
    assert len({key for key, _ in named}) > 50
    assert [each for each in sorted(named) if not is_key(each[0])] == []


def test_every_object_in_a_message_is_one_that_canbase_knows() -> None:
    """Those of the second axis are at + 800h (CiA 402-2)."""
    texts = (*MESSAGES, *(Text(PAGE.name, row) for row in table()))
    named = {(int(index, 16), each.where) for each in texts for index in _OBJECT.findall(each.text)}
    assert len({index for index, _ in named}) > 40
    unknown = [each for each in named if not OBJECTS & {each[0], each[0] - 0x800} and each[0] not in OTHERS]
    assert [f"{index:04X}h {where}" for index, where in sorted(unknown)] == []


def test_a_key_of_an_optional_section_is_one_and_a_key_that_is_gone_is_none() -> None:
    assert is_key("watchdog.relay.chip")
    assert not is_key("watchdog.relay.colour")
    assert not is_key("timeouts.boot_seconds")
    assert read_advice("set `timeouts.boot_seconds: 3` in robot.yaml").keys == {}
