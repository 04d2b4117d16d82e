"""`make structure`: draws docs/states.svg."""

from __future__ import annotations

import sys

from site_builder import state_picture
from site_builder.modules import ROOT

STATES = ROOT / "docs" / "states.svg"


def main() -> int:
    """Writes the picture of the driver's states."""
    STATES.write_text(state_picture.picture(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
