"""`make hazards`: checks hazards.yaml and writes the ten rows of docs/safety.md."""

from __future__ import annotations

import argparse
import sys

from canbase_hazards import catalogue
from hazards import page, proofs
from support.marked_page import rewritten


def main() -> int:
    """Exit code 0: every row names tests that exist, and the page is up to date (with --check) or written."""
    parser = argparse.ArgumentParser(prog="make hazards", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 when the page is out of date")
    check = parser.parse_args().check
    rows = catalogue.load()
    problems = [f"{row.id}: {why}" for row in rows.rows for name in row.tests if (why := proofs.problem(name))]
    text = page.PAGE.read_text(encoding="utf-8")
    made = rewritten(text, page.COMMAND, page.ten_rows(rows, page.sample_robot()))
    if check and made != text:
        problems.append("docs/safety.md is out of date: run `make hazards`")
    for line in problems:
        print(line, file=sys.stderr)
    if not check and not problems:
        page.PAGE.write_text(made, encoding="utf-8")
    print(f"{len(rows.rows)} rows, {len(problems)} problems", file=sys.stderr)
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
