"""The watchdog proof before every kind of drive, and before drives that do not stop by themselves."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from canbase_commissioning.guide import CommissionError, Script
from canbase_commissioning.powered_drives import PoweredDrives, RigError
from canbase_commissioning.self_stop_test import HEARTBEAT, SILENCE, Outcome, get_ready, prove, watches_watchdog
from canbase_driver.boot.settings import STOPS_BY_NOTHING, SelfStopSet, StopsBy
from canbase_driver.cia301.frame import Frame
from canbase_sim.cia301.dictionary import key
from canbase_sim.cia402.states import POWERED
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.personality import PERSONALITIES
from support.crews import robot_with
from support.guide_world import GuideWorld

SPEED_MPS = 0.1


def whole(rig: PoweredDrives) -> Script[tuple[Outcome, ...]]:
    yield from get_ready(rig)
    return (yield from prove(rig, SPEED_MPS))


def assert_off(world: GuideWorld) -> None:
    """Whatever happened: no motor has power, no wheel turns."""
    world.wait(1.0)
    assert not any(axis.state in POWERED for node in world.bench.nodes.values() for axis in node.axes)
    assert world.speeds == (0.0, 0.0)


BY_HEARTBEAT = ("elmo_gold", "epos4", "generic", "inverter", "kinco", "nanotec")
BY_THEIR_OWN_TIMEOUT = ("roboteq", "zlac8015d")
BY_GUARDING = ("technosoft",)
NEVER = ("dryve_d1", "tmcm1636")


def test_every_kind_of_drive_is_in_one_of_the_lists() -> None:
    assert sorted((*BY_HEARTBEAT, *BY_GUARDING, *BY_THEIR_OWN_TIMEOUT, *NEVER)) == sorted(PERSONALITIES)


@pytest.mark.parametrize("kind", [*BY_HEARTBEAT, *BY_GUARDING])
def test_a_drive_that_watches_the_watchdog_stops_in_both_trials_within_it_and_its_ramp(kind: str) -> None:
    """0.3 s of 1016h (0.24 s of 100Ch × 100Dh), minus what passed since the last frame (0.1 s, 0.06 s), and 0.05 s of
    ramp."""
    world = GuideWorld(robot_with(kind))
    outcomes = world.guide(whole)
    assert [(o.trial, o.stopped, o.is_late) for o in outcomes] == [(SILENCE, True, False)] * 2 + [
        (HEARTBEAT, True, False)
    ] * 2
    assert all(0.18 < outcome.time_s < 0.45 for outcome in outcomes)
    assert all("EMCY 8130h" in outcome.sign for outcome in outcomes)
    assert_off(world)


@pytest.mark.parametrize(("kind", "late"), [("roboteq", True), ("zlac8015d", False)])
def test_a_drive_with_a_timeout_of_its_own_stops_and_needs_no_heartbeat(kind: str, late: bool) -> None:
    """Roboteq's RWD is a second: later than a heartbeat would be, and told so."""
    world = GuideWorld(robot_with(kind))
    outcomes = world.guide(whole)
    assert [(o.trial, o.stopped, o.is_late) for o in outcomes] == [(SILENCE, True, late)] * 2
    assert_off(world)


@pytest.mark.parametrize(
    ("stop", "watches"),
    [
        (SelfStopSet(StopsBy.WATCHDOG_HEARTBEAT, "1016h watches the watchdog"), True),
        (SelfStopSet(StopsBy.NODE_GUARDING, "100Ch, 100Dh"), True),
        (SelfStopSet(StopsBy.OWN_TIMEOUT, "heartbeat timeout of the manufacturer (2000h:1)"), False),
        (STOPS_BY_NOTHING, False),
    ],
)
def test_the_second_trial_goes_by_what_the_boot_set_and_not_by_its_words(stop: SelfStopSet, watches: bool) -> None:
    """A manufacturer may call a command timeout of its own a heartbeat."""
    rig = SimpleNamespace(report=lambda _joint: SimpleNamespace(self_stop=stop))
    assert watches_watchdog(cast(PoweredDrives, rig), "left") is watches


@pytest.mark.parametrize("kind", NEVER)
def test_a_drive_that_does_not_stop_by_itself_is_told_loudly_and_stopped_at_once(kind: str) -> None:
    world = GuideWorld(robot_with(kind))
    outcomes = world.guide(whole)
    assert [(o.trial, o.stopped) for o in outcomes] == [(SILENCE, False)] * 2
    assert "DID NOT STOP when this computer stopped sending" in str(outcomes[0])
    assert_off(world)


def test_one_drive_of_two_that_lost_its_1016h_is_the_one_that_is_named() -> None:
    """Its firmware clears the entries between the boot and the trial: what was set is not what counts."""
    world = GuideWorld()

    def sabotaged(rig: PoweredDrives) -> Script[tuple[Outcome, ...]]:
        yield from get_ready(rig)
        world.bench.nodes[2].dictionary.values.update({key(0x1016, 1): 0, key(0x1016, 2): 0})
        world.bench.nodes[2]._consumer.configure()
        return (yield from prove(rig, SPEED_MPS))

    outcomes = world.guide(sabotaged)
    assert [(outcome.joint, outcome.stopped) for outcome in outcomes] == [("left", True), ("right", False)]
    assert_off(world)


def test_another_client_that_writes_1016h_meanwhile_ends_it() -> None:
    world = GuideWorld()

    def sabotaged(rig: PoweredDrives) -> Script[tuple[Outcome, ...]]:
        yield from get_ready(rig)
        world.bench.on_frame(BenchFrame(0x602, bytes.fromhex("23 16 10 01 00 00 00 00")), world.now_s)
        return (yield from prove(rig, SPEED_MPS))

    with pytest.raises(
        RigError, match="is configured anew: another client, or a gateway that repeats answers, has written its 1016h:1"
    ):
        world.guide(sabotaged)
    assert_off(world)


def test_a_drive_that_does_not_get_power_ends_it_with_its_state() -> None:
    world = GuideWorld()

    def held(rig: PoweredDrives) -> Script[tuple[Outcome, ...]]:
        yield from get_ready(rig)
        world.bench.nodes[2].fail(0, 0x2310, holds=True)
        return (yield from prove(rig, SPEED_MPS))

    with pytest.raises(RigError, match="right: fault 2310h over-current"):
        world.guide(held)
    assert_off(world)


def test_a_drive_that_is_not_there_ends_it_before_anything_moves() -> None:
    world = GuideWorld()
    world.bench.nodes[2].line.cut = True
    with pytest.raises(CommissionError, match=r"were not ready within 15 s: .*node 2 \(right\)"):
        world.guide(whole)
    assert world.bench.base.path_m == 0.0


def test_the_heartbeat_of_a_driver_ends_it_at_once() -> None:
    world = GuideWorld()
    spins_at = world.now_s + 3.0
    world.others.append(lambda now_s: [Frame(0x77F, b"\x05")] if now_s > spins_at else [])
    with pytest.raises(RigError, match="comes from another master"):
        world.guide(whole)
    assert_off(world)
