"""`make structure`: writes the tree of the sources into docs/architecture.md, and draws docs/states.svg."""

from __future__ import annotations

import sys

from site_builder import state_picture, structure
from site_builder.modules import ROOT
from support.marked_page import rewritten

PAGE = ROOT / "docs" / "architecture.md"
STATES = ROOT / "docs" / "states.svg"


def main() -> int:
    """Writes the section between the marks of `make structure`, and the picture."""
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(rewritten(text, structure.COMMAND, structure.section(ROOT)), encoding="utf-8")
    STATES.write_text(state_picture.picture(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
