"""`python -m campaign.teeth [SAFEGUARD …]`: takes one safeguard out after the other; a scenario has to show it missing.

One whose absence no scenario shows is either doubly covered, then `COVERED` says by what, or not proven.
"""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from campaign.plan import draw_plan
from campaign.runner import start_of
from campaign.without import SAFEGUARDS, remove

SCENARIOS = 60
"""So many scenarios are tried for each."""
DRAWN_FROM: dict[str, tuple[str, ...]] = {
    "watchdog:target_outside": ("straight_to_cmd_vel", "driver_repeats", "driver_ignores_zero"),
    "watchdog:motion_outside": ("drive_ignores_setpoints",),
    "watchdog:feedback_implausible": ("stuck_velocity", "drive_ignores_setpoints"),
    "watchdog:latch": ("velocity_hangs", "lease_lost", "driver_hangs"),
    "driver:latch": ("watchdog_hangs", "drive_fault"),
    "driver:stop_record": ("driver_dies", "drive_fault", "all_processes_restart"),
    "driver:asks_for_watchdog": ("drive_fault", "watchdog_dies", "watchdog_hangs", "resets_too_early"),
    "watchdog:motion_missing": ("encoder_lost", "wheel_blocked", "stick_held"),
    "watchdog:power_at_stand": ("encoder_lost", "encoder_frozen"),
    "watchdog:twist_outside": ("wheel_limited", "motor_weak", "stick_held"),
    "watchdog:setpoint_missing": ("setpoints_lost", "stick_held"),
    "watchdog:answered_twice": ("twin_node", "stick_held"),
    "watchdog:drive_restarted": ("drive_resets", "drive_power_cycle", "stick_held"),
    "watchdog:stop_record": ("all_processes_restart", "watchdog_dies", "encoder_lost", "lease_lost"),
    "driver:waits_for_zero": ("stick_held", "drive_fault", "resets_too_early"),
    "driver:reset_needs_zero": ("stick_held", "drive_fault", "resets_too_early"),
    "filter:blind": ("scanner_blind_ahead", "scanner_one_beam", "scanner_zero_ahead"),
    "filter:frozen": ("scanner_frozen", "scanner_by_turns"),
    "filter:repeated_stamp": ("scanner_old_stamps",),
    "driver:command_is_finite": ("straight_to_cmd_vel",),
    "driver:command_timeout": ("velocity_dies", "velocity_hangs", "cmd_vel_lossy", "lease_lost"),
    "driver:odometry_jump_guard": ("frozen_encoder",),
    "action:timeout_and_progress": ("cmd_vel_lossy", "drive_ignores_setpoints", "obstacle"),
    "driver:drive_restarted": ("drive_power_cycle", "second_master_nmt"),
    "watchdog:lease_lost+driver:command_timeout": ("velocity_dies", "velocity_hangs"),
    "driver:watchdog_missing+drives:heartbeat_consumer": ("watchdog_dies", "watchdog_hangs"),
    "drives:heartbeat_consumer": ("cable_cut", "cable_cut_to_drives", "cable_cut_one_drive"),
    "mux:timeout": ("action_dies", "action_hangs"),
    "filter:command": ("mux_lossy",),
    "filter:estop": ("estop_pressed", "estop_stale"),
    "filter:zero_after_estop+mux:neutral_start": ("estop_pressed",),
    "filter:obstacle": ("obstacle",),
}
"""Faults that a safeguard is there for, where they come too seldom among all."""
TOGETHER = (
    "watchdog:lease_lost+driver:command_timeout",
    "driver:watchdog_missing+drives:heartbeat_consumer",
    "filter:zero_after_estop+mux:neutral_start",
)
"""Layers that cover each other: taken out together."""
_TELL_ALONE = "cannot stop anything then; driver:watchdog_missing and drives:heartbeat_consumer do"
_SMALL = "small_worlds/teeth.py takes both out, and finds it"
COVERED = {
    "driver:waits_for_zero": f"mux:neutral_start and driver:zero_before_motion; {_SMALL}",
    "driver:reset_needs_zero": f"mux:neutral_start and driver:zero_before_motion; {_SMALL}",
    "watchdog:stop_record": f"driver:latch; {_SMALL}",
    "records:unreadable": "no fault of the campaign tears a record; small_worlds/teeth.py finds it",
    "watchdog:bus_failed": f"it {_TELL_ALONE}",
    "watchdog:loop_late": f"a watchdog that stands still {_TELL_ALONE}",
    "watchdog:foreign_master": "watchdog:target_outside, for setpoints; strange NMT commands can but stop a drive",
    "watchdog:driver_silent": "watchdog:target_outside and lease_lost; drives:heartbeat_consumer",
    "watchdog:drive_silent": "driver:drive_silent; one that is cut off stops by drives:heartbeat_consumer",
    "watchdog:drive_down": "driver:drive_fault, drive_restarted and drive_disabled",
    "watchdog:feedback_implausible": "a lie alone moves nothing: test_watchdog_lies.py has drives that lie and disobey",
    "watchdog:overspeed": "watchdog:target_outside and motion_outside: no lease allows as much",
    "driver:bus_failed": "watchdog:driver_silent; drives:heartbeat_consumer",
    "driver:drive_fault": "watchdog:drive_down; driver:drive_disabled",
    "driver:drive_restarted": "driver:drive_silent and drive_disabled; watchdog:drive_down",
    "driver:drive_silent": "watchdog:drive_silent",
    "driver:watchdog_tripped": "the watchdog's own ladder",
    "driver:watchdog_missing": "drives:heartbeat_consumer; together: found",
    "driver:drive_disabled": "watchdog:drive_down",
    "driver:did_not_stop": "watchdog:motion_outside, which is faster",
    "driver:stop_requested": "nobody asks for it here: test_supervisor.py and the exit matrix do",
    "driver:shutdown": "the driver is not ended here: test_supervisor.py and the exit matrix do",
    "driver:command_timeout": "watchdog:lease_lost; together: found",
    "filter:repeated_stamp": "filter:frozen: a scan that comes again has the same readings",
    "driver:zero_before_motion": "mux:neutral_start",
    "filter:zero_after_estop": "mux:neutral_start; together: found",
    "mux:neutral_start": "filter:zero_after_estop, driver:zero_before_motion; test_neutral_start.py has a held stick",
    "driver:odometry_jump_guard": "watchdog:feedback_implausible, before an encoder leaps far: test_wheel_travel.py",
    "action:timeout_and_progress": "a goal that gets nowhere is rare here: test_goal.py and test_causes.py",
}
"""Those that no scenario shows missing: what stops the base without them."""


@dataclass(frozen=True, slots=True)
class Bite:
    """The first scenario that shows a safeguard missing; none of those `tried` did when `found` is empty."""

    safeguard: str
    found: str
    seed: int
    tried: int


def look(safeguard: str, scenarios: int = SCENARIOS) -> Bite:
    """Take a safeguard out of this process, which is spent then, and look for a violation."""
    remove(safeguard)
    for seed in range(scenarios):
        result = start_of(seed).fork(draw_plan(seed, DRAWN_FROM.get(safeguard, ())))
        if result.violations:
            return Bite(safeguard, result.violations[0].name, seed, seed + 1)
    return Bite(safeguard, "", -1, scenarios)


def look_at(safeguards: Sequence[str], workers: int) -> Iterator[Bite]:
    """Each safeguard in a process of its own."""
    with multiprocessing.get_context("spawn").Pool(workers, maxtasksperchild=1) as pool:
        yield from pool.imap(look, safeguards)


def main(safeguards: Sequence[str]) -> int:
    """Exit code 1 when a safeguard is neither found missing nor explained."""
    gaps = 0
    for bite in look_at(safeguards, 2):
        gaps += not bite.found and bite.safeguard not in COVERED
        covered = COVERED.get(bite.safeguard, "NOTHING FOUND, NOTHING EXPLAINED")
        print(
            f"without {bite.safeguard:54}", f"{bite.found} in seed {bite.seed}" if bite.found else covered, flush=True
        )
    return 1 if gaps else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:] or [*SAFEGUARDS, *TOGETHER]))
