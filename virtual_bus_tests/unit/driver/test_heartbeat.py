"""1016h:2, the drive's own watch over the driver's heartbeat: the driver falls silent while the watchdog's beats go on.

The watchdog would stop the base too, and first; here it is blind: its heartbeat and its "all is well" come from the
test, so that whatever stops the wheels is the drive alone.
"""

from __future__ import annotations

import pytest

from canbase_runtime.driver_state import DriverState
from canbase_sim.personality import PERSONALITIES
from support.chain_world import KINDS, World, world_of

HEARTBEAT_S = 0.3
"""timeouts.drive_heartbeat_s of the sample."""
SENT_EVERY_S = HEARTBEAT_S / 3
BRAKING_S = 0.2
"""From 0.3 m/s by 6085h, 2 m/s²: 0.15 s; and a cycle."""
WATCHES_BOTH = [
    kind for kind in KINDS if PERSONALITIES[kind].heeds_heartbeats and PERSONALITIES[kind].heartbeat_entries > 1
]
WATCHES_ONE = [kind for kind in KINDS if PERSONALITIES[kind].heeds_heartbeats and kind not in WATCHES_BOTH]


def driving(kind: str) -> World:
    """At 0.3 m/s, beside a watchdog that from now on only says that all is well."""
    world = world_of(kind)
    world.drive()
    world.watchdog = None
    return world


def run_beside_a_blind_watchdog(world: World, seconds: float) -> None:
    for _ in range(round(seconds / 0.05)):
        world.inject(0x77E, "05")
        world.inject(0x1FE, "01 00 80 00 14 00 00 00")
        world.run(0.05)


def fall_silent(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its heartbeat ends; everything else goes on."""
    monkeypatch.setattr(world.core, "_heartbeat", lambda _now: [])


def test_there_are_kinds_of_both_sorts() -> None:
    assert (WATCHES_BOTH, WATCHES_ONE) == (["elmo_gold", "epos4", "generic", "inverter"], ["kinco", "nanotec"])


@pytest.mark.parametrize("kind", WATCHES_BOTH)
def test_without_the_drivers_heartbeat_it_stops_by_itself_though_setpoints_go_on(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """t   0  last heartbeat, setpoints 0.3 m/s go on ── 0.3  EMCY 8130h, quick stop ── 0.5  stands, latched"""
    world = driving(kind)
    assert world.node.dictionary.values[0x1016_02] == 0x7F << 16 | round(1000 * HEARTBEAT_S)
    fall_silent(world, monkeypatch)
    since = world.now_s
    run_beside_a_blind_watchdog(world, HEARTBEAT_S - SENT_EVERY_S - 0.05)
    assert world.truth.linear_mps == pytest.approx(0.3, abs=0.01)
    assert not world.core.stops
    run_beside_a_blind_watchdog(world, 2.5)
    stood_after_s = world.now_s - world.truth.standing_s - since
    assert HEARTBEAT_S - SENT_EVERY_S < stood_after_s < HEARTBEAT_S + BRAKING_S
    assert any(data.hex(" ").startswith("30 81") for data in world.sent(0x081, since))
    assert world.core.state is DriverState.LATCHED


@pytest.mark.parametrize("kind", WATCHES_BOTH)
def test_a_driver_that_is_dead_is_missed_by_the_drive_itself(kind: str) -> None:
    world = driving(kind)
    world.kill_driver()
    since = world.now_s
    run_beside_a_blind_watchdog(world, 1.5)
    assert world.now_s - world.truth.standing_s - since < HEARTBEAT_S + BRAKING_S
    assert not any(world.powered)


@pytest.mark.parametrize("kind", WATCHES_ONE)
def test_with_one_entry_it_watches_the_watchdog_alone_and_leaves_the_driver_to_that(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = driving(kind)
    assert world.node.dictionary.values[0x1016_01] >> 16 == 0x7E
    fall_silent(world, monkeypatch)
    run_beside_a_blind_watchdog(world, 1.0)
    assert world.truth.linear_mps == pytest.approx(0.3, abs=0.01)
    since = world.now_s
    world.run(1.5)  # now the watchdog's heartbeat ends too
    assert world.now_s - world.truth.standing_s - since < HEARTBEAT_S + BRAKING_S
