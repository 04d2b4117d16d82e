"""Some scenarios of the campaign; that they repeat exactly; and that the campaign finds what is taken out."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from campaign.__main__ import app
from campaign.faults import FAULTS
from campaign.plan import MOST_FAULTS, draw_plan
from campaign.runner import run
from campaign.scenario import Start
from campaign.teeth import COVERED, DRAWN_FROM, TOGETHER
from campaign.without import SAFEGUARDS

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(1800)]
SCENARIOS = 180
WORKERS = 2


def test_whatever_goes_wrong_every_property_holds() -> None:
    tally = run(range(SCENARIOS), WORKERS)
    assert tally.violations == []
    assert tally.scenarios == SCENARIOS
    assert tally.faults.keys() == FAULTS.keys(), "every fault ran"
    assert tally.moved_m > 0.1 * SCENARIOS, "the base drove"
    assert set(tally.at_once) >= set(range(1, MOST_FAULTS + 1))
    assert max(tally.lives) > 1, "some drove again after a reset"


def test_the_same_seed_gives_the_same_scenario() -> None:
    start = Start()
    plan = draw_plan(17)
    assert draw_plan(17) == plan
    assert start.fork(plan) == start.fork(plan)
    assert start.fork(draw_plan(18)) != start.fork(plan)


@pytest.mark.parametrize(
    ("safeguard", "faults", "found"),
    [
        ("watchdog:target_outside", ["straight_to_cmd_vel", "driver_repeats", "driver_ignores_zero"], "envelope"),
        ("watchdog:all", ["straight_to_cmd_vel", "driver_repeats", "driver_ignores_zero", "lease_lost"], "envelope"),
        ("watchdog:latch", ["velocity_hangs", "lease_lost", "driver_hangs"], "latched"),
        ("driver:latch", ["watchdog_hangs", "drive_fault"], "latched"),
        ("driver:stop_record", ["driver_dies", "drive_fault", "all_processes_restart"], "latched"),
        ("drives:heartbeat_consumer", ["cable_cut", "cable_cut_to_drives", "cable_cut_one_drive"], "heartbeat"),
        ("mux:timeout", ["action_dies", "action_hangs"], "sources"),
        ("filter:command", ["mux_lossy"], "sources"),
        ("filter:estop", ["estop_pressed", "estop_stale"], "estop"),
        ("filter:zero_after_estop+mux:neutral_start", ["estop_pressed"], "zero"),
        ("filter:obstacle", ["obstacle"], "obstacle"),
        ("filter:blind", ["scanner_blind_ahead", "scanner_one_beam", "scanner_zero_ahead"], "obstacle"),
        ("filter:frozen", ["scanner_frozen", "scanner_by_turns"], "obstacle"),
        ("driver:watchdog_missing+drives:heartbeat_consumer", ["watchdog_dies", "watchdog_hangs"], "envelope"),
    ],
)
def test_without_a_safeguard_the_campaign_finds_it_missing(safeguard: str, faults: list[str], found: str) -> None:
    tally = run(range(50), WORKERS, faults, safeguard)
    assert found in {violation.name for _, violation in tally.violations}


def test_what_is_covered_twice_and_what_is_taken_out_together_are_safeguards() -> None:
    assert set(COVERED) <= set(SAFEGUARDS)
    assert {name for names in TOGETHER for name in names.split("+")} <= set(SAFEGUARDS)
    assert set(DRAWN_FROM) <= {*SAFEGUARDS, *TOGETHER}
    assert {fault for faults in DRAWN_FROM.values() for fault in faults} <= set(FAULTS)


def test_one_scenario_is_told_from_begin_to_end() -> None:
    """Exit code 0 without a violation, 1 with one."""
    told = CliRunner().invoke(app, ["--seed", "17", "--frames"])
    assert told.exit_code == 0, told.output
    assert "driver is ENABLED" in told.output
    assert "080" in told.output
    assert "0 violations" in told.output
    listed = CliRunner().invoke(
        app, ["--scenarios", "25", "--workers", "1", "--fault", "lease_lost", "--without", "watchdog:latch"]
    )
    assert listed.exit_code == 1, listed.output
    assert "latched in seed" in listed.output
