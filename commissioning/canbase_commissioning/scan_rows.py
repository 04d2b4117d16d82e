"""`canbase scan`, from received frames and answers to its rows. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass

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


def scan_rows(heard: dict[int, HeardNode], cards: dict[int, NodeCard], robot: Robot | None) -> list[ScanRow]:
    """A row for each node that sent a frame or answered, by node id; those of robot.yaml that are missing too."""
    wired = {drive.node_id for drive in robot.drives} if robot else set()
    return [
        _row(node_id, heard.get(node_id), cards.get(node_id), robot) for node_id in sorted({*heard, *cards, *wired})
    ]


def missing(rows: list[ScanRow]) -> list[int]:
    """Node ids of robot.yaml that are not on the bus."""
    return [row.node_id for row in rows if row.what == NOT_HERE]


NOT_HERE = "not on the bus"


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
