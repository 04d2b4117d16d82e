"""From power on to Operation Enabled on a bus with a bit rate, in virtual time: two drives of each kind, and eight.

Counted are the drives' own delays and the time that each frame takes on the bus; Python's own time is not (`startup.py`
measures that). `python benchmarks/boot.py` prints the table.
"""

from __future__ import annotations

from canbase_sim.personality import PERSONALITIES
from figures import Figure
from support.chain_world import bench_robot, robot_of
from support.crews import robot_with
from support.timed_bus import TimedBus, on_a_wire

BUDGET_S, BUDGET_RATIO = 1.0, 1.5
LONGEST_S = 10.0
BITRATES = (500_000, 1_000_000)


def few(bitrate: int) -> TimedBus:
    """Two plain drives."""
    return TimedBus(on_a_wire(bench_robot(), bitrate))


def many(bitrate: int) -> TimedBus:
    """Eight."""
    robot = robot_of(*((node_id, 0, "left" if node_id % 2 else "right") for node_id in range(1, 9)))
    return TimedBus(on_a_wire(robot, bitrate))


def measure() -> list[Figure]:
    """Two drives, and eight beside each other, at each bit rate."""
    return [figure for bitrate in BITRATES for figure in _measure(bitrate)]


def _measure(bitrate: int) -> list[Figure]:
    two, eight = few(bitrate), many(bitrate)
    two_s, eight_s = two.enabled_after(LONGEST_S), eight.enabled_after(LONGEST_S)
    where = f"virtual time, {bitrate // 1000} kbit/s"
    return [
        Figure(
            f"boot: power on → 2 drives enabled, {where}",
            f"{two_s:.3f} s",
            f"{len(two.heard)} frames",
            None,
            "≤ 1 s",
            two_s <= BUDGET_S,
        ),
        Figure(
            f"boot: power on → 8 drives enabled, {where}",
            f"{eight_s:.3f} s",
            f"2 drives: {two_s:.3f} s; {len(eight.heard)} frames",
            eight_s / two_s,
            "≤ 1.5 × two drives",
            eight_s <= BUDGET_RATIO * two_s,
        ),
    ]


def table() -> list[str]:
    """A line for each kind: two drives of it."""
    rows = ["| two drives of | enabled after [s] |", "|---|---|"]
    for kind in sorted(PERSONALITIES):
        rows.append(f"| `{kind}` | {TimedBus(on_a_wire(robot_with(kind))).enabled_after(LONGEST_S):.2f} |")
    return rows


if __name__ == "__main__":
    print(*measure(), *table(), sep="\n")
