"""What `canbase doctor` finds out, as plain values: one `Check` a row, and the table and exit code made of them.

Pure. A new row is a function that returns a `Check`, added to `CHECKS` of default_checks.py or to a `Symptom`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from canbase_config.load import Loaded


class Verdict(Enum):
    """The result of a check."""

    OK = "ok"
    WARN = "warn"
    """It works, or cannot be judged now; a person should look at it."""
    INCONCLUSIVE = "inconclusive"
    """It took too long, and so did everything else on this computer: no evidence for or against."""
    FAIL = "FAIL"


STYLE = {Verdict.OK: "green", Verdict.WARN: "yellow", Verdict.INCONCLUSIVE: "magenta", Verdict.FAIL: "bold red"}


INCONCLUSIVE = 3
"""Exit code."""
RESTART = "restart its service, or end `canbase up` and start it again"
"""What to do about a process that hangs."""


@dataclass(frozen=True, slots=True)
class Check:
    """One row: what was looked at, what was found there, and what to do next (empty when all is well)."""

    name: str
    verdict: Verdict
    found: str
    advice: str = ""


def ok(name: str, found: str) -> Check:
    """All is well."""
    return Check(name, Verdict.OK, found)


def warn(name: str, found: str, advice: str) -> Check:
    """Not wrong, but somebody should look at it."""
    return Check(name, Verdict.WARN, found, advice)


def fail(name: str, found: str, advice: str) -> Check:
    """Wrong: this keeps the robot from working."""
    return Check(name, Verdict.FAIL, found, advice)


def too_slow(overload: str, name: str, found: str, advice: str) -> Check:
    """A time that is too long: a failure, or no evidence where `overload` shows that this computer itself is late."""
    if not overload:
        return fail(name, found, advice)
    evidence = f"{found}; this computer is overloaded: {overload}"
    return Check(
        name, Verdict.INCONCLUSIVE, evidence, "call doctor again when the computer has time; see top, nice, chrt"
    )


def good_file(loaded: Loaded) -> Check:
    """The first row: a file that is wrong would have ended the command."""
    robot = loaded.robot
    return ok("robot.yaml", f"{loaded.path} is good: {robot.name}, {len(robot.drives)} drives")


def commissioning(loaded: Loaded) -> list[Check]:
    """Whether a person has looked at the wheels and measured the floor; nothing where the bus has no wire."""
    from canbase_config.commissioned import uncommissioned, uncommissioned_mps

    if loaded.robot.bus.is_virtual:
        return []
    why = uncommissioned(loaded.robot)
    if not why:
        return [ok("commissioning", "done, and robot.yaml has not changed since"), *_self_stop_proof(loaded)]
    slow = f"no faster than safety.uncommissioned_mps, {uncommissioned_mps(loaded.robot):g} m/s"
    cure = "canbase setup commission: wrong signs and scales show on the floor alone"
    return [warn("commissioning", f"{why}; {slow}", cure), *_self_stop_proof(loaded)]


def _self_stop_proof(loaded: Loaded) -> list[Check]:
    """Whether the driver gives power to these drives; nothing where robot.yaml does not ask for a proof."""
    from canbase_config.commissioned import kind_alone, without_proof

    if not loaded.robot.safety.require_self_stop:
        return []
    why = without_proof(loaded.robot)
    if not why and (unnumbered := kind_alone(loaded.robot)):
        return [warn("self-stop proof", unnumbered, "note each exchange of a drive, and prove it")]
    if not why:
        return [ok("self-stop proof", "each drive is proven to stop by itself (safety.require_self_stop)")]
    cure = "prove it; or wire STO, and set safety.require_self_stop: false"
    return [fail("self-stop proof", f"no drive gets power: {why}", cure)]


def first_failure(checks: Sequence[Check]) -> Check | None:
    """The first row that failed; None when none did."""
    return next((check for check in checks if check.verdict is Verdict.FAIL), None)


def exit_code(checks: Sequence[Check]) -> int:
    """0: nothing failed; 1: something did; INCONCLUSIVE: neither, and something cannot be judged."""
    if first_failure(checks) is not None:
        return 1
    return INCONCLUSIVE if any(check.verdict is Verdict.INCONCLUSIVE for check in checks) else 0


def table(title: str, checks: Sequence[Check]) -> Table:
    """For a terminal: a line per check, with what to do next below what was found."""
    result = Table(title=title, title_justify="left", show_lines=False)
    for column in ("check", "", "found; what to do next"):
        result.add_column(column, overflow="fold")
    for check in checks:
        style = STYLE[check.verdict]
        text = Text(check.found)
        if check.advice:
            text.append(f"\n→ {check.advice}", style=style)
        result.add_row(Text(check.name), Text(check.verdict.value, style=style), text)
    return result
