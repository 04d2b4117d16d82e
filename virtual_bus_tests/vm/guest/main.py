"""Goes through the scenarios after boot, on through reboots, and leaves a row for each: python -m vm.guest.main."""

from __future__ import annotations

import faulthandler
import json
import signal
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import FrameType

from vm.guest import (
    bus_failures,
    canopennode,
    computer_failures,
    integrator,
    processor,
    ros2_canopen,
    second_master,
    two_robots,
    unit_failures,
    upgrade,
)
from vm.guest.robot import Robot
from vm.guest.scenario import Row, Scenario
from vm.guest.shutdown_trace import FOLDER
from vm.guest.system import BrokenPromiseError

LIMIT_S = 90.0
"""For one scenario, in the guest's time."""
LAST_LIMIT_S = 30.0
"""After that, for one that does not even notice: then this process ends, with the stacks of its threads."""
BEGINS = "@begin "
"""Tells the host which scenario the guest is in."""
WANTED = Path("/run/wanted.json")
ROWS = FOLDER / "rows.jsonl"
PLAN = FOLDER / "plan.json"

FIRST: dict[str, Scenario] = {
    "cold boot": computer_failures.cold_boot,
    "goal": computer_failures.goal,
    "processor": processor.processor,
    "processor at standard rates": processor.processor_at_standard_rates,
    "support bundle": integrator.support_bundle,
    **unit_failures.KILLS,
    "power cut": bus_failures.power_cut,
    "link down": bus_failures.link_down,
    "unplugged": bus_failures.unplugged,
    "masked": unit_failures.masked,
    "journal": integrator.journal,
    "full disk": computer_failures.full_disk,
    "installed again": integrator.installed_again,
    "upgrade": upgrade.upgraded,
    "two robots": two_robots.two_robots,
    "CANopenNode": canopennode.canopennode,
    "CANopenNode writes a setpoint": second_master.writes_a_setpoint,
    "CANopenNode takes a drive out": second_master.takes_a_drive_out,
    "drives of ros2_canopen": ros2_canopen.drives_of_ros2_canopen,
}
SECOND: dict[str, Scenario] = {
    **unit_failures.ORDERLY,
    "error passive": bus_failures.error_passive,
    "bus-off": bus_failures.bus_off,
    "reboot": computer_failures.reboot,
    "freeze": computer_failures.freeze,
}
"""For two guests that run side by side. The serial adapter stays until the reboot; that and the freeze come last."""
AFTER_BOOT: dict[str, Scenario] = {"reboot": computer_failures.after_reboot, "freeze": computer_failures.after_freeze}
ALL = {**FIRST, **SECOND}
SHORT = (
    "cold boot",
    "goal",
    "driver SIGKILL",
    "watchdog SIGKILL",
    "unplugged",
    "masked",
    "journal",
    "restart driver",
    "reboot",
)
"""For a look of ten minutes: what only services of systemd and a real adapter show. The exit matrix has the other ways
to end; the longest scenarios (freeze, upgrade, two robots, errors of the serial adapter) run with all."""
GROUPS: dict[str, Sequence[str]] = {"first": tuple(FIRST), "second": tuple(SECOND), "short": SHORT}


@dataclass(slots=True)
class Plan:
    """What is still to be done. It survives a reboot: `open` is the scenario that has asked for it."""

    left: list[str] = field(default_factory=list)
    open: str = ""

    def save(self) -> None:
        """It is not overtaken by the reset: the host writes at once."""
        PLAN.write_text(json.dumps(asdict(self)))


def names(words: Sequence[str]) -> list[str]:
    """The scenarios that these words mean: names, parts of names, or a group; in the order of the table."""
    if not words:
        return list(ALL)
    chosen = [name for word in words for name in _meant(word)]
    if not chosen:
        raise BrokenPromiseError(f"no scenario is called {' or '.join(words)}; there are: {', '.join(ALL)}")
    return [name for name in ALL if name in chosen]


def shared_out(chosen: Sequence[str], guests: int) -> list[list[str]]:
    """Among guests that run side by side."""
    halves = [[name for name in chosen if name in half] for half in (FIRST, SECOND)]
    return [part for part in (halves if guests > 1 else [list(chosen)]) if part]


def _meant(word: str) -> list[str]:
    if word in GROUPS:
        return list(GROUPS[word])
    return [word] if word in ALL else [each for each in ALL if word in each]


def plan() -> Plan:
    """The one that a reboot has interrupted, or a new one."""
    if PLAN.exists():
        return Plan(**json.loads(PLAN.read_text()))
    return Plan(names(json.loads(WANTED.read_text())))


def main() -> int:
    """Exit code 0: every scenario came out as promised."""
    todo = plan()
    robot = Robot()
    while todo.left or todo.open:
        after_boot = bool(todo.open)
        name = todo.open or todo.left.pop(0)
        scenario = AFTER_BOOT[name] if after_boot else ALL[name]
        todo.open = name if name in AFTER_BOOT and not after_boot else ""
        if name in AFTER_BOOT:
            todo.save()
        _note(name, *_outcome(name, scenario, robot))
        todo.open = ""
        robot.order(None)
    return int(any(json.loads(line)["failure"] for line in ROWS.read_text().splitlines()))


@contextmanager
def bounded(name: str) -> Iterator[None]:
    """No scenario is waited for longer than its limits."""

    def too_long(number: int, frame: FrameType | None) -> None:
        raise BrokenPromiseError(f"{name} was not through in {LIMIT_S:.0f} s")

    signal.signal(signal.SIGALRM, too_long)
    signal.setitimer(signal.ITIMER_REAL, LIMIT_S)
    faulthandler.dump_traceback_later(LIMIT_S + LAST_LIMIT_S, exit=True)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        faulthandler.cancel_dump_traceback_later()


def _outcome(name: str, scenario: Scenario, robot: Robot) -> tuple[Row | None, str, float]:
    print(f"{BEGINS}{name}", flush=True)
    begun_s = time.monotonic()
    try:
        with bounded(name):
            return scenario(robot), "", time.monotonic() - begun_s
    except Exception as error:  # noqa: BLE001 - the next scenario may tell more
        traceback.print_exc()
        return None, f"{type(error).__name__}: {error}", time.monotonic() - begun_s


def _note(name: str, row: Row | None, failure: str, took_s: float) -> None:
    told = {"name": name, "failure": failure, "took_s": round(took_s, 1), "row": asdict(row) if row else None}
    print(json.dumps(told), flush=True)
    with ROWS.open("a") as file:
        file.write(json.dumps(told) + "\n")


if __name__ == "__main__":
    sys.exit(main())
