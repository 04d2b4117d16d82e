"""`canbase bus scan`, from received frames and answers to its rows. Pure."""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass, replace

from canbase_commissioning.bus_monitor import OURS, HeardNode
from canbase_commissioning.identification import NodeCard
from canbase_config.profile_file import guess, load_profile
from canbase_config.robot import Robot


@dataclass(frozen=True, slots=True)
class ScanRow:
    """One node. `profile`: for `profile` in robot.yaml; empty: no profile knows this identity."""

    node_id: int
    what: str
    nmt_state: str
    heartbeat: str
    profile: str
    vendor_id: int | None = None
    product_code: int | None = None
    revision: int | None = None
    serial: int | None = None
    firmware: str = ""
    in_robot: str = ""
    """Its joints in robot.yaml."""


def scan_rows(
    heard: dict[int, HeardNode], cards: dict[int, NodeCard], robot: Robot | None, twins: Set[int] = frozenset()
) -> list[ScanRow]:
    """A row for each node that sent a frame or answered, by node id; those of robot.yaml that are missing too.

    `twins`: node ids at which more than one drive answers.
    """
    wired = {drive.node_id for drive in robot.drives} if robot else set()
    rows = [
        _row(node_id, heard.get(node_id), cards.get(node_id), robot) for node_id in sorted({*heard, *cards, *wired})
    ]
    return [replace(row, what=f"{TWINS}: {row.what}") if row.node_id in twins else row for row in rows]


def twins_advice(twins: Set[int]) -> str:
    """What to do about node ids that several drives have."""
    nodes = ", ".join(map(str, sorted(twins)))
    return f"node {nodes}: two drives or more answer. canbase bus adopt gives each drive a separate node id"


def silent(heard: dict[int, HeardNode], cards: dict[int, NodeCard]) -> list[str]:
    """A sentence for the nodes that answer SDO and send nothing by themselves, for each reason."""
    quiet = [card for node_id, card in sorted(cards.items()) if node_id not in heard or heard[node_id].sends_nothing]
    by_reason: dict[str, list[int]] = {}
    for card in quiet:
        by_reason.setdefault(_why_silent(card), []).append(card.node_id)
    return [f"node {', '.join(map(str, ids))}: answers SDO and sends nothing; {why}" for why, ids in by_reason.items()]


def _why_silent(card: NodeCard) -> str:
    if card.heartbeat_ms is None:
        return "it has no heartbeat (1017h); only a drive that can be watched gets power from canbase"
    if card.heartbeat_ms:
        return (
            f"its heartbeat is set to {card.heartbeat_ms} ms and did not come. It may begin when the drive "
            "restarts; does the cable carry its frames?"
        )
    return (
        "its heartbeat is off (1017h = 0), and in NMT pre-operational no PDOs are sent. That is usual for a new drive; "
        "canbase's driver switches the heartbeat on at its start"
    )


def missing(rows: list[ScanRow]) -> list[int]:
    """Node ids of robot.yaml that are not on the bus."""
    return [row.node_id for row in rows if row.what == NOT_HERE]


NOT_HERE = "not on the bus"
TWINS = "two drives or more"


def _row(node_id: int, heard: HeardNode | None, card: NodeCard | None, robot: Robot | None) -> ScanRow:
    joints = [drive.joint for drive in robot.drives if drive.node_id == node_id] if robot else []
    state = heard.state_text if heard else "answers" if card else ""
    beat = _heartbeat(heard, card)
    if card is None:
        what = OURS.get(node_id, "sends frames; not queried, or no answer" if heard else NOT_HERE)
        return ScanRow(node_id, what, state, beat, "", in_robot=", ".join(joints))
    profile = guess(card.vendor_id, card.product_code) or ("generic" if card.profile_402 else "")
    return ScanRow(
        node_id,
        _what(card, profile),
        state,
        beat,
        profile,
        card.vendor_id,
        card.product_code,
        card.revision,
        card.serial,
        card.firmware,
        ", ".join(joints),
    )


def _what(card: NodeCard, profile: str) -> str:
    kind = load_profile(profile).title if profile else "no motor drive" if card.device_type is not None else "unknown"
    return f"{card.name} ({kind})" if card.name else kind


def _heartbeat(heard: HeardNode | None, card: NodeCard | None) -> str:
    """What was received counts before what is set."""
    if heard is not None and not math.isnan(heard.period_s):
        return f"{heard.period_s * 1000:.0f} ms"
    if card is None or card.heartbeat_ms is None:
        return "received once" if heard is not None and heard.heartbeats_at else "none received"
    return f"set to {card.heartbeat_ms} ms, none received" if card.heartbeat_ms else "off (1017h = 0)"
