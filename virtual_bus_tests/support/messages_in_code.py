"""The texts that people read: string constants of the packages, and the pages of docs/. No bus, no ROS."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import typer

from canbase_cli.main import app

ROOT: Final = Path(__file__).parents[2]
PACKAGES: Final = (
    "action_server",
    "can_config",
    "cli",
    "commissioning",
    "deploy",
    "doctor",
    "driver",
    "fleet",
    "qualification",
    "recording",
    "runtime",
    "velocity_mux",
    "watchdog",
    "web",
)
HOLE: Final = "…"
"""In place of what an f-string puts in."""


@dataclass(frozen=True, slots=True)
class Text:
    """One constant, with its white space as single spaces, or one line of a page. `where`: file and line."""

    where: str
    text: str


def code_texts() -> Iterator[Text]:
    """Every string constant of the packages; an f-string is one, a docstring is none."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = path.relative_to(ROOT)
            yield from (Text(f"{name}:{line}", " ".join(text.split())) for line, text in _constants(path))


def _constants(path: Path) -> Iterator[tuple[int, str]]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    seen: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            seen.add(id(node.value))
        elif isinstance(node, ast.JoinedStr):
            seen |= {id(part) for part in node.values}
            yield node.lineno, "".join(str(p.value) if isinstance(p, ast.Constant) else HOLE for p in node.values)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in seen:
            yield node.lineno, node.value


def help_texts() -> Iterator[Text]:
    """What `--help` of each command says: the docstring of its function, which `code_texts` leaves out."""
    for words, command in commands().items():
        yield Text(f"canbase {words} --help", " ".join(f"{command.help or ''} {command.epilog or ''}".split()))


def page_texts() -> Iterator[Text]:
    """Every line of README and docs/, without what `make docs` generates, and without decisions and changelog: those
    describe the state of their date."""
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
        if not {"decisions", "generated"} & set(path.parts) and path.name != "changelog.md":
            for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
                yield Text(f"{path.relative_to(ROOT)}:{number}", line)


def commands() -> dict[str, Any]:
    """The click command of each line of words after `canbase`; "" is canbase itself."""
    return _below("", typer.main.get_command(app))


def _below(name: str, command: Any) -> dict[str, Any]:
    found = {name: command}
    for word, each in getattr(command, "commands", {}).items():
        found |= _below(f"{name} {word}".strip(), each)
    return found


_CALL: Final = re.compile(r"(?<![/\w'.-])canbase((?: (?!canbase\b)(?![-–—] )[^\s`;,()|\"'&<>#\\]+)+)")
_END: Final = re.compile(r"[.:?!…*]+$")
"""What ends a sentence behind a word."""


def calls(text: str) -> Iterator[tuple[str, ...]]:
    """The words behind each `canbase`, up to what ends a command line: the end of its sentence or of its quotes."""
    for match in _CALL.finditer(text):
        words = match[1].split()
        at = next((i for i, word in enumerate(words, start=1) if _END.search(word)), len(words))
        yield tuple(_END.sub("", word) for word in words[:at])


def what_is_wrong(words: tuple[str, ...], known: dict[str, Any]) -> str:
    """Why there is no such command line; empty: there is. A word that is no command is the finding itself."""
    name = ""
    for word in words:
        if f"{name} {word}".strip() not in known:
            if word and not word.startswith("-") and hasattr(known[name], "commands"):
                return word
            break
        name = f"{name} {word}".strip()
    options = [word.partition("=")[0] for word in words if word.startswith("--") and len(word) > len("--")]
    if "--ros-args" in options:
        options = options[: options.index("--ros-args")]
    unknown = [option for option in options if option not in _options_of(known[name])]
    return f"{name} takes no {', '.join(unknown)}" if unknown else ""


def _options_of(command: Any) -> set[str]:
    taken = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    return taken | {"--help"}
