"""docs/states.svg: the driver's states, drawn from the table of transitions that it runs by."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from typing import Final

from canbase_driver.supervision.phases import WAITING, Phase
from canbase_driver.supervision.state_machine import TRANSITIONS

WIDTH, HEIGHT = 1180, 640
BOX_W, BOX_H = 116, 40
LINE = 15
AT: Final[dict[Phase, tuple[int, int]]] = {
    Phase.OFFLINE: (100, 70),
    Phase.BOOTING: (250, 70),
    Phase.DISARMED: (400, 70),
    Phase.PREPARING: (550, 70),
    Phase.ARMING: (700, 70),
    Phase.ENABLING: (1020, 70),
    Phase.ENABLED: (1020, 290),
    Phase.RAMP: (1020, 510),
    Phase.QUICK_STOP: (700, 510),
    Phase.POWER_OFF: (400, 510),
    Phase.LATCHED: (100, 510),
}
"""Middle of each box."""
GROUP = (24, 24, 752, 188)
"""x, y, width and height of the box around all phases that wait for power."""
STYLE = (
    "text{font:13px sans-serif;fill:#222}.name{font-weight:bold;text-anchor:middle}.why{font-size:11.5px}"
    "rect{fill:#fff;stroke:#333;rx:6}.group{fill:#eef3f8;stroke:#9ab}.stop{fill:#fdeeee}.on{fill:#eaf6ea}"
    "path{fill:none;stroke:#555;stroke-width:1.4;marker-end:url(#tip)}"
)
Edge = tuple[Phase | None, Phase]
PATHS: Final[dict[Edge, tuple[str, int, int]]] = {
    (None, Phase.ENABLING): ("M776,70 L958,70", 790, 62),
    (None, Phase.LATCHED): ("M100,212 L100,486", 110, 340),
    (Phase.ENABLING, Phase.ENABLED): ("M1020,90 L1020,266", 1030, 180),
    (Phase.ENABLING, Phase.QUICK_STOP): ("M962,88 L716,486", 655, 330),
    (Phase.ENABLED, Phase.RAMP): ("M1020,310 L1020,486", 1030, 390),
    (Phase.ENABLED, Phase.QUICK_STOP): ("M962,308 L746,487", 908, 424),
    (Phase.RAMP, Phase.QUICK_STOP): ("M962,510 L762,510", 790, 534),
    (Phase.RAMP, Phase.POWER_OFF): ("M1020,530 C1020,610 420,610 404,534", 690, 576),
    (Phase.QUICK_STOP, Phase.POWER_OFF): ("M642,510 L462,510", 500, 478),
    (Phase.POWER_OFF, Phase.LATCHED): ("M342,510 L162,510", 176, 500),
    (Phase.POWER_OFF, Phase.DISARMED): ("M440,490 C472,420 476,300 476,84 L461,74", 484, 300),
}
"""The line of each edge, and where its words begin. None: from any phase that waits for power."""
RESET: Final = "M60,490 L60,216"
"""StateMachine.reset, which no row of the table does."""
INSIDE = (Phase.OFFLINE, Phase.BOOTING, Phase.DISARMED, Phase.PREPARING, Phase.ARMING)


def edges() -> dict[Edge, list[str]]:
    """The reasons of each edge, as the table has them. Those between phases that wait for power are in `waits`."""
    found: dict[Edge, list[str]] = {}
    for row in TRANSITIONS:
        begin = None if row.before == WAITING else row.before[0]
        if row.after not in INSIDE or begin not in (None, *INSIDE):
            words = found.setdefault((begin, row.after), [])
            if row.label not in words:
                words.append(row.label)
    return found


def waits() -> dict[Phase, list[str]]:
    """Why the driver waits in each of these phases."""
    rows = [row for row in TRANSITIONS if row.after in INSIDE and row.before[0] in INSIDE]
    return {phase: [row.label for row in rows if row.after is phase] for phase in INSIDE}


def picture() -> str:
    """The whole SVG. Raises KeyError for an edge that has no line: then the table has a new one."""
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">',
            "<title>The states of the driver</title>",
            f"<style>{STYLE}</style>",
            '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
            '<path d="M0,0 L8,4 L0,8 z" style="fill:#555;stroke:none;marker-end:none"/></marker></defs>',
            '<rect class="group" x="{}" y="{}" width="{}" height="{}"/>'.format(*GROUP),
            *_boxes(),
            *_lines(),
            f'<path d="{RESET}" style="stroke-dasharray:5 4"/>',
            *_words(["reset"], 66, 310),
            "</svg>\n",
        ]
    )


def _boxes() -> Iterator[str]:
    for phase, (x, y) in AT.items():
        kind = "on" if phase is Phase.ENABLED else "" if phase in (*INSIDE, Phase.ENABLING) else "stop"
        left, top = x - BOX_W // 2, y - BOX_H // 2
        yield f'<rect class="{kind}" x="{left}" y="{top}" width="{BOX_W}" height="{BOX_H}"/>'
        yield f'<text class="name" x="{x}" y="{y + 5}">{escape(phase.value)}</text>'
    for phase, reasons in waits().items():
        yield from _words(reasons, AT[phase][0] - BOX_W // 2, 112)


def _lines() -> Iterator[str]:
    for edge, reasons in edges().items():
        line, x, y = PATHS[edge]
        yield f'<path d="{line}"/>'
        yield from _words(reasons, x, y - LINE * (len(reasons) - 1) // 2)


def _words(reasons: list[str], x: int, y: int) -> Iterator[str]:
    for number, reason in enumerate(reasons):
        yield f'<text class="why" x="{x}" y="{y + LINE * number}">{escape(reason)}</text>'
