"""What a message of the driver tells a person to do, as a person reads it: keys, objects, nodes, tools."""

from __future__ import annotations

import json
import re
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, get_args

from canbase_config.profile import Profile
from canbase_config.robot import Robot
from canbase_config.section import Section

_OBJECT = re.compile(r"\b([1-9A-F][0-9A-F]{3})h\b")
_NODE = re.compile(r"\bnode (\d+)\b")
_LITERAL = re.compile(r"`([a-z_]+(?:\.[a-z_0-9]+)*): ([^`]+)`")
_KEY = re.compile(r"\b[a-z_]+(?:\.[a-z_0-9]+)+\b")
OF_A_DRIVE = ("mode", "velocity_unit", "counts_per_motor_rev")
"""Keys of robot.yaml below `drives` that a message may name."""
_BARE = re.compile(rf"`({'|'.join(OF_A_DRIVE)})`")
MAKERS_TOOL, UNUSABLE = "manufacturer's tool", "cannot be used"
WITHOUT_OBJECT = ("boot-up message", "SDO requests", "SDO transfers", "NMT reset")
"""What a message may be about that has no object."""


@dataclass(frozen=True, slots=True)
class Advice:
    """What a message says. `keys`: of a drive profile or robot.yaml, with the value where the message has one."""

    text: str
    nodes: tuple[int, ...]
    objects: tuple[int, ...]
    keys: dict[str, Any]

    @property
    def names_a_thing(self) -> bool:
        """It is about an object, or about a service that has none."""
        return bool(self.objects) or any(word in self.text for word in WITHOUT_OBJECT)

    @property
    def by_tool(self) -> bool:
        """An object is to be set with the manufacturer's tool."""
        return MAKERS_TOOL in self.text

    @property
    def gives_up(self) -> bool:
        """The drive cannot be used."""
        return UNUSABLE in self.text


def read_advice(text: str) -> Advice:
    """What the message says."""
    keys: dict[str, Any] = {key: None for key in _KEY.findall(text) if is_key(key)}
    keys |= dict.fromkeys(_BARE.findall(text))
    keys |= {key: _value(value) for key, value in _LITERAL.findall(text) if is_key(key) or key in OF_A_DRIVE}
    objects = tuple(dict.fromkeys(int(index, 16) for index in _OBJECT.findall(text)))
    return Advice(text, tuple(dict.fromkeys(map(int, _NODE.findall(text)))), objects, keys)


def _value(text: str) -> Any:
    with suppress(json.JSONDecodeError):
        return json.loads(text)
    return text


def is_key(path: str) -> bool:
    """Whether it is a key of a drive profile or of robot.yaml."""
    return has_key(Profile, path) or has_key(Robot, path)


def has_key(model: type[Section], path: str) -> bool:
    """Whether this model has it, in sections below sections."""
    section: Any = model
    for name in path.split("."):
        below = next(
            (each for each in (section, *get_args(section)) if name in getattr(each, "model_fields", {})), None
        )
        if below is None:
            return False
        section = below.model_fields[name].annotation
    return True
