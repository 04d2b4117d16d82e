"""Reads a YAML 1.2 file into plain values and remembers the line of each key. Independent of robots."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from ruamel.yaml import YAML
from ruamel.yaml.constructor import DuplicateKeyError, SafeConstructor
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from canbase_config.bounded_file import read_bounded
from canbase_config.errors import ConfigError, Loc, Place, Problem, key_path
from canbase_config.yaml_limits import MAX_BYTES, MAX_DEPTH, BoundedComposer, ExcessError, line_of_brackets

_TAG: Final = "tag:yaml.org,2002:"
_MERGE_TAG: Final = f"{_TAG}merge"


class _CoreConstructor(SafeConstructor):
    """Builds the types of YAML 1.2's core schema, which are those of JSON; a date stays the text that it is."""


_CORE_TYPES: Final = ("null", "bool", "int", "float", "str", "seq", "map")
_CoreConstructor.yaml_constructors = {
    **{f"{_TAG}{name}": SafeConstructor.yaml_constructors[f"{_TAG}{name}"] for name in _CORE_TYPES},
    f"{_TAG}timestamp": SafeConstructor.yaml_constructors[f"{_TAG}str"],
    None: SafeConstructor.yaml_constructors[None],
}


@dataclass(frozen=True, slots=True)
class YamlFile:
    """The content of a file. `lines`: for every key and every list entry its line, counted from 1.

    `places`: of what another file has contributed, where it stands there. `notes`: what is not used of that file.
    """

    path: Path
    values: Mapping[str, Any]
    lines: Mapping[Loc, int]
    places: Mapping[Loc, Place] = field(default_factory=dict)
    notes: tuple[Problem, ...] = ()

    def line(self, loc: Loc) -> int | None:
        """Line of `loc`, or of the innermost section around it that the file has; None: the top of the file."""
        for length in range(len(loc), 0, -1):
            if loc[:length] in self.lines:
                return self.lines[loc[:length]]
        return None

    def place(self, loc: Loc) -> Place:
        """Where `loc` stands, or the innermost section around it, in this file or in the one that it came from."""
        return self.places.get(loc) or Place(str(self.path), self.line(loc), key_path(loc))


def read_yaml(path: str | Path) -> YamlFile:
    """The mapping in the file at `path`. Raises ConfigError, with one problem, for anything else than that."""
    path = Path(path)
    text = _text(path)
    if line := line_of_brackets(text):
        raise ConfigError([Problem(str(path), line, "", f"nested too deeply: more than {MAX_DEPTH} levels")])
    yaml = YAML(typ="safe", pure=True)
    yaml.Constructor = _CoreConstructor
    yaml.Composer = BoundedComposer
    try:
        root = yaml.compose(text)
        values = yaml.load(text)
        lines = dict(_lines(root))
    except ExcessError as error:
        raise ConfigError([Problem(str(path), error.problem_mark.line + 1, "", str(error.problem))]) from None
    except ReaderError as error:
        raise ConfigError([_unprintable(path, text, error)]) from error
    except MarkedYAMLError as error:
        raise ConfigError([_syntax(path, text, error)]) from error
    except ValueError as error:
        raise ConfigError([Problem(str(path), None, "", f"not YAML: {error}")]) from error
    if not isinstance(values, dict):
        raise ConfigError([_no_mapping(path, values)])
    return YamlFile(path, values, lines)


def _text(path: Path) -> str:
    """The file as text. Raises ConfigError if it cannot be had."""
    try:
        content = read_bounded(path, MAX_BYTES)
        if len(content) > MAX_BYTES:
            raise ConfigError([Problem(str(path), None, "", f"larger than {MAX_BYTES} bytes")])
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        what = f"byte {error.object[error.start]:02X}h is no UTF-8"
        raise ConfigError([Problem(str(path), line, "", what, hint="save the file in the encoding UTF-8")]) from error
    except FileNotFoundError as error:
        raise ConfigError([Problem(str(path), None, "", "no such file", hint=_neighbour(path))]) from error
    except IsADirectoryError as error:
        raise ConfigError([Problem(str(path), None, "", "is a folder", "a YAML file")]) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ConfigError([Problem(str(path), None, "", f"cannot be read: {reason}")]) from error


def _neighbour(path: Path) -> str:
    """What the user may have meant instead of the missing `path`."""
    if not path.parent.is_dir():
        return f"the folder {path.parent} does not exist either"
    names = [file.name for file in path.parent.iterdir() if file.suffix in (".yaml", ".yml")]
    near = difflib.get_close_matches(path.name, names, n=1)
    if near:
        return f"did you mean {path.with_name(near[0])}?"
    return f"looked for it at {path.absolute()}; canbase setup init writes a robot.yaml"


def _lines(node: Node, loc: Loc = ()) -> Iterator[tuple[Loc, int]]:
    """Line of everything below `node`; a key of the mapping itself comes after (and so replaces) a merged one."""
    if isinstance(node, SequenceNode):
        for index, entry in enumerate(node.value):
            yield (*loc, index), entry.start_mark.line + 1
            yield from _lines(entry, (*loc, index))
    if isinstance(node, MappingNode):
        for key, value in sorted(node.value, key=lambda pair: pair[0].tag != _MERGE_TAG):
            if key.tag == _MERGE_TAG:
                yield from _merged_lines(value, loc)
            elif isinstance(key, ScalarNode):
                yield (*loc, key.value), key.start_mark.line + 1
                yield from _lines(value, (*loc, key.value))


def _merged_lines(node: Node, loc: Loc) -> Iterator[tuple[Loc, int]]:
    """Lines of `<<: *one` or `<<: [*one, *two]`, where the first has the last word."""
    for merged in reversed(node.value) if isinstance(node, SequenceNode) else [node]:
        yield from _lines(merged, loc)


def _no_mapping(path: Path, values: Any) -> Problem:
    if values is None:
        return Problem(str(path), None, "", "is empty", hint="begin with a copy of a sample, such as example_can0.yaml")
    found = "a list" if isinstance(values, list) else f"only the value {values!r}"
    return Problem(str(path), 1, "", f"found {found}", "keys with values, as in `name: robot` with its space")


def _unprintable(path: Path, text: str, error: ReaderError) -> Problem:
    line = text[: error.position].count("\n") + 1
    return Problem(str(path), line, "", f"not YAML: the character U+{ord(text[error.position]):04X} is not allowed")


def _syntax(path: Path, text: str, error: MarkedYAMLError) -> Problem:
    mark = error.problem_mark or error.context_mark
    line = None if mark is None else mark.line + 1
    if isinstance(error, DuplicateKeyError):
        first = str(error.problem).split('"')[1]
        return Problem(str(path), line, first, "this key is already given above in the same section", hint="keep one")
    words = ", ".join(part for part in (error.context, error.problem) if part)
    return Problem(str(path), line, "", f"not YAML: {words}", hint=_syntax_hint(text, line))


def _syntax_hint(text: str, line: int | None) -> str:
    lines = text.splitlines()
    here = lines[line - 1] if line is not None and line <= len(lines) else ""
    if "\t" in here:
        return "the line has a tab; YAML is indented with spaces"
    return f"in or before the line: {here.strip()}" if here.strip() else "a bracket or a quote may not be closed"
