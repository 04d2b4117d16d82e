"""`python -m campaign.stops`: how fast and how far until the base stands, for each stop and each lie, over many runs.

Virtual time, ground truth of the plant. The base drives at a drawn speed, then one fault begins and stays.
"""

from __future__ import annotations

import argparse
import os
import pickle
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random

from campaign.faults import FAULTS
from campaign.scenario import Start
from canbase_velocity.twist import Twist
from exit_matrix.marked import rewritten

COMMAND = "make stops"
STOPS = (
    "driver_dies", "velocity_dies", "watchdog_dies", "driver_hangs", "velocity_hangs", "watchdog_hangs",
    "driver_repeats", "driver_ignores_zero", "cable_cut", "cable_cut_to_drives", "cable_cut_from_drives",
    "cable_cut_one_drive", "drive_silent", "drive_fault", "drive_sto", "drive_resets", "lease_lost", "scan_stale",
    "estop_stale", "estop_pressed", "radio_gap", "all_processes_restart",
)  # fmt: skip
"""Something stops being there."""
LIES = (
    "encoder_lost", "encoder_frozen", "encoder_reversed", "encoder_jumping", "encoder_intermittent", "frozen_encoder",
    "stuck_velocity", "wheel_blocked", "wheel_limited", "motor_weak", "setpoints_lost", "feedback_lost",
    "drive_ignores_setpoints", "twin_node",
)  # fmt: skip
"""Something is not what it says."""
DRIVES_S, LONGEST_S, LOOK_S = 1.0, 4.0, 0.002
STANDS_MPS, STANDS_RADPS = 0.01, 0.04
SPEEDS_MPS = (0.2, 0.8)
RELEASED_S = 1.0
"""So long after the fault the operator releases the stick: what does not follow upward is seen by then."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run. `time_s`: from the fault until the base stood for good, infinity: it moved at the end."""

    time_s: float
    distance_m: float
    peak_mps: float


def measure(start: Start, fault: str, seed: int) -> Run:
    """One run in a copy of this process."""
    reader, writer = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            os.write(writer, pickle.dumps(_run(start, fault, seed)))
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        told = pipe.read()
    os.waitpid(pid, 0)
    run = pickle.loads(told)
    assert isinstance(run, Run)
    return run


def _run(start: Start, fault: str, seed: int) -> Run:
    world, random = start.world, Random(f"{fault} {seed}")
    world.random.seed(seed)
    clock, base, kind = world.clock, world.drives.bench.base, FAULTS[fault]
    twist, ends = Twist(random.uniform(*SPEEDS_MPS), 0.0), [clock.now + DRIVES_S + LONGEST_S]

    def hold() -> None:
        if clock.now < ends[0]:
            world.topics.publish("cmd_vel_joy", twist)
            clock.after(0.05, hold)

    hold()
    clock.run_until(clock.now + DRIVES_S + random.uniform(0.0, 0.1))
    began, path_m, moved_at, peak_mps = clock.now, base.path_m, clock.now, 0.0
    kind.begin(world, start.around, kind.draw(random))
    end, ends[0] = clock.now + LONGEST_S, clock.now + RELEASED_S
    while clock.now < end:
        clock.run_until(clock.now + LOOK_S)
        if abs(base.v_mps) > STANDS_MPS or abs(base.w_radps) > STANDS_RADPS:
            moved_at = clock.now
        peak_mps = max(peak_mps, abs(base.v_left_mps), abs(base.v_right_mps))
    stood = moved_at < end - 2.0 * LOOK_S
    return Run(moved_at - began if stood else float("inf"), base.path_m - path_m, peak_mps)


def quantile(values: Iterable[float], share: float) -> float:
    """The value below which `share` of them lie, the nearest one upward."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def row(fault: str, runs: Sequence[Run]) -> str:
    """One line of the table."""
    times, ways = [run.time_s for run in runs], [run.distance_m for run in runs]
    spread = " | ".join(f"{quantile(times, share):.2f} s | {quantile(ways, share):.2f} m" for share in (0.5, 0.99, 1.0))
    return f"| {FAULTS[fault].sentence} | {spread} | {max(run.peak_mps for run in runs):.2f} m/s |"


def table(title: str, faults: Sequence[str], runs: int) -> list[str]:
    """The rows of one kind."""
    start = Start()
    lines = [f"| {title} | p50 | way | p99 | way | max | way | fastest wheel |", "|---|" + "---:|" * 7]
    for fault in faults:
        lines.append(row(fault, [measure(start, fault, seed) for seed in range(runs)]))
        print(lines[-1], flush=True)
    return lines


def main() -> None:
    """Print the tables; with --write put them into a page, between its marks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20, help="of each fault")
    parser.add_argument("--write", type=Path, help="the page")
    given = parser.parse_args()
    head = (
        f"{given.runs} seeded runs each, driven at {SPEEDS_MPS[0]} to {SPEEDS_MPS[1]} m/s; the fault begins and stays, "
        f"the stick is held for {RELEASED_S} s more. From the fault until the base stands for good; inf: it does not "
        f"within {LONGEST_S} s."
    )
    lines = [head, "", *table("what stops being there", STOPS, given.runs), ""]
    lines += table("what is not as it says", LIES, given.runs)
    if given.write is not None:
        page = given.write.read_text(encoding="utf-8")
        given.write.write_text(rewritten(page, COMMAND, "\n".join(lines)), encoding="utf-8")


if __name__ == "__main__":
    main()
