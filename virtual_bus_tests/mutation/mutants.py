"""Mutants of a source text: the operators of cosmic-ray, and three for what it leaves alone, which tables live on.

Left out: annotations, docstrings, texts with values, and that a dataclass is frozen (mypy sees to that), which no
behaviour hangs on, and arithmetic that is never written by mistake.
"""

from __future__ import annotations

import ast
import difflib
from collections.abc import Iterator
from dataclasses import dataclass

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

RELATIONS = (
    ("Eq", "NotEq"), ("NotEq", "Eq"), ("Lt", "LtE"), ("Lt", "GtE"), ("LtE", "Lt"), ("LtE", "Gt"), ("Gt", "GtE"),
    ("Gt", "LtE"), ("GtE", "Gt"), ("GtE", "Lt"),
)  # fmt: skip
"""Each relation becomes its opposite, and the one that differs at the limit alone; what kills both kills the others."""
OPERATORS = frozenset(
    (
        "AddNot", "ExceptionReplacer", "NumberReplacer", "RemoveDecorator", "ReplaceAndWithOr", "ReplaceOrWithAnd",
        "ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue",
        "ZeroIterationForLoop",
        "ReplaceBinaryOperator_Add_Sub", "ReplaceBinaryOperator_Sub_Add", "ReplaceBinaryOperator_Add_Mul",
        "ReplaceBinaryOperator_Mul_Div", "ReplaceBinaryOperator_Div_Mul", "ReplaceBinaryOperator_Mul_Add",
        "ReplaceBinaryOperator_Mod_Add", "ReplaceBinaryOperator_FloorDiv_Mul", "ReplaceBinaryOperator_Pow_Mul",
        "ReplaceBinaryOperator_BitAnd_BitOr", "ReplaceBinaryOperator_BitOr_BitAnd",
        "ReplaceBinaryOperator_LShift_RShift", "ReplaceBinaryOperator_RShift_LShift",
        "ReplaceUnaryOperator_Delete_USub", "ReplaceUnaryOperator_Delete_Not",
        "ReplaceComparisonOperator_Is_IsNot", "ReplaceComparisonOperator_IsNot_Is",
        *(f"ReplaceComparisonOperator_{one}_{other}" for one, other in RELATIONS),
    )
)  # fmt: skip
"""Of cosmic-ray."""
FEWEST_ROWS = 2


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change. `before` and `after`: the lines that differ, without their indentation."""

    operator: str
    line: int
    before: str
    after: str
    source: str


def mutants(source: str) -> list[Mutant]:
    """All mutants of a module that compile, differ in behaviour as far as its syntax tells, and from each other."""
    plain = behaviour(source)
    found: dict[str, Mutant] = {}
    for operator, changed in _changes(source):
        other = behaviour(changed)
        if other not in ("", plain) and other not in found:
            found[other] = _mutant(operator, source, changed)
    return sorted(found.values(), key=lambda mutant: mutant.line)


def _changes(source: str) -> Iterator[tuple[str, str]]:
    yield from _by_cosmic_ray(source)
    tree = ast.parse(source)
    lines = _Lines(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Tuple | ast.Dict | ast.List):
            yield from _without_a_row(node, lines)
        if isinstance(node, ast.FunctionDef):
            yield from _without_a_statement(node, lines)
    yield from _with_a_neighbour(tree, lines)


def _by_cosmic_ray(source: str) -> Iterator[tuple[str, str]]:
    tree = get_ast(source)
    for name in sorted(operator_names()):
        if name.partition("/")[2] not in OPERATORS:
            continue
        operator = get_operator(name)()
        count = sum(len(list(operator.mutation_positions(node))) for node in ast_nodes(tree))
        for occurrence in range(count):
            changed = mutate_code(source, operator, occurrence)
            if changed is not None:
                yield name.partition("/")[2], changed


def _without_a_row(table: ast.Tuple | ast.Dict | ast.List, lines: _Lines) -> Iterator[tuple[str, str]]:
    """A table, or an argument list of it, loses one entry."""
    if not isinstance(getattr(table, "ctx", ast.Load()), ast.Load):
        return
    rows = _rows(table)
    for row in rows if len(rows) >= FEWEST_ROWS else ():
        yield "RowRemover", lines.without(row)


def _rows(table: ast.Tuple | ast.Dict | ast.List) -> list[tuple[ast.expr, ast.expr]]:
    if isinstance(table, ast.Dict):
        return [(key, value) for key, value in zip(table.keys, table.values, strict=True) if key is not None]
    return [(row, row) for row in table.elts]


def _without_a_statement(function: ast.FunctionDef, lines: _Lines) -> Iterator[tuple[str, str]]:
    """An assignment or a call does not happen."""
    for node in ast.walk(function):
        is_call = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
        if is_call or isinstance(node, ast.Assign | ast.AugAssign):
            assert isinstance(node, ast.stmt)
            yield "StatementRemover", lines.replaced(node, "pass")


def _with_a_neighbour(tree: ast.Module, lines: _Lines) -> Iterator[tuple[str, str]]:
    """`Enum.MEMBER` becomes the next member that the same module names."""
    named = [node for node in ast.walk(tree) if _names_a_member(node)]
    members: dict[str, list[str]] = {}
    for node in named:
        assert isinstance(node, ast.Attribute)
        known = members.setdefault(ast.unparse(node.value), [])
        if node.attr not in known:
            known.append(node.attr)
    for node in named:
        assert isinstance(node, ast.Attribute)
        owner = ast.unparse(node.value)
        known = members[owner]
        other = known[(known.index(node.attr) + 1) % len(known)]
        if other != node.attr:
            yield "MemberReplacer", lines.replaced(node, f"{owner}.{other}")


def _names_a_member(node: ast.AST) -> bool:
    return isinstance(node, ast.Attribute) and node.attr.isupper() and isinstance(node.value, ast.Name)


class _Lines:
    """A text and the places of nodes in it."""

    def __init__(self, source: str) -> None:
        self._text = source.encode()
        self._starts = [0]
        for line in source.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line.encode()))

    def replaced(self, node: ast.expr | ast.stmt, by: str) -> str:
        """The text with something else in place of `node`."""
        return self._cut(self._start(node), self._end(node), by)

    def without(self, row: tuple[ast.expr, ast.expr]) -> str:
        """The text without an entry and the comma after it."""
        end = self._end(row[1])
        rest = self._text[end:].lstrip()
        if rest.startswith(b","):
            end = len(self._text) - len(rest) + 1
        return self._cut(self._start(row[0]), end, "")

    def _cut(self, start: int, end: int, by: str) -> str:
        return (self._text[:start] + by.encode() + self._text[end:]).decode()

    def _start(self, node: ast.expr | ast.stmt) -> int:
        return self._starts[node.lineno - 1] + node.col_offset

    def _end(self, node: ast.expr | ast.stmt) -> int:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self._starts[node.end_lineno - 1] + node.end_col_offset


class _Stripper(ast.NodeTransformer):
    """Takes out what no behaviour hangs on: annotations, docstrings, texts in f-strings, options of a dataclass."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        node.annotation = ast.Constant(None)
        return self.generic_visit(node)

    def visit_arg(self, node: ast.arg) -> ast.AST:
        node.annotation = None
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.returns = None
        return self.generic_visit(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        for decorator in node.decorator_list:
            if isinstance(decorator, ast.Call):
                decorator.keywords = [word for word in decorator.keywords if word.arg not in ("frozen", "slots")]
        return self.generic_visit(node)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:
        return ast.Constant("text")

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return self.generic_visit(node) if not isinstance(node.value, ast.Constant) else ast.Pass()


def behaviour(source: str) -> str:
    """The text without what no behaviour hangs on, comments and layout too; empty when it does not compile.

    Also empty with an argument that is positional only: the `*` before keywords was taken for a product.
    """
    try:
        compile(source, "<mutant>", "exec")
        tree = ast.parse(source)
        if any(isinstance(node, ast.arguments) and node.posonlyargs for node in ast.walk(tree)):
            return ""
        return ast.unparse(_Stripper().visit(tree))
    except (SyntaxError, ValueError):
        return ""


def _mutant(operator: str, source: str, changed: str) -> Mutant:
    old, new = source.splitlines(), changed.splitlines()
    for _tag, low, high, new_low, new_high in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if old[low:high] != new[new_low:new_high]:
            before, after = (" ".join(" ".join(lines).split()) for lines in (old[low:high], new[new_low:new_high]))
            return Mutant(operator, low + 1, before, after, changed)
    raise ValueError("a mutant that differs nowhere")
