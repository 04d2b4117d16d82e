"""What the judge excuses hides nothing else: each story has something that is excused, and a safeguard that is broken.

The base then moves, or a goal or a latch ends, as no part may let it; and with all safeguards there is nothing to see.
Times in s.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import pytest

from campaign.removed_safeguards import SAFEGUARDS, remove
from canbase_action_server import causes
from canbase_action_server.outcome import ErrorCode
from canbase_campaign import velocity_process
from canbase_campaign.action_process import Goal
from canbase_campaign.fault import PlannedFault
from canbase_campaign.planned import GoalRequest, Plan, Segment
from canbase_campaign.robots import draw_robot
from canbase_campaign.scenario import Start
from canbase_campaign.world import World
from canbase_config.units import mps_per_bit
from canbase_driver.cia301.frame import Frame
from canbase_driver.snapshot import DriverSnapshot
from canbase_sim.cia301.dictionary import key
from canbase_sim.cia402.states import State as Drive
from canbase_velocity.lease import lease_datagram
from canbase_velocity.twist import Twist
from canbase_watchdog.trip_cause import FINE
from canbase_watchdog.watchdog import State, Watchdog

pytestmark = pytest.mark.campaign
UP = {Drive.SWITCH_ON_DISABLED: 0x06, Drive.READY_TO_SWITCH_ON: 0x07, Drive.QUICK_STOP_ACTIVE: 0x00}
"""Controlwords on the way to operation enabled; 0Fh in all other states."""
SETPOINT = struct.Struct("<Hi")
STARTS_S, ENDS_S, SPEED_MPS = 1.6, 4.0, 0.4
WATCHES_NOTHING = 29
"""A robot whose drives do not stop by themselves."""
TWO_MOTORS_A_SIDE = 420
"""A robot with two motors on each side."""
LOADED = 1031
"""A robot with twice its load, whose velocity loops swing after a stop."""
Break = Callable[[World], None]


def fault(name: str, start_s: float, duration_s: float, **given: object) -> PlannedFault:
    return PlannedFault(name, start_s, duration_s, given)


def stick(mps: float, radps: float, start_s: float, duration_s: float) -> Segment:
    return Segment("joystick", start_s, duration_s, "constant", mps, radps, 20.0)


def plan(*faults: PlannedFault, segments: tuple[Segment, ...] = (), lasts_s: float = 5.0) -> Plan:
    """It does not end before `lasts_s`: a message is lost at the end."""
    return Plan(1, lasts_s, 500_000, segments, (), (), (*faults, fault("odometry_lost", lasts_s - 0.5, 0.1)))


def goes_on(world: World, pulse_s: float = 9.0) -> None:
    """The driver enables its drives and moves them, in pulses, from STARTS_S on, whatever is latched."""
    begins, driver, changed = world.clock.now_s + STARTS_S, world.driver, world.driver._changed

    def moving() -> list[Frame]:
        moves = (world.clock.now_s - begins) % (pulse_s + 0.4) < pulse_s
        sent = []
        for drive in world.robot.drives:
            state = world.drives.bench.nodes[drive.node_id].axes[drive.axis].state
            bits = round(moves * SPEED_MPS / mps_per_bit(drive, world.robot.base.wheel_radius_m))
            data = SETPOINT.pack(UP.get(state, 0x0F), bits)
            sent.append(Frame(0x200 + 0x100 * drive.axis + drive.node_id, data))
        return [*sent, Frame(0x080, b"")]

    def mad(frames: list[Frame]) -> list[Frame]:
        is_mad = begins <= world.clock.now_s < begins + ENDS_S - STARTS_S
        beats = [frame for frame in frames if frame.cob_id >= 0x700]
        return [*beats, *moving()] if is_mad else changed(frames)

    driver._changed = mad  # type: ignore[method-assign]


def creeps(world: World) -> None:
    """Where zero is commanded the driver sends setpoints of 4 cm/s."""
    changed = world.driver._changed

    def creeping(frames: list[Frame]) -> list[Frame]:
        sent = []
        for frame in changed(frames):
            for drive in world.robot.drives:
                if frame.cob_id == 0x200 + 0x100 * drive.axis + drive.node_id and frame.data[2:] == bytes(4):
                    bits = round(0.04 / mps_per_bit(drive, world.robot.base.wheel_radius_m))
                    frame = Frame(frame.cob_id, SETPOINT.pack(0x0F, bits))
            sent.append(frame)
        return sent

    world.driver._changed = creeping  # type: ignore[method-assign]


def gentle_ramps(world: World) -> None:
    """The driver has set ramps that hardly brake."""
    for node in world.drives.bench.nodes.values():
        for index in (0x6084, 0x6085):
            node.dictionary.values[key(index, 0)] //= 50


def no_masters(world: World) -> None:
    """The driver has left 1016h empty."""
    for node in world.drives.bench.nodes.values():
        for sub in (1, 2):
            node.dictionary.values[key(0x1016, sub)] = 0


def scaled(seen: DriverSnapshot, factor: float) -> DriverSnapshot:
    """The same, with this share of each distance and speed."""
    pose, twist = seen.odometry.pose, seen.odometry.twist
    return replace(
        seen,
        odometry=replace(
            seen.odometry,
            pose=replace(pose, x_m=factor * pose.x_m, y_m=factor * pose.y_m),
            twist=replace(twist, linear_mps=factor * twist.linear_mps),
        ),
    )


def counts_less(world: World) -> None:
    """drive_distance_server takes 0.8 of each way for the whole."""
    subscribers = world.topics._subscribers["odom"]
    at, (process, do) = next(each for each in enumerate(subscribers) if each[1][0] is world.action)

    def less(seen: DriverSnapshot) -> None:
        do(scaled(seen, 0.8))

    subscribers[at] = (process, less)


def counts_more(world: World) -> None:
    """The driver takes each metre for one and a half."""
    core = world.driver.core
    told = core.snapshot
    core.snapshot = lambda now_s: scaled(told(now_s), 1.5)  # type: ignore[method-assign]


def loses_in_silence(world: World) -> None:
    """The pose misses what the wheels rolled, and odometry does not count it."""
    core = world.driver.core
    shown = core.snapshot

    def silent(now_s: float) -> DriverSnapshot:
        snapshot = shown(now_s)
        return replace(snapshot, odometry=replace(snapshot.odometry, pose_resets=0))

    core.snapshot = silent  # type: ignore[method-assign]


def forgets_the_second(world: World) -> None:
    """The watchdog's second trip ends by itself."""
    tick = Watchdog.tick

    def forgetful(self: Watchdog, now_s: float) -> object:
        frames = tick(self, now_s)
        if self._state is State.TRIPPED and self._settled and self.trips >= 2:
            self._state, self._verdict, self._stoppers = State.WATCHING, FINE, []
        return frames

    Watchdog.tick = forgetful  # type: ignore[assignment, method-assign]


def goals_are_not_taken_over(world: World) -> None:
    """drive_distance_server does not look who has the base."""
    causes.ALL = tuple(row for row in causes.ALL if row[1].code is not ErrorCode.TAKEN_OVER)


def goals_drive_on(world: World) -> None:
    """It orders motion again 1 s after the end of a goal."""
    action = world.action

    def on_end(goal: Goal) -> None:
        world.clock.after(1.0, orders)

    def orders() -> None:
        twist = Twist(0.3, 0.0)
        action.on_order(twist)
        world.topics.publish("cmd_vel_action", twist)

    ends = action._on_end
    action._on_end = lambda goal: (ends(goal), on_end(goal))  # type: ignore[assignment, func-returns-value]


def brakes_softly(world: World) -> None:
    """The filter's leases never say that the base has to brake hard."""
    velocity_process.lease_datagram = partial(_soft, lease_datagram)  # type: ignore[attr-defined]


def _soft(
    real: Callable[..., bytes], sequence: int, stamp_ns: int, twist: Twist, *, brakes_hard: bool = False
) -> bytes:
    return real(sequence, stamp_ns, twist, brakes_hard=False)


STOPPED = fault("stop_requested", 0.6, 0.5)
SHORT, LONG = (stick(0.4, 0.0, 0.0, 0.5),), (stick(0.6, 0.0, 0.0, 9.0),)
UNWATCHED = "watchdog:all+drives:heartbeat_consumer"
UNMINDED = "mux:neutral_start+power:command_not_zero+driver:reset_needs_zero+driver:zero_before_motion"
CUT, WALL = fault("cable_cut_to_drives", 0.8, 3.5), fault("obstacle", 0.6, 3.0, margin_m=0.1)
BLIND = fault("scanner_blind_ahead", 0.8, 3.5, margin_m=None)
SYNC = fault("second_master_sync", 0.75, 0.02, on=True)
HELD = fault("stick_held", 1.5, 3.0, twist=Twist(0.3, 0.0))
RESET = plan(STOPPED, HELD, segments=(stick(0.3, 0.0, 0.0, 0.5),))
TURNED = (stick(0.0, 1.2, 0.4, 0.6), stick(0.6, 0.0, 1.2, 4.0))
GOAL, LONG_GOAL = GoalRequest(0.1, 0.5, 0.3, None), GoalRequest(0.1, 1.5, 0.3, None)
PRESSED = fault("estop_pressed", 2.0, 2.0)
TWICE = plan(
    *(fault("lease_lost", start_s, 0.5, value=1.0) for start_s in (0.8, 4.6)),
    segments=(stick(0.4, 0.0, 0.0, 1.4), stick(0.0, 0.0, 1.5, 2.5), stick(0.4, 0.0, 4.0, 3.0)),
    lasts_s=7.0,
)


@dataclass(frozen=True, slots=True)
class Story:
    """`breaks` and `without`: what is wrong. `found`: the property that does not hold then."""

    what: str
    plan: Plan
    found: str
    breaks: Break | None = None
    without: str = ""
    robot: int = 0


STORIES = (
    Story("a twin that orders nothing, and a driver that goes on in pulses",
          plan(STOPPED, fault("twin_node", 1.5, 3.0, wheel=0), segments=SHORT), "held",
          partial(goes_on, pulse_s=0.6), UNWATCHED),
    Story("a watchdog that is deaf for 3 s, and a driver that goes on in pulses",
          plan(STOPPED, fault("watchdog_bus_problem", 1.5, 3.0), segments=SHORT), "held",
          partial(goes_on, pulse_s=0.6), f"{UNWATCHED}+driver:watchdog_missing"),
    Story("an encoder that counts twice the way, and a driver that goes on in pulses",
          plan(STOPPED, fault("encoder_scaled", 0.2, 4.5, wheel=0, factor=2.0), segments=SHORT), "held",
          partial(goes_on, pulse_s=0.3), UNWATCHED),
    Story("drives that stop as weakly as they were told to", plan(CUT, segments=LONG), "heartbeat", gentle_ramps),
    Story("a SYNC of a stranger, and drives that were never told whom to watch", plan(SYNC, CUT, segments=LONG),
          "heartbeat", no_masters, "drives:heartbeat_consumer"),
    Story("a goal of a server that counts less than the way", replace(plan(), goals=(GOAL,)), "goal", counts_less),
    Story("a dead encoder, and a stick that is held over a reset",
          replace(RESET, faults=(*RESET.faults, fault("encoder_lost", 1.7, 3.0, wheel=0)), resets_s=(2.0, 2.6)),
          "neutral", None, UNMINDED),
    Story("a wall and the SYNC of a stranger", plan(WALL, SYNC, segments=LONG), "obstacle", None, "filter:obstacle"),
    Story("a wall and a base that has turned", plan(fault("obstacle", 0.3, 4.0, margin_m=0.1), segments=TURNED),
          "obstacle", None, "filter:obstacle"),
    Story("a scanner that hides what is ahead, after a time in which it told", plan(BLIND, segments=LONG), "blind",
          None, "filter:blind"),
    Story("the same in a tight curve", plan(BLIND, segments=(stick(0.6, 1.3, 0.0, 9.0),)), "blind", None,
          "filter:blind"),
    Story("a second trip after a first one that was reset", replace(TWICE, resets_s=(2.2,)), "latched",
          forgets_the_second),
    Story("an encoder that was off for a moment, and odometry that is for ever",
          plan(fault("encoder_scaled", 0.1, 0.1, wheel=0, factor=0.5), segments=(stick(0.4, 0.0, 0.5, 3.0),)),
          "odometry", counts_more),
    Story("a driver that is off the bus in motion, and does not count the distance that its pose misses",
          plan(fault("bus_problem", 1.5, 0.33), segments=(stick(0.6, 0.0, 0.0, 9.0),)), "odometry", loses_in_silence),
    Story("a watchdog that gets its processor now and then, and looks at nothing",
          plan(fault("driver_dies", 1.0, 4.0), fault("watchdog_starved", 0.9, 4.0, share=0.9), segments=LONG),
          "envelope", None, "watchdog:all", WATCHES_NOTHING),
    Story("a motor that brakes with all its force beside one with a reversed encoder, and drives without masters",
          plan(fault("encoder_reversed", 0.84, 4.0, wheel=2), replace(CUT, start_s=0.85),
               segments=(stick(0.4, 0.0, 0.0, 9.0),)),
          "heartbeat", no_masters, "drives:heartbeat_consumer", TWO_MOTORS_A_SIDE),
    Story("a goal, and a joystick at zero that takes the base and lets go",
          replace(plan(segments=(stick(0.0, 0.0, 0.8, 0.6),)), goals=(LONG_GOAL,)), "over", goals_are_not_taken_over),
    Story("a goal that has ended", replace(plan(), goals=(GOAL,)), "over", goals_drive_on),
    Story("an emergency stop that brakes as an ordinary one",
          plan(PRESSED, segments=(stick(0.8, 0.0, 0.0, 9.0),)), "short", brakes_softly),
    Story("the same in a curve", plan(PRESSED, segments=(stick(0.8, 0.5, 0.0, 9.0),)), "short", brakes_softly),
    Story("a driver that creeps after each order of zero", plan(segments=SHORT), "rest", creeps, "watchdog:all"),
    Story("a stick that is held while no scans come", plan(fault("scan_stale", 0.8, 2.2, share=1.0), segments=LONG),
          "pauses", None, UNMINDED),
    Story("a loaded base that swings back after its drives' own stop, and drives without masters",
          plan(replace(CUT, start_s=2.0), segments=(stick(1.1, 0.0, 0.0, 9.0),)), "heartbeat", no_masters,
          "drives:heartbeat_consumer", LOADED),
)  # fmt: skip


@lru_cache(maxsize=2)
def start_of(number: int) -> Start:
    return Start(draw_robot(number))


def properties(story: Story, monkeypatch: pytest.MonkeyPatch, broken: bool) -> set[str]:
    """Those that do not hold."""
    start = start_of(story.robot)
    breaks = story.breaks
    monkeypatch.setitem(SAFEGUARDS, "broken", lambda: breaks(start.world) if breaks else None)
    taken_out = "+".join(filter(None, (story.without, "broken"))) if broken else ""
    result = start.fork(story.plan, partial(remove, taken_out))
    return {violation.name for violation in result.violations}


@pytest.mark.parametrize("story", STORIES, ids=lambda story: story.what)
def test_an_excuse_hides_nothing_else(story: Story, monkeypatch: pytest.MonkeyPatch) -> None:
    assert story.found in properties(story, monkeypatch, broken=True)


@pytest.mark.parametrize("story", STORIES, ids=lambda story: story.what)
def test_with_all_safeguards_there_is_nothing_to_see(story: Story, monkeypatch: pytest.MonkeyPatch) -> None:
    assert properties(story, monkeypatch, broken=False) == set()
