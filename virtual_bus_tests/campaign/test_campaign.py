"""Some scenarios of the campaign; that they repeat exactly; and that the campaign finds what is taken out."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path

import pytest
from typer.testing import CliRunner

from campaign import teeth
from campaign.__main__ import app
from campaign.removed_safeguards import SAFEGUARDS
from campaign.safeguard_needs import NEEDS, Need
from campaign.teeth import look_at
from canbase_campaign.faults import FAULTS
from canbase_campaign.plan import MOST_FAULTS, draw_plan
from canbase_campaign.robots import robot_of
from canbase_campaign.runner import run
from canbase_campaign.scenario import Result, Start
from canbase_hazards.catalogue import load

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(1800)]
SCENARIOS = 24
"""For the tests. Continuous integration runs IN_CI of them by the command."""
IN_CI = 400
WORKERS = 2


def test_whatever_goes_wrong_every_property_holds() -> None:
    tally = run(range(SCENARIOS), WORKERS)
    assert tally.violations == []
    assert tally.scenarios == SCENARIOS
    assert tally.moved_m > 0.1 * SCENARIOS, "the base drove"
    assert max(tally.lives) > 1, "some drove again after a reset"


def test_what_continuous_integration_runs_has_every_fault_and_every_number_of_them_at_once() -> None:
    assert f"make campaign SCENARIOS={IN_CI}" in (Path(__file__).parents[2] / ".ci" / "run").read_text()
    plans = [draw_plan(seed) for seed in range(IN_CI)]
    assert {fault.name for plan in plans for fault in plan.faults} == FAULTS.keys()
    assert {len(plan.faults) for plan in plans} >= set(range(1, MOST_FAULTS + 1))


def test_the_same_seed_gives_the_same_scenario() -> None:
    start = Start()
    plan = draw_plan(17)
    assert draw_plan(17) == plan
    assert start.fork(plan) == start.fork(plan)
    assert start.fork(draw_plan(18)) != start.fork(plan)


# 0.58 s the driver hangs ── 0.77 s an encoder counts nothing ── 1.47 s it counts again ── 1.57 s the driver goes on
def test_an_encoder_that_lies_while_the_driver_hangs_is_no_defect_of_its_odometry() -> None:
    plan = draw_plan(6112, from_rest=True)
    assert {each.name for each in plan.faults} == {"driver_hangs", "encoder_lost"}
    assert list(Start(robot_of(6112)).fork(plan).violations) == []


def test_every_row_of_the_teeth_names_safeguards_and_faults_that_exist() -> None:
    assert {name for need in NEEDS for name in need.taken_out.split("+")} <= set(SAFEGUARDS)
    assert {fault for need in NEEDS for fault in need.faults} <= set(FAULTS)
    named = {name for row in load().rows for name in row.safeguard.split("+") if name}
    assert named <= {need.safeguard for need in NEEDS}, "each safeguard of hazards.yaml"
    assert sorted(need.safeguard for need in NEEDS) == sorted(SAFEGUARDS), "one row each"


OPEN = 38
"""So many rows have no scenario yet that needs them. The number may only fall."""


def test_each_safeguard_was_taken_out_and_the_number_of_scenarios_is_stated() -> None:
    """A new check, detector, rung, hazard or blocker has no measurement: `make teeth ONLY=its_name` makes one."""
    measured = teeth.load()
    assert set(measured) == {need.safeguard for need in NEEDS if not need.undrawn}
    assert sum(not bite.property for bite in measured.values()) <= OPEN
    for name, bite in measured.items():
        assert 0 < bite.scenarios <= (teeth.MOST_DIRECTED if bite.directed else teeth.MOST), name


def test_every_row_has_its_turn_on_one_day_of_three() -> None:
    turns = [need.safeguard for day in range(3) for need in teeth.of_day(738000 + day)]
    assert sorted(turns) == sorted(need.safeguard for need in NEEDS if not need.undrawn)


def test_without_a_safeguard_a_scenario_shows_it_missing_and_with_it_the_same_one_does_not() -> None:
    """A third of them each day: the measured scenario of each."""
    needs, measured = teeth.of_day(datetime.now(timezone.utc).toordinal()), teeth.load()
    found = {bite.safeguard for bite in look_at(needs, WORKERS, measured) if bite.property}
    assert {need.safeguard for need in needs if measured[need.safeguard].property} == found
    assert found


def test_a_safeguard_that_nothing_needs_is_reported_and_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stop that is in no scenario."""
    monkeypatch.setattr(teeth, "NEEDS", (Need("driver:stop_requested", ("frame_delay",)),))
    told = CliRunner().invoke(teeth.app, ["--scenarios", "2", "--workers", "1"])
    assert told.exit_code == 1, told.output
    assert "NOT IN 2" in told.output
    assert "0 of 1 safeguards are found missing" in told.output


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
    drawn = listed.output.partition("faults in")[2].partition("property")[0]
    assert [name for name in FAULTS if f"│ {name} " in drawn] == ["lease_lost"]


def test_ctrl_c_tells_what_was_found_until_then() -> None:
    def ctrl_c(_result: Result) -> None:
        raise KeyboardInterrupt

    tally = run([0, 25, 50], 1, on_result=ctrl_c)
    assert tally.broken_off
    assert tally.scenarios == 1
