"""Small worlds: what holds with every single event, that removed safeguards are missed, and how states are compared."""

from __future__ import annotations

import pytest

from campaign.removed_safeguards import SAFEGUARDS
from canbase_campaign.envelope import react_s
from canbase_driver.cia301.sdo_client import Read, SdoAborted
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State as WatchdogState
from small_worlds import canonical
from small_worlds.copying import Snapshot
from small_worlds.events import EVENTS, FAULT_EVENTS, OPERATOR_EVENTS
from small_worlds.explore import Bounds, Search, Story, search, shortest
from small_worlds.merged import differences, pairs
from small_worlds.properties import PROPERTIES, Found, Properties, _Hold
from small_worlds.teeth import TEETH, Tooth, bite
from small_worlds.world import POINT_S, STARTS, STEP_S, SmallWorld

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(900)]


def test_with_each_single_event_at_any_time_everything_holds() -> None:
    found = search(Bounds(1, 0, 4), STARTS)
    assert not found.broken_off
    assert [story.lines() for story in shortest(found.stories).values()] == []
    assert found.states > 1000


@pytest.mark.parametrize("tooth", TEETH, ids=lambda tooth: f"{tooth.safeguard} {tooth.start} {tooth.bounds.only}")
def test_without_a_safeguard_a_small_world_misses_it(tooth: Tooth) -> None:
    stories = bite(tooth)
    assert tooth.found in stories, [story.lines() for story in stories.values()]


def test_ctrl_c_ends_a_search_with_what_was_found_until_then() -> None:
    news: list[int] = []

    def press(found: Search) -> None:
        news.append(found.done)
        if found.done == 2:
            raise KeyboardInterrupt

    found = search(Bounds(1, 0, 4), ["driving"], workers=1, on_news=press)
    assert (news, found.done, found.broken_off) == ([1, 2], 2, True)
    assert 0 < found.states < 300


def test_a_base_without_force_may_roll_out_and_never_get_faster() -> None:
    hold = _Hold(0.1, 10.0)
    assert not hold.is_broken(2.0, 12.0, coasting=True, react_s=0.1)
    assert not hold.is_broken(1.9, 12.2, coasting=True, react_s=0.1)
    assert hold.is_broken(1.95, 12.4, coasting=True, react_s=0.1)
    assert hold.is_broken(1.8, 12.6, coasting=False, react_s=0.1)


def test_a_second_layer_has_its_time_only_while_two_faults_hold_and_one_reaction_after() -> None:
    small = SmallWorld("driving")
    properties, robot = Properties(small), small.world.robot
    one_s, two_s = react_s(robot, layers=1), react_s(robot, layers=2)
    allowed = []
    for event in ("stick", "velocity hangs", "watchdog hangs"):
        small.happens(EVENTS[event])
        small.pass_to_point()
        allowed.append(properties._react_s)
    small.pass_to_point(EVENTS["watchdog hangs"].lasts_s + one_s)
    assert [*allowed, properties._react_s] == [one_s, one_s, pytest.approx(two_s), one_s]


def test_an_encoder_that_dies_as_the_emergency_stop_is_pressed_is_no_stand_and_the_next_order_finds_it() -> None:
    """Loops of 20 Hz, 0.4 m/s: a drop to zero within a cycle is a possible one (docs/decisions/0041)."""
    small = SmallWorld("driving")
    base, driver, watchdog = small.world.drives.bench.base, small.world.driver, small.world.watchdog

    def fastest_mps(seconds: float) -> float:
        """Of both wheels. The driver reports standstill of none that rolls."""
        clock, peak_mps = small.world.clock, 0.0
        end = clock.now_s + seconds
        while clock.now_s < end:
            clock.run_until(clock.now_s + STEP_S)
            rolls_mps = max(abs(base.v_left_mps), abs(base.v_right_mps))
            peak_mps = max(peak_mps, rolls_mps)
            assert driver.snapshot is None or not driver.snapshot.standstill or rolls_mps <= 0.1
        return peak_mps

    small.happens(EVENTS["drive 1 encoder dead"])
    small.happens(EVENTS["button"])
    assert fastest_mps(4.0) < 1.8
    assert watchdog.core.status.state is WatchdogState.WATCHING
    small.turn_stick()
    small.happens(EVENTS["button"])
    fastest_mps(0.5)
    small.reset()
    fastest_mps(1.0)
    small.turn_stick()
    assert fastest_mps(3.0) < 0.2
    assert watchdog.core.status.verdict.cause is TripCause.MOTION_MISSING


def test_a_world_at_rest_is_told_alike_at_any_time_and_another_one_differently() -> None:
    small = SmallWorld("driving")
    properties = Properties(small)
    told = []
    for _ in range(3):
        small.pass_to_point()
        told.append(canonical.told(small, properties))
    assert told[0] == told[1] == told[2]
    small.happens(EVENTS["watchdog hangs"])
    small.pass_to_point()
    assert canonical.told(small, properties) != told[0]
    assert properties.found is None


@pytest.mark.parametrize("event", ["watchdog hangs", "reboot", "drive 1 power cycle", "all restart", "cable"])
def test_a_copy_goes_on_as_its_original_does(event: str) -> None:
    small = SmallWorld("driving")
    properties = Properties(small)
    small.happens(EVENTS[event])
    for _ in range(12):
        snapshot = Snapshot((small, properties))
        small.pass_to_point()
        copied, its = snapshot.restore()
        assert copied.world.clock.now_s < small.world.clock.now_s
        copied.pass_to_point()
        assert canonical.told(copied, its) == canonical.told(small, properties)
        copied.happens(EVENTS["driver dies"])
        copied.pass_to_point()
        assert small.world.driver.alive


def test_a_copy_has_the_error_that_a_boot_was_answered_with() -> None:
    error = SdoAborted(1, Read(0x1018, 1), 0x0602_0000)
    copied = Snapshot(error).restore()
    assert copied is not error
    assert (type(copied), str(copied), vars(copied)) == (SdoAborted, str(error), vars(error))


PAIRS, FUTURES = 5, 2


def merged_differently(seed: int) -> list[list[str]]:
    """Of PAIRS pairs of worlds that count as the same, with FUTURES for each."""
    merged = list(pairs(seed, PAIRS))
    assert len(merged) == PAIRS
    futures = [(pair, seed * 100 + number) for pair in merged for number in range(FUTURES)]
    return [apart for pair, future in futures if (apart := differences(pair, future))]


@pytest.mark.parametrize("seed", range(8))
def test_worlds_that_count_as_the_same_continue_alike(seed: int) -> None:
    assert merged_differently(seed) == []


@pytest.mark.parametrize("start", STARTS)
def test_each_search_begins_in_a_world_at_rest(start: str) -> None:
    found = search(Bounds(0, 0, 1), [start], workers=1)
    assert found.steps <= 4, "something grows or settles; where a motion has come to is named in canonical.UNSEEN"
    assert found.stories == []


def test_a_search_follows_a_world_until_it_rests() -> None:
    found = search(Bounds(1, 0, 4, ("velocity restarts",)), ["driving"], workers=1)
    assert found.stories == []
    assert found.steps > 2.4 / POINT_S, "the base stands 0.8 s after the restart, the watchdog's bounds fall for 2 s"


def test_the_shortest_story_has_the_fewest_events_and_then_ends_first() -> None:
    def story(at_s: float, *events: str) -> Story:
        return Story("driving", tuple((0.2, name) for name in events), Found("fresh", at_s, "it moves"))

    told = shortest([story(1.0, "cable", "reset"), story(3.0, "cable"), story(2.0, "reboot")])
    assert told["fresh"].events == ((0.2, "reboot"),)
    assert told["fresh"].lines()[-1] == " 2.00 s  fresh: it moves"


def test_rows_name_events_properties_and_safeguards_that_there_are() -> None:
    assert {name for tooth in TEETH for name in tooth.bounds.only} <= set(EVENTS)
    assert {name for tooth in TEETH for name in tooth.safeguard.split("+")} <= set(SAFEGUARDS)
    assert {tooth.found for tooth in TEETH} <= set(PROPERTIES)
    assert len(EVENTS) == len(FAULT_EVENTS) + len(OPERATOR_EVENTS)
