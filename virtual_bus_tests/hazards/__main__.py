"""`make hazards`: checks hazards.yaml and writes docs/hazards.md and the ten rows of docs/safety.md."""

from __future__ import annotations

import sys

from canbase_hazards import catalogue
from hazards import page, proofs


def main() -> int:
    """Exit code 0: every row names tests that exist, and the pages are written."""
    rows = catalogue.load()
    problems = [f"{row.id}: {why}" for row in rows.rows for name in row.tests if (why := proofs.problem(name))]
    for line in problems:
        print(line, file=sys.stderr)
    if not problems:
        for path, text in page.pages(rows).items():
            path.write_text(text, encoding="utf-8")
    print(f"{len(rows.rows)} rows, {len(problems)} problems", file=sys.stderr)
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
