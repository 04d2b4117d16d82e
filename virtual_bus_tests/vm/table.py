"""docs/stop_times_vm.md from the rows that the virtual robot has left: python virtual_bus_tests/vm/table.py."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
ROWS = ROOT / "build" / "vm" / "job" / "rows.jsonl"
PAGE = ROOT / "docs" / "stop_times_vm.md"

HEAD = """# Stop times in a virtual robot

Made by `make vm-test`; do not edit. A Debian 12 guest in QEMU with its own kernel, systemd as the first process and
two emulated CAN controllers on one bus: the services as `canbase install` makes them on can0, simulated drives on
can1. Times are taken inside, in instruction-counted time (one processor, a billion instructions a second): they do
not depend on how busy the computer is that runs the guest. 50 Hz control cycle, all timeouts at their defaults.
*Stands*: from the event to the last time that a wheel moved, by ground truth. *Again*: until the part ran, or the
robot was ready, again. How the times on the bench compare: [stop_times.md](stop_times.md).

| what | how | stands after | way | again after | then |
|---|---|---|---|---|---|
"""


def number(value: float | None, factor: float, unit: str) -> str:
    """A value with its unit, a dash where there is none."""
    return "–" if value is None else f"{value * factor:.0f} {unit}"


def line(row: dict[str, Any]) -> str:
    """One row of the table."""
    stands, way = number(row["stands_s"], 1000, "ms"), number(row["way_m"], 1000, "mm")
    again = "–" if row["again_s"] is None else f"{row['again_s']:.1f} s"
    return f"| {row['scenario']} | {row['what']} | {stands} | {way} | {again} | {row['then']} |"


def main() -> int:
    """Exit code 1, and the page is left as it was, when a scenario failed or there is none."""
    rows = [json.loads(text) for text in ROWS.read_text().splitlines()] if ROWS.exists() else []
    bad = [row for row in rows if row["failure"]]
    for row in bad:
        print(f"{row['scenario']}: {row['failure']}", file=sys.stderr)
    if bad or not rows:
        return 1
    PAGE.write_text(HEAD + "".join(f"{line(row)}\n" for row in rows), encoding="utf-8")
    print(f"{len(rows)} scenarios, all as promised: {PAGE.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
