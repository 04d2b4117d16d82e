"""What may stand where in a file, in words, read from the JSON schema of its model. For error texts and docs."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from canbase_config.errors import Loc

Shape = dict[str, Any]
"""One node of the JSON schema, references resolved; empty: anything may stand there, or nothing is known."""


class Schema:
    """The JSON schema of a model, looked up by places in a file."""

    def __init__(self, model: type[BaseModel]) -> None:
        self._model = model

    def shape_at(self, loc: Loc) -> Shape:
        """The schema of the value at `loc`."""
        shape = self._root
        for part in loc:
            shape = self._child(shape, part)
        return shape

    def keys_at(self, loc: Loc) -> tuple[str, ...]:
        """The keys of the section at `loc`, those first that must be given."""
        shape = self.shape_at(loc)
        required = tuple(shape.get("required", ()))
        return required + tuple(key for key in shape.get("properties", ()) if key not in required)

    def is_free(self, loc: Loc) -> bool:
        """Whether `loc` is a mapping whose keys the user chooses."""
        shape = self.shape_at(loc)
        return bool(shape.get("additionalProperties") or shape.get("patternProperties"))

    def homes(self, key: str) -> tuple[str, ...]:
        """The sections that have `key`: `limits`, `drives[…]`, `mux.sources.…`; `` is the top of the file."""
        return tuple(path for path, keys in self.sections if key in keys)

    @functools.cached_property
    def sections(self) -> tuple[tuple[str, frozenset[str]], ...]:
        """Every section of the file: its path and its keys."""
        return tuple((path, frozenset(shape["properties"])) for path, shape in self.shapes)

    @functools.cached_property
    def shapes(self) -> tuple[tuple[str, Shape], ...]:
        """Every section of the file: its path and its description in the model."""
        return tuple(self._sections(self._root, ""))

    @functools.cached_property
    def _root(self) -> Shape:
        return self._model.model_json_schema()

    def _child(self, shape: Shape, part: str | int) -> Shape:
        if isinstance(part, int):
            return self.resolved(shape.get("items", {}))
        if part in shape.get("properties", {}):
            return self.resolved(shape["properties"][part])
        return self.resolved(_free_keys(shape))

    def resolved(self, shape: Shape) -> Shape:
        """`shape` with its reference followed, and for an optional value the shape that is not null."""
        if "$ref" in shape:
            return {**self._root["$defs"][shape["$ref"].rpartition("/")[2]], **shape}
        for option in shape.get("anyOf", ()):
            if option.get("type") != "null":
                return {**self.resolved(option), **shape}
        return shape

    def _sections(self, shape: Shape, path: str) -> Iterator[tuple[str, Shape]]:
        if "properties" in shape:
            yield path, shape
        for key, inner in shape.get("properties", {}).items():
            yield from self._sections(self.resolved(inner), f"{path}.{key}".removeprefix("."))
        if "items" in shape:
            yield from self._sections(self.resolved(shape["items"]), f"{path}[…]")
        if free := _free_keys(shape):
            yield from self._sections(self.resolved(free), f"{path}.…")


def expected(shape: Shape) -> str:
    """Type, range, allowed values and meaning of what should stand there, as the end of a sentence."""
    words = kind_of(shape)
    meaning = shape.get("description", "") if shape.get("type") != "object" else ""
    if meaning.startswith("["):
        return f"{words} {meaning}"
    return f"{words} ({meaning})" if meaning else words


def _free_keys(shape: Shape) -> Shape:
    """What stands under the keys of a mapping whose keys the user chooses."""
    for free in shape.get("patternProperties", {}).values():
        return dict(free)
    free = shape.get("additionalProperties", {})
    return dict(free) if isinstance(free, dict) else {}


def kind_of(shape: Shape) -> str:
    """Type, range and allowed values of what should stand there."""
    if "enum" in shape:
        return "one of " + ", ".join(str(value) for value in shape["enum"])
    match shape.get("type"):
        case "number":
            return "a number" + _range(shape)
        case "integer":
            return "a whole number" + _range(shape)
        case "boolean":
            return "true or false"
        case "string":
            return "text" + _form(shape)
        case "array":
            return f"a list of {shape.get('minItems', 0)} to {shape.get('maxItems', 'any number of')} entries"
        case "object":
            return _section_words(shape)
    return "another value"


def _range(shape: Shape) -> str:
    signs = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    bounds = [f"{sign} {_number(shape[name])}" for name, sign in signs.items() if name in shape]
    return " " + " and ".join(bounds) if bounds else ""


def _number(value: float) -> str:
    return str(int(value)) if float(value).is_integer() else repr(value)


def _form(shape: Shape) -> str:
    """What the text must look like; models give it in words beside their patterns, under `form`."""
    form = f" of {shape['form']}" if "form" in shape else ""
    if "maxLength" in shape:
        return f"{form}, at most {shape['maxLength']} characters"
    return form or (", not empty" if shape.get("minLength") else "")


def _section_words(shape: Shape) -> str:
    if shape.get("required"):
        return "a section with " + ", ".join(shape["required"])
    if "properties" in shape:
        return "a section with some of " + ", ".join(shape["properties"])
    return "a section with at least one entry" if shape.get("minProperties") else "a section of keys and values"
