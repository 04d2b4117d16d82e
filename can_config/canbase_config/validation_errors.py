"""Turns what pydantic found wrong into problems that a person can act on: line, key path, found, expected, hint."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from canbase_config.errors import MOST_TOLD, Loc, Problem
from canbase_config.schema import Schema, Shape, expected
from canbase_config.section import MisfitError
from canbase_config.yaml_file import YamlFile


def explain(error: ValidationError, file: YamlFile, schema: Schema) -> tuple[Problem, ...]:
    """One problem for each error, in the order of the files' lines; those of a whole file first.

    `schema` is that of the model which refused the file.
    """
    found = [details for details in error.errors(include_url=False) if not _is_echo(details)]
    found.sort(key=lambda details: (file.place(details["loc"]).file, file.place(details["loc"]).line or 0))
    told = [_explain(details, file, schema) for details in found[:MOST_TOLD]]
    counted = [
        _at(file, details["loc"], details["msg"]) for details in found[MOST_TOLD:]
    ]  # no hints: they are not printed
    return tuple(sorted([*told, *counted], key=lambda problem: (problem.file, problem.line or 0)))


def _at(file: YamlFile, loc: Loc, what: str, expected: str = "", hint: str = "") -> Problem:
    place = file.place(loc)
    return Problem(place.file, place.line, place.key, what, expected, hint)


def _is_echo(details: ErrorDetails) -> bool:
    """A list is reported as too short although it is long enough: its entries are invalid and are reported too."""
    return details["type"] == "too_short" and len(details["input"]) >= details["ctx"]["min_length"]


def _explain(details: ErrorDetails, file: YamlFile, schema: Schema) -> Problem:
    return _EXPLAINERS.get(details["type"], _wrong_value)(details, file, schema)


def _missing(details: ErrorDetails, file: YamlFile, schema: Schema) -> Problem:
    loc = details["loc"]
    return _at(file, loc, "missing", expected(schema.shape_at(loc)))


def _unknown_key(details: ErrorDetails, file: YamlFile, schema: Schema) -> Problem:
    *section, key = details["loc"]
    hint = _key_hint(str(key), tuple(section), schema)
    return _at(file, details["loc"], "unknown key", hint=hint)


def _bad_key(details: ErrorDetails, file: YamlFile, _schema: Schema) -> Problem:
    *section, key = details["loc"]
    what = f"the key {found(key)} is no text"
    line = file.line((*section, str(key)))
    return replace(_at(file, tuple(section), what, hint=f'put it in quotes: "{found(key)}"'), line=line)


def _misfit(details: ErrorDetails, file: YamlFile, _schema: Schema) -> Problem:
    error = details["ctx"]["error"]
    places = [(*details["loc"], *at) for at in error.at] if isinstance(error, MisfitError) else []
    loc = next((place for place in places if place in file.lines), details["loc"])
    return _at(file, loc, str(error))


def _wrong_value(details: ErrorDetails, file: YamlFile, schema: Schema) -> Problem:
    loc, value = details["loc"], details["input"]
    if loc[-1:] == ("[key]",):
        return _wrong_name(details, file, schema)
    shape = schema.shape_at(loc)
    words = expected(shape) if shape else details["msg"]
    what, hint = f"got {found(value)}", _value_hint(value, shape)
    return _at(file, loc, what, words, hint)


def _wrong_name(details: ErrorDetails, file: YamlFile, schema: Schema) -> Problem:
    """A key that the user chooses, such as the name of a source, has the wrong form."""
    loc = details["loc"][:-1]
    if not isinstance(loc[-1], str):
        return _bad_key({**details, "loc": loc}, file, schema)
    names = "letters, digits and _, first a letter, at most 64 characters"
    return _at(file, loc, f"got the name {found(loc[-1])}", names)


_EXPLAINERS: Final[Mapping[str, Callable[[ErrorDetails, YamlFile, Schema], Problem]]] = {
    "missing": _missing,
    "extra_forbidden": _unknown_key,
    "invalid_key": _bad_key,
    "value_error": _misfit,
}


def found(value: Any) -> str:
    """`value` as it may have stood in the file; never long."""
    match value:
        case None:
            return "nothing"
        case bool():
            return "true" if value else "false"
        case float() if not math.isfinite(value):
            return {"inf": ".inf", "-inf": "-.inf"}.get(str(value), ".nan")
        case str():
            return f'"{value}"' if len(value) <= 60 else f'"{value[:60]}…"'
        case dict():
            return "a section" if value else "an empty section"
        case list() | tuple():
            return {0: "an empty list", 1: "a list of 1 entry"}.get(len(value), f"a list of {len(value)} entries")
    return str(value)[:60]


def _value_hint(value: Any, shape: Shape) -> str:
    kind = shape.get("type")
    if "enum" in shape:
        return _did_you_mean(str(value), [str(choice) for choice in shape["enum"]])
    if kind in ("number", "integer") and isinstance(value, str) and re.match(r"[-+.]?\d", value):
        return "write the number alone: no quotes, no unit, a point for the decimals"
    if kind == "integer" and isinstance(value, float) and value.is_integer():
        return f"write {int(value)}"
    if kind == "boolean" and str(value).lower() in ("yes", "no", "on", "off", "0", "1", "true", "false"):
        return "YAML 1.2 knows no other words for it, and no quotes around them"
    if kind == "string" and isinstance(value, (bool, int, float)):
        return f'write it in quotes: "{found(value)}"'
    return ""


def _key_hint(key: str, section: Loc, schema: Schema) -> str:
    """The nearest key of this section, and where a key of this name does belong."""
    here = schema.keys_at(section)
    hints = [_did_you_mean(key, here), _belongs(key, schema)]
    if not any(hints):
        hints.append(_near_elsewhere(key, schema))
    if not any(hints) and here:
        free = [".".join(map(str, (*section, name, key))) for name in here if schema.is_free((*section, name))]
        hints += [f"did you mean {' or '.join(free)}?"] if free else []
        hints.append("the keys here are " + ", ".join(here))
    return " ".join(hint for hint in hints if hint)


def _did_you_mean(word: str, choices: Iterable[str]) -> str:
    near = difflib.get_close_matches(word.lower().replace("-", "_"), choices, n=1, cutoff=0.65)
    return f"did you mean {near[0]}?" if near else ""


def _belongs(key: str, schema: Schema) -> str:
    places = [path or "the top level (not indented)" for path in schema.homes(key)]
    return f"{key} belongs in {' or '.join(places)}" if places else ""


def _near_elsewhere(key: str, schema: Schema) -> str:
    everywhere = {name: path for path, names in schema.sections for name in sorted(names)}
    near = difflib.get_close_matches(key.lower(), everywhere, n=1, cutoff=0.75)
    return f"did you mean {near[0]}, which {_belongs(near[0], schema).removeprefix(near[0] + ' ')}?" if near else ""
