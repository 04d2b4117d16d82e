"""When the guest goes down, the simulated drives tell how the wheels came to stand since the moment in MOMENT."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from canbase_sim.control import SimControl
from vm.guest.standstill import standstill

FOLDER = Path("/mnt")
"""A folder of the host: what is in there outlives a reset."""
WORDS = FOLDER / "last_words.json"
MOMENT = Path("/run/canbase-vm-moment")


def main() -> None:
    """Nothing happens unless somebody asked for it."""
    if not MOMENT.exists():
        return
    moment_s = float(MOMENT.read_text())
    with SimControl("/run/sim.sock") as sim:
        rows = sim.trace(moment_s)
    told = asdict(standstill(rows, moment_s)) | {"watched_s": rows[-1][0] - moment_s}
    WORDS.write_text(json.dumps(told))


if __name__ == "__main__":
    main()
