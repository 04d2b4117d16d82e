"""Notes how late each cycle of the driver begins: Python imports this file where PYTHONPATH leads to it.

SIGUSR1 begins, SIGUSR2 writes the latenesses [s] to $CANBASE_PROBE as JSON. The product has no way in for this.
"""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from canbase_driver.cia301.frame import Frame
    from canbase_driver.core import DriverCore

FILE = "CANBASE_PROBE"
_seen: list[float] = []


def _begin(_number: int, _frame: FrameType | None) -> None:
    from canbase_driver.core import DriverCore

    usual = DriverCore.tick

    def tick(self: DriverCore, now_s: float, lateness_s: float = 0.0) -> list[Frame]:
        _seen.append(lateness_s)
        return usual(self, now_s, lateness_s)

    DriverCore.tick = tick  # type: ignore[method-assign]


def _write(_number: int, _frame: FrameType | None) -> None:
    path = Path(os.environ[FILE])
    written = path.with_suffix(".part")
    written.write_text(json.dumps(_seen))
    written.rename(path)


if FILE in os.environ:
    signal.signal(signal.SIGUSR1, _begin)
    signal.signal(signal.SIGUSR2, _write)
