"""Who has power, and what takes it away: every state with every hazard, and the way down step by step."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_driver.cia402 import PowerGoal
from canbase_driver.snapshot import DriverState, WatchdogView
from canbase_driver.supervisor import (
    BLOCKERS,
    HAZARDS,
    NO_POWER,
    ORDERS,
    PREPARING,
    UNARMED,
    Cause,
    Drive,
    Orders,
    Situation,
    Step,
    Supervisor,
)

OFFLINE, BOOTING, DISARMED, ENABLING, ENABLED, STOPPING, LATCHED = DriverState
OFF, ON = Orders(PowerGoal.OFF, Drive.ZERO), Orders(PowerGoal.ON, Drive.ZERO)
FOLLOW, RAMP = Orders(PowerGoal.ON, Drive.FOLLOW), Orders(PowerGoal.ON, Drive.RAMP)
QUICK = Orders(PowerGoal.QUICK_STOP, Drive.ZERO)

READY = Situation(disabled="left is switch on disabled")
"""Without power, and nothing in the way of it."""
RUNNING = Situation(powered=True, standstill=False)
"""Enabled, and turning."""
STANDING = Situation(powered=True)

WRONG: dict[str, Situation] = {
    "bus failed": Situation(bus="bus-off"),
    "drive fault": Situation(fault="left: over-current"),
    "drive restarted": Situation(absent="node 1 restarted"),
    "booting": Situation(booting="waiting for node 1"),
    "drive silent": Situation(silent="node 1: no status"),
    "drive missing": Situation(missing="node 1 is missing"),
    "watchdog tripped": Situation(watchdog=WatchdogView.TRIPPED, watchdog_detail="lease lost"),
    "watchdog missing": Situation(watchdog=WatchdogView.MISSING, watchdog_detail="not heard yet"),
    "resetting": Situation(resetting=True),
    "drive disabled": Situation(disabled="left is switched on"),
    "did not stop": Situation(overdue="left turns"),
    "command not zero": Situation(commanded="0.3 m/s"),
    "not standing": Situation(standstill=False),
    "stop requested": Situation(stop_requested=True),
    "not configured": Situation(unconfigured="lifecycle: unconfigured"),
    "inactive": Situation(inactive="lifecycle: not active"),
    "shutdown": Situation(shutdown_requested=True),
}


def also(base: Situation, wrong: Situation) -> Situation:
    """`base`, and what is not as usual in `wrong`."""
    usual = Situation()
    fields = {name: getattr(wrong, name) for name in Situation.__dataclass_fields__}
    return replace(base, **{name: value for name, value in fields.items() if value != getattr(usual, name)})


class Story:
    """A supervisor with a ramp of at most 3 s, stepped every 10 ms."""

    def __init__(self) -> None:
        self.supervisor = Supervisor(ramp_timeout_s=3.0)
        self.now = 10.0

    def step(self, situation: Situation, cycles: int = 1) -> Orders:
        for _ in range(cycles):
            self.now += 0.01
            orders = self.supervisor.step(situation, self.now)
        return orders

    def lasts(self, situation: Situation, orders: Orders, longest_s: float = 10.0) -> float:
        """How long it gives these orders [s]."""
        start = self.now
        while self.step(situation) == orders:
            assert self.now - start < longest_s
        return round(self.now - start, 3)

    @property
    def told(self) -> tuple[DriverState, str, bool]:
        """State, cause, and whether it needs a reset."""
        return self.supervisor.state, self.supervisor.cause.name, self.supervisor.latches


def at(state: DriverState, wheels: Situation = STANDING) -> Story:
    """A supervisor that has got into this state in the ordinary way."""
    story = Story()
    ways: dict[DriverState, tuple[Situation, ...]] = {
        OFFLINE: (WRONG["bus failed"],),
        BOOTING: (WRONG["booting"],),
        DISARMED: (WRONG["command not zero"],),
        ENABLING: (READY,),
        ENABLED: (READY, wheels),
        STOPPING: (READY, wheels, also(wheels, WRONG["stop requested"])),
        LATCHED: (WRONG["drive fault"],),
    }
    for situation in ways[state]:
        story.step(situation)
    assert story.supervisor.state is state
    return story


NOT_YET = {
    "bus failed": OFFLINE,
    "booting": BOOTING,
    "drive missing": BOOTING,
    "drive restarted": BOOTING,
    "not configured": OFFLINE,
} | dict.fromkeys(
    ("drive silent", "watchdog missing", "inactive", "resetting", "command not zero", "not standing"), DISARMED
)
BEFORE_POWER = [(wrong, state, False) for wrong, state in NOT_YET.items()] + [
    ("drive fault", LATCHED, True),
    ("watchdog tripped", LATCHED, True),
    ("stop requested", LATCHED, True),
]


@pytest.mark.parametrize("state", [OFFLINE, BOOTING, DISARMED])
@pytest.mark.parametrize(("wrong", "shown", "latched"), BEFORE_POWER)
def test_without_power_whatever_is_wrong_keeps_it_off(
    state: DriverState, wrong: str, shown: DriverState, latched: bool
) -> None:
    story = at(state)
    situation = also(READY, WRONG[wrong])
    for _ in range(3):
        assert story.step(situation) == OFF
    name = "booting" if wrong == "drive restarted" else wrong
    assert story.told == (shown, name, latched)
    assert story.supervisor.cause.clears_on


@pytest.mark.parametrize("state", [OFFLINE, BOOTING, DISARMED])
def test_when_nothing_is_wrong_the_drives_are_enabled_at_once(state: DriverState) -> None:
    story = at(state)
    assert story.step(READY) == ON
    assert story.told == (ENABLING, "enabling", False)
    assert story.step(STANDING) == FOLLOW
    assert story.told == (ENABLED, "none", False)


def test_while_nothing_is_wrong_it_follows() -> None:
    story = at(ENABLED, RUNNING)
    for _ in range(3):
        assert story.step(RUNNING) == FOLLOW
    assert story.told == (ENABLED, "none", False)


STOPS = [
    ("bus failed", QUICK, True),
    ("drive fault", QUICK, True),
    ("drive restarted", QUICK, True),
    ("drive silent", QUICK, True),
    ("watchdog tripped", QUICK, True),
    ("watchdog missing", RAMP, True),
    ("drive disabled", QUICK, True),
    ("did not stop", QUICK, True),
    ("stop requested", RAMP, True),
    ("inactive", RAMP, False),
    ("shutdown", RAMP, False),
]
"""Hazard, first step from ENABLED, latched."""


def test_the_tables_of_this_test_name_every_hazard_and_every_blocker() -> None:
    assert [name for name, _, _ in STOPS] == [hazard.name for hazard in HAZARDS]
    assert {name for name, _, _ in BEFORE_POWER} - {"drive restarted"} == {blocker.name for blocker in BLOCKERS}
    assert set(ORDERS) == (set(DriverState) - {STOPPING}) | set(Step) | {PREPARING}


@pytest.mark.parametrize(("wrong", "first", "latched"), STOPS)
def test_from_enabled_each_hazard_stops_the_base_by_its_first_step(wrong: str, first: Orders, latched: bool) -> None:
    story = at(ENABLED, RUNNING)
    assert story.step(also(RUNNING, WRONG[wrong])) == first
    assert story.told == (STOPPING, wrong, latched)


@pytest.mark.parametrize(("wrong", "first", "latched"), [row for row in STOPS if row[0] != "drive disabled"])
def test_while_enabling_each_hazard_is_a_quick_stop_since_there_is_no_ramp_to_go_down(
    wrong: str, first: Orders, latched: bool
) -> None:
    story = at(ENABLING)
    assert story.step(also(READY, WRONG[wrong])) == QUICK
    assert story.told == (STOPPING, wrong, latched)


@pytest.mark.parametrize(("wrong", "first", "latched"), STOPS)
def test_on_the_ramp_only_what_needs_a_quick_stop_changes_the_step_and_the_cause_stays(
    wrong: str, first: Orders, latched: bool
) -> None:
    story = at(STOPPING, RUNNING)
    assert story.step(also(RUNNING, WRONG[wrong])) == (QUICK if first == QUICK else RAMP)
    assert story.told == (STOPPING, "stop requested", True)


@pytest.mark.parametrize("wrong", [name for name in WRONG if name != "shutdown"])
def test_latched_stays_latched_without_power_whatever_else_goes_wrong_or_well(wrong: str) -> None:
    story = at(LATCHED)
    assert story.step(also(READY, WRONG[wrong]), cycles=3) == OFF
    assert story.step(READY, cycles=3) == OFF
    assert story.told == (LATCHED, "drive fault", True)


@pytest.mark.parametrize("wrong", ["", *WRONG])
@pytest.mark.parametrize("state", list(DriverState))
def test_a_shutdown_ends_from_every_state_with_everything_wrong_in_bounded_time(state: DriverState, wrong: str) -> None:
    story = at(state, RUNNING)
    hopeless = also(RUNNING, WRONG.get(wrong, Situation()))  # still turning, still powered: no feedback helps
    situation = also(hopeless, WRONG["shutdown"])
    last = Orders(PowerGoal.ON, Drive.FOLLOW)
    start = story.now
    while not story.supervisor.finished:
        last = story.step(situation)
        assert story.now - start < 3.0 + 1.5 + 0.5 + 0.1
    assert last == OFF
    assert story.supervisor.state in NO_POWER
    assert story.supervisor.cause.name == "shutdown"


@pytest.mark.parametrize("state", [OFFLINE, BOOTING, DISARMED, LATCHED])
def test_a_shutdown_without_power_ends_in_the_same_cycle(state: DriverState) -> None:
    story = at(state)
    story.step(also(READY, WRONG["shutdown"]))
    assert story.supervisor.finished


def test_the_way_down_goes_on_at_standstill() -> None:
    story = at(ENABLED, RUNNING)
    stop = WRONG["stop requested"]
    assert story.step(also(RUNNING, stop), cycles=30) == RAMP
    assert story.step(also(STANDING, stop)) == OFF
    assert story.supervisor.state is STOPPING  # the drives have not said yet that they are off
    assert story.step(also(READY, stop)) == OFF
    assert story.told == (LATCHED, "stop requested", True)


def test_each_step_down_ends_by_its_deadline_when_the_wheels_never_stand() -> None:
    story = at(ENABLED, RUNNING)
    hopeless = also(RUNNING, WRONG["stop requested"])
    story.step(hopeless)
    assert story.lasts(hopeless, RAMP) == pytest.approx(3.0, abs=0.021)
    assert story.lasts(hopeless, QUICK) == pytest.approx(1.5, abs=0.021)
    while story.supervisor.state is STOPPING:
        assert story.step(hopeless) == OFF
    assert story.supervisor.state is LATCHED
    assert story.now == pytest.approx(10.0 + 5.0, abs=0.1)


def test_a_quick_stop_ends_at_standstill_but_lasts_one_cycle_at_least() -> None:
    story = at(ENABLED)
    assert story.step(also(STANDING, WRONG["drive fault"])) == QUICK
    assert story.step(also(STANDING, WRONG["drive fault"])) == OFF


def test_enabling_gives_up_after_two_seconds_and_needs_a_reset() -> None:
    story = at(ENABLING)
    assert story.lasts(READY, ON) == pytest.approx(2.0, abs=0.021)
    assert story.told == (STOPPING, "enable timeout", True)
    assert story.supervisor.cause.detail == "left is switch on disabled after 2.0 s"
    story.step(READY, cycles=3)
    assert story.told == (LATCHED, "enable timeout", True)


def test_when_several_things_are_wrong_the_most_telling_is_the_cause() -> None:
    story = at(ENABLED, RUNNING)
    several = also(also(RUNNING, WRONG["watchdog tripped"]), WRONG["drive disabled"])
    story.step(also(several, WRONG["drive fault"]))
    assert story.supervisor.cause.name == "drive fault"


def test_a_stop_that_needs_no_reset_needs_one_when_a_drive_fails_on_the_way() -> None:
    story = at(ENABLED, RUNNING)
    story.step(also(RUNNING, WRONG["shutdown"]))
    story.step(also(also(RUNNING, WRONG["shutdown"]), WRONG["drive fault"]))
    assert story.told == (STOPPING, "shutdown", True)


@pytest.mark.parametrize("state", [LATCHED, DISARMED])
def test_a_reset_leads_to_disarmed_and_no_further(state: DriverState) -> None:
    story = at(state)
    story.supervisor.reset()
    assert story.supervisor.state is DISARMED
    assert not story.supervisor.latches
    assert story.step(also(READY, WRONG["command not zero"])) == OFF
    assert story.step(READY) == ON


@pytest.mark.parametrize("state", [OFFLINE, BOOTING, ENABLING, ENABLED, STOPPING])
def test_a_reset_in_any_other_state_is_our_own_mistake_and_changes_nothing(state: DriverState) -> None:
    story = at(state)
    before = story.told
    with pytest.raises(RuntimeError, match=f"reset in state {state.name}"):
        story.supervisor.reset()
    assert story.told == before


STO_OPEN = Situation(disabled="left is switch on disabled", unprepared="left stays in switch on disabled: STO?")


def test_drives_that_are_not_ready_are_waited_for_without_power_and_without_a_latch() -> None:
    story = at(DISARMED, STO_OPEN)
    for _ in range(1000):
        assert story.step(STO_OPEN) == Orders(PowerGoal.READY, Drive.ZERO)
    assert story.told == (DISARMED, "drive not ready", False)
    assert story.step(replace(STO_OPEN, unprepared="")) == ON
    assert story.supervisor.state is ENABLING


def test_while_they_are_waited_for_every_blocker_takes_the_power_off() -> None:
    story = at(DISARMED, STO_OPEN)
    story.step(STO_OPEN)
    for name in ("watchdog missing", "command not zero"):
        assert story.step(also(STO_OPEN, WRONG[name])) == OFF
        assert story.told == (DISARMED, name, False)


# drives prepared ── the records say so on disk ── power
def test_no_power_before_the_record_is_on_disk() -> None:
    story = Story()
    waits = Situation(unarmed="not on disk yet")
    orders = story.step(waits, 500)
    assert (story.supervisor.state, story.supervisor.cause.name) == (DISARMED, UNARMED)
    assert orders == ORDERS[PREPARING]
    story.step(replace(waits, unprepared="no main voltage"))
    assert story.supervisor.cause.name == "drive not ready"
    story.step(READY)
    assert story.supervisor.state is ENABLING


def test_a_stop_of_before_the_start_is_latched_until_a_reset() -> None:
    before = Cause("drive fault", "latched since before the start: left_wheel", "reset")
    supervisor = Supervisor(3.0, before)
    for step in range(100):
        orders = supervisor.step(READY, 10.0 + step)
    assert orders == ORDERS[LATCHED]
    assert (supervisor.state, supervisor.cause, supervisor.latches) == (LATCHED, before, True)
    supervisor.reset()
    supervisor.step(READY, 200.0)
    assert supervisor.state is ENABLING
