"""What the driver says on the bus: only what docs/bus.md has, in its order, and nothing because of mad frames."""

from __future__ import annotations

import itertools
import random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from canbase_driver.cia301.frame import Frame
from canbase_runtime.driver_state import DriverState
from support.chain_world import World, robot_of, setpoints

OURS = {0x000, 0x080, 0x77F, 0x27E, 0x201, 0x202, 0x601, 0x602}
"""docs/bus.md, column "sender → receiver": NMT, SYNC, heartbeat, reset request, RPDO1 and SDO of nodes 1 and 2."""
HEARD = (0x081, 0x082, 0x181, 0x182, 0x1FE, 0x281, 0x282, 0x581, 0x582, 0x701, 0x702)
"""What the driver of nodes 1 and 2 takes in."""

frames = st.builds(
    Frame,
    st.one_of(st.sampled_from(HEARD), st.integers(0, 0x7FF)),
    st.one_of(st.binary(max_size=8), st.binary(min_size=8, max_size=8), st.binary(max_size=1)),
)


def names(cycle: list[Frame]) -> list[str]:
    return [f"{frame.cob_id:03X}" for frame in cycle]


@pytest.fixture
def world() -> World:
    return World()


def test_everything_that_is_sent_in_a_life_is_in_the_table_of_the_bus(world: World) -> None:
    world.drive()
    world.node.fail(0, 0x2310)
    world.run(1.0)
    assert world.recovered()
    world.core.request_shutdown()
    world.run(1.0)
    assert {frame.cob_id for cycle in world.ticks for frame in cycle} <= OURS
    assert {0x000, 0x080, 0x77F, 0x27E, 0x201, 0x202} <= {frame.cob_id for cycle in world.ticks for frame in cycle}


def test_each_cycle_is_the_setpoints_of_all_axes_then_sync(world: World) -> None:
    world.drive(seconds=0.5)
    for cycle in world.ticks[-40:]:
        assert [name for name in names(cycle) if name != "77F"] == ["201", "202", "080"]
        assert cycle[-1].data == b""


def test_two_axes_on_one_node_have_two_setpoints_before_one_sync() -> None:
    world = World(robot_of((1, 0, "left"), (1, 1, "right")))
    world.drive(seconds=0.3)
    assert [name for name in names(world.ticks[-2]) if name != "77F"] == ["201", "301", "080"]


def test_no_setpoint_before_the_node_is_started_though_the_other_one_is(world: World) -> None:
    world.bench.nodes[2].power_cycle(world.now_s, off_s=0.5)
    world.enable()
    seen = [frame for _, frame in world.log]
    for node_id in (1, 2):
        start = seen.index(Frame(0x000, bytes([1, node_id])))
        first = next(i for i, frame in enumerate(seen) if frame.cob_id == 0x200 + node_id)
        assert start < first


def test_the_heartbeat_comes_every_100_ms_from_the_first_cycle_on_whatever_the_state(world: World) -> None:
    world.watchdog = None
    world.run(1.5)
    times = [at for at, frame in world.log if frame == Frame(0x77F, b"\x05")]
    gaps = [second - first for first, second in itertools.pairwise(times)]
    assert times[0] == pytest.approx(100.0, abs=0.003)
    assert gaps == pytest.approx([0.1] * len(gaps), abs=0.003)
    assert len(gaps) >= 14


def test_on_a_dead_bus_nothing_but_the_heartbeat_is_even_tried(world: World) -> None:
    world.enable()
    world.cable = False
    world.run(3.0)
    assert {name for cycle in world.ticks[-50:] for name in names(cycle)} == {"77F"}


def test_the_last_words_are_a_quick_stop_for_every_axis_and_sync_in_any_state(world: World) -> None:
    said = ["201h [02 00 00 00 00 00]", "202h [02 00 00 00 00 00]", "080h []"]
    assert [str(frame) for frame in world.core.stop_frames()] == said
    world.drive()
    assert [str(frame) for frame in world.core.stop_frames()] == said


@pytest.mark.parametrize("cob_id", HEARD)
def test_frames_of_a_wrong_length_are_counted_and_change_nothing(world: World, cob_id: int) -> None:
    world.enable()
    world.core.on_frame(Frame(cob_id, bytes(7)), world.now_s)
    sdo_of_others, emcy_is_short = (0x581, 0x582), (0x081, 0x082)
    assert world.snapshot.bus.dropped == int(cob_id not in sdo_of_others + emcy_is_short)
    assert world.core.state is DriverState.ENABLED


def test_a_node_that_runs_before_it_is_booted_does_not_count(world: World) -> None:
    world.core.on_frame(Frame(0x181, bytes.fromhex("37 06 00 00 10 00")), world.now_s)
    world.core.on_frame(Frame(0x281, bytes.fromhex("ff 00 00 00")), world.now_s)
    left = world.snapshot.drives[0]
    assert (left.state, left.statusword, left.velocity_radps) == (None, 0, 0.0)


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(mad=st.lists(frames, max_size=60))
def test_mad_frames_never_raise_and_never_give_a_driver_that_stands_a_target(mad: list[Frame]) -> None:
    world = World()
    world.run(0.2)
    world.ticks.clear()
    for i, frame in enumerate(mad):
        world.core.on_frame(frame, world.now_s)
        if i % 4 == 0:
            world.run(0.01)
    assert [target for cycle in world.ticks for _, target in setpoints(cycle) if target != 0] == []


@pytest.mark.parametrize("seed", range(4))
def test_a_storm_of_mad_frames_while_driving_never_raises_and_never_orders_more_than_was_commanded(seed: int) -> None:
    world = World()
    world.drive()
    dice = random.Random(seed)
    for _ in range(60):
        for _ in range(20):
            data = dice.randbytes(dice.choice((0, 1, 4, 6, 8, 8)))
            world.core.on_frame(Frame(dice.choice(HEARD), data), world.now_s)
        world.run(0.01)
    assert max(abs(speed) for pair in world.targets_mps() for speed in pair) < 0.3001
    assert world.snapshot.bus.dropped > 100
    world.run(3.0)
    assert world.core.state is not DriverState.ENABLED


@pytest.mark.parametrize("watched", [True, False])
def test_setpoints_that_a_kernels_queue_gives_out_late_move_nothing(world: World, watched: bool) -> None:
    """Nobody acknowledges; up to txqueuelen frames wait in the kernel, and go out when the cable is in again.

    driver   |||||||                 ||||||||||| 200 cycles of driving at once
    cable    in    out               in
    drives   ~~~~~~~\\_ off after 0.3 s ____________
    """
    world.drive(seconds=3.0)
    queued = [frame for cycle in world.ticks[-200:] for frame in cycle]
    assert {word for word, _ in setpoints(queued)} == {0x000F}  # operation enabled, at speed
    if not watched:
        world.watchdog = None
    world.cable = False
    world.stands_after(2.0)
    assert world.powered == [False, False]
    before = world.truth
    for frame in queued:
        world.inject(frame.cob_id, frame.data.hex())
    world.run(1.0)
    after = world.truth
    assert world.powered == [False, False]
    assert (after.x_m, after.y_m) == (before.x_m, before.y_m)
