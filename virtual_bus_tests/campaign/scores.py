"""The last scores against known truth, of fresh seeds, in scores.json: pages take their figures from there."""

from __future__ import annotations

import json
from pathlib import Path

FILE = Path(__file__).with_name("scores.json")


def keep(name: str, sentence: str) -> None:
    """Writes the score of this name over the one before."""
    scores = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    scores[name] = sentence
    FILE.write_text(f"{json.dumps(scores, indent=1, sort_keys=True)}\n", encoding="utf-8")
