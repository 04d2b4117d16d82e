"""`python -m compiled.same --seeds 1000`: the same seeds interpreted and compiled have to give the same frames."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys

from compiled.copies import outdated
from compiled.modules import BUILD, ROOT, hot_modules

TESTS = ROOT / "virtual_bus_tests"


def lines(compiled: bool, first: int, seeds: int) -> subprocess.Popen[str]:
    """A process that prints the digests of these seeds."""
    path = f"{BUILD}{os.pathsep}{TESTS}" if compiled else str(TESTS)
    command = [sys.executable, "-m", "compiled.digest", "--first", str(first), "--seeds", str(seeds)]
    return subprocess.Popen(command, env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.PIPE, text=True)


def main() -> int:
    """Exit code 1: a line differs, or one is missing."""
    parser = argparse.ArgumentParser(prog="compiled.same", description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seeds", type=int, default=10)
    given = parser.parse_args()
    if outdated():
        print(f"changed since they were compiled: {', '.join(outdated())}; run make compiled")
        return 1
    both = [lines(compiled, given.first, given.seeds) for compiled in (False, True)]
    told = [process.communicate()[0].splitlines() for process in both]
    counts = [int(each.pop(0)) for each in told]
    if counts != [0, len(hot_modules())]:
        print(f"{counts} modules are compiled, wanted: [0, {len(hot_modules())}]")
        return 1
    differ = [(one, other) for one, other in zip(*told, strict=False) if one != other]
    for one, other in differ[:20]:
        print(f"interpreted: {one}\n   compiled: {other}")
    whole = all(len(each) == 2 * given.seeds for each in told)
    print(f"{len(told[0])} and {len(told[1])} of {2 * given.seeds} runs, {len(differ)} of them differ")
    return 0 if whole and not differ else 1


if __name__ == "__main__":
    sys.exit(main())
