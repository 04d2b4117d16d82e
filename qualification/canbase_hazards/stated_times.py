"""Times that the documents state: the judges of the campaign read them here, never in the code that they judge.

`stated_s`: how soon the layer of a row of hazards.yaml acts (docs/hazards.md shows the
same formulas). The constants are those of docs/bus.md, which no key of robot.yaml changes. Tests compare both with the
pages and with the product.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final

from canbase_config.robot import Robot
from canbase_hazards.catalogue import FILE
from canbase_hazards.formula import evaluate

QUICK_STOP_S: Final = 0.15
"""Rung 1 of the watchdog's ladder: a drive that is still enabled after that gets the next one."""
PRE_OPERATIONAL_S: Final = 0.15
"""Rung 2."""
DISABLE_VOLTAGE_S: Final = 0.1
"""Rung 3."""
HEARTBEAT_WITHHELD_S: Final = 0.1
"""Rung 4; then the node is reset."""
RESET_FEEDBACK_S: Final = 1.5
"""A reset is accepted with feedback of each drive that is at most so old."""
STATE_PERIOD_S: Final = 0.1
"""velocity_mux/state and safety_filter/state are published so often ..."""
STATE_LOST_S: Final = 0.3
"""... and count as lost after that: one may get lost, and the next one may be late."""

_ROW: Final = re.compile(r"^- id: (\w+)$|^  within_s: (.+)$", re.MULTILINE)


@lru_cache(maxsize=1)
def formulas() -> dict[str, str]:
    """`within_s` of each row that has one, by its id. As text: the whole catalogue takes 2 s to read and validate."""
    found: dict[str, str] = {}
    row_id = ""
    for match in _ROW.finditer(FILE.read_text(encoding="utf-8")):
        row_id = match[1] or row_id
        if match[2]:
            found[row_id] = match[2].strip("'\"")
    return found


def stated_s(row_id: str, robot: Robot) -> float:
    """How soon the layer of this row acts, for one robot [s]. Raises KeyError for a row without a time."""
    return evaluate(formulas()[row_id], robot)
