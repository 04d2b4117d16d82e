"""Answers of a tool against known truth: the command that scores them, and the last scores, from which pages take
their figures (scores.json).
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, Final

from campaign.nightly import first_seed

RIGHT, CANNOT_TELL, WRONG = "right", "cannot tell", "wrong"
MOST_WRONG: Final = 0.01
"""Share of the answers."""
FILE = Path(__file__).with_name("scores.json")


def main(
    tool: str,
    what: str,
    doc: str | None,
    seeds: int,
    answers: Callable[[Iterable[int]], Iterable[Any]],
    told: Callable[[Any], str],
    arguments: Sequence[str] | None = None,
) -> int:
    """Seeds from the command line; the exit code. `seeds`: how many by default; `what`: what an answer is about."""
    parser = argparse.ArgumentParser(prog=f"campaign.{tool}_score", description=doc)
    parser.add_argument("--seeds", type=int, default=seeds, help="how many")
    parser.add_argument(
        "--first", type=int, default=first_seed(datetime.now(timezone.utc).date()), help="the first of them"
    )
    parser.add_argument("--seed", type=int, help="tell this one alone")
    parser.add_argument("--keep", action="store_true", help="the score goes to scores.json, and so into the pages")
    given = parser.parse_args(arguments)
    scores: Counter[str] = Counter()
    for answer in answers(range(given.first, given.first + given.seeds) if given.seed is None else (given.seed,)):
        scores[answer.score] += 1
        if answer.wrong or given.seed is not None:
            print(told(answer), flush=True)
    total = scores.total()
    score = f"{', '.join(f'{scores[name]} {name}' for name in (RIGHT, CANNOT_TELL, WRONG))} of {total} {what}"
    print(score)
    if given.keep:
        kept = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
        FILE.write_text(f"{json.dumps(kept | {tool: score}, indent=1, sort_keys=True)}\n", encoding="utf-8")
    return 1 if scores[WRONG] > MOST_WRONG * total else 0
