"""Dataclasses as the compiler makes them fast: with their own `__init__`, `__eq__` and `__hash__`, written out.

The module `dataclasses` writes these methods as Python text at run time, which no compiler sees. Frozen ones lose the
check at run time that nobody changes them; mypy has made it before.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class _Field:
    name: str
    kind: str
    default: ast.expr | None
    factory: ast.expr | None
    in_init: bool
    compared: bool


def native_form(source: str, plain_values: bool = False) -> str:
    """The same module, its dataclasses with methods of their own.

    `plain_values`: for virtual time alone. The collector does not know the frozen ones. Python 3.11 overwrites memory
    when one of them is the 50th of objects that free each other; no robot may depend on that it never is.
    """
    tree = ast.parse(source)
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            _rewrite(node, plain_values)
    _make_final(tree)
    first = next(at for at, node in enumerate(tree.body) if not _is_head(node))
    tree.body[first:first] = ast.parse(_NAMES_OF_VALUES if plain_values else _NAMES).body
    return ast.unparse(ast.fix_missing_locations(tree))


def _make_final(tree: ast.Module) -> None:
    """Constants of the module are reached directly, and not by their names."""
    tree.body = [one for node in tree.body for one in _one_by_one(node)]
    for at, node in enumerate(tree.body):
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            target, kind = node.targets[0], _FINAL
        elif isinstance(node, ast.AnnAssign) and node.value is not None and "Final" not in ast.unparse(node.annotation):
            target, kind = node.target, f"{_FINAL}[{ast.unparse(node.annotation)}]"
        else:
            continue
        if isinstance(target, ast.Name) and _is_constant_name(target.id):
            assert node.value is not None
            tree.body[at] = ast.parse(f"{target.id}: {kind} = {ast.unparse(node.value)}").body[0]


def _one_by_one(node: ast.stmt) -> list[ast.stmt]:
    """`A, B = 1, 2` as two assignments, where the values do not look at the names."""
    if not (isinstance(node, ast.Assign) and len(node.targets) == 1):
        return [node]
    target, value = node.targets[0], node.value
    if not (isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts)):
        return [node]
    names = [each.id for each in target.elts if isinstance(each, ast.Name) and _is_constant_name(each.id)]
    if len(names) < len(target.elts) or any(isinstance(each, ast.Starred) for each in value.elts):
        return [node]
    return [ast.parse(f"{name} = {ast.unparse(each)}").body[0] for name, each in zip(names, value.elts, strict=True)]


def _is_constant_name(name: str) -> bool:
    return re.fullmatch("_?[A-Z][A-Z0-9_]+", name) is not None


_FINAL = "_NeverAssignedAgain"
_NAMES = f"from typing import Final as {_FINAL}"
_NAMES_OF_VALUES = f"""
import sys as _sys
from typing import TYPE_CHECKING
{_NAMES}
from typing import final as _unchanged
if TYPE_CHECKING:
    from mypy_extensions import mypyc_attr
vars(_sys.modules[__name__]).setdefault("mypyc_attr", lambda **words: _unchanged)
"""
"""The compiler alone needs `mypyc_attr`: where Python runs this form it does nothing."""
_PLAIN_VALUE = "mypyc_attr(acyclic=True, free_list_len=1)"
"""Of a frozen dataclass. It is made before what would have to refer back to it: no cycle, nothing to collect."""


def _is_head(node: ast.stmt) -> bool:
    """The docstring, or what has to come first."""
    return isinstance(node, ast.Expr) or (isinstance(node, ast.ImportFrom) and node.module == "__future__")


def _rewrite(node: ast.ClassDef, plain_values: bool) -> None:
    at = next((n for n, one in enumerate(node.decorator_list) if _is_dataclass(one)), None)
    if at is None:
        return
    decorator = node.decorator_list[at]
    given = {word.arg: word.value for word in decorator.keywords} if isinstance(decorator, ast.Call) else {}
    frozen, equal = _is_true(given.get("frozen")), "eq" not in given
    node.decorator_list[at] = ast.parse("dataclass(init=False, eq=False, slots=True)", mode="eval").body
    if plain_values and frozen and not node.bases:
        node.decorator_list.insert(0, ast.parse(_PLAIN_VALUE, mode="eval").body)
    if "kw_only" in given:  # mypyc 2.4 stumbles over the text signature of an __init__ with such parameters
        node.body.sort(key=lambda item: not isinstance(item, ast.AnnAssign) or item.value is not None)
    fields = _fields(node)
    named = {item.name for item in node.body if isinstance(item, ast.FunctionDef)}
    texts = [_init(fields, "__post_init__" in named)]
    if equal and "__eq__" not in named:
        texts.append(_eq(node.name, fields))
        if frozen:
            texts.append(_hash(fields))
    if all(field.in_init for field in fields):
        texts.append(_reduce(node.name, fields))
    for text in texts:
        node.body += ast.parse(text).body


def _is_dataclass(decorator: ast.expr) -> bool:
    function = decorator.func if isinstance(decorator, ast.Call) else decorator
    return isinstance(function, ast.Name) and function.id == "dataclass"


def _is_true(value: ast.expr | None) -> bool:
    return isinstance(value, ast.Constant) and value.value is True


def _fields(node: ast.ClassDef) -> list[_Field]:
    return [
        _field(item.target.id, ast.unparse(item.annotation), item.value)
        for item in node.body
        if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name) and not _is_constant(item.annotation)
    ]


def _is_constant(kind: ast.expr) -> bool:
    """Of the class, and no field."""
    return isinstance(kind, ast.Subscript) and isinstance(kind.value, ast.Name) and kind.value.id == "ClassVar"


def _field(name: str, kind: str, value: ast.expr | None) -> _Field:
    if not (isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and value.func.id == "field"):
        return _Field(name, kind, value, None, in_init=True, compared=True)
    given = {word.arg: word.value for word in value.keywords}
    in_init = "init" not in given or _is_true(given["init"])
    compared = "compare" not in given or _is_true(given["compare"])
    return _Field(name, kind, given.get("default"), given.get("default_factory"), in_init, compared)


def _init(fields: list[_Field], post: bool) -> str:
    parameters, lines = [], []
    for field in fields:
        default = "" if field.default is None else f" = {ast.unparse(field.default)}"
        made = "" if field.factory is None else f"{ast.unparse(field.factory)}()"
        if not field.in_init:
            lines.append(f"    self.{field.name} = {made or default.removeprefix(' = ')}")
        elif made:
            parameters.append(f"{field.name}: {field.kind} | None = None")
            lines.append(f"    self.{field.name} = {made} if {field.name} is None else {field.name}")
        else:
            parameters.append(f"{field.name}: {field.kind}{default}")
            lines.append(f"    self.{field.name} = {field.name}")
    head = f"def __init__({', '.join(['self', *parameters])}) -> None:"
    return "\n".join([head, *lines, *(["    self.__post_init__()"] if post else []), "    pass"])


def _eq(name: str, fields: list[_Field]) -> str:
    """As that of `dataclasses`, which compares tuples: what is the same object is equal, a NaN too."""
    parts = [_same(field) for field in fields if field.compared]
    test = " and ".join(parts) or "True"
    return f"def __eq__(self, other: object) -> bool:\n    return isinstance(other, {name}) and ({test})"


def _same(field: _Field) -> str:
    mine, theirs = f"self.{field.name}", f"other.{field.name}"
    if field.kind in ("int", "bool", "str", "bytes"):
        return f"{mine} == {theirs}"
    if field.kind == "float":
        return f"({mine} == {theirs} or ({mine} != {mine} and {theirs} != {theirs}))"
    return f"({mine} is {theirs} or {mine} == {theirs})"


def _hash(fields: list[_Field]) -> str:
    values = "".join(f"self.{field.name}, " for field in fields if field.compared)
    return f"def __hash__(self) -> int:\n    return hash(({values}))"


def _reduce(name: str, fields: list[_Field]) -> str:
    values = "".join(f"self.{field.name}, " for field in fields)
    return f"def __reduce__(self) -> tuple[object, ...]:\n    return ({name}, ({values}))"
