"""`make structure`: draws docs/states.svg, and puts measured figures into the sentences of pages."""

from __future__ import annotations

import sys

from site_builder import figures, state_picture
from site_builder.modules import ROOT

STATES = ROOT / "docs" / "states.svg"


def main() -> int:
    """Writes the picture of the driver's states, and the figures."""
    STATES.write_text(state_picture.picture(), encoding="utf-8")
    figures.write(ROOT)
    return 0


if __name__ == "__main__":
    sys.exit(main())
