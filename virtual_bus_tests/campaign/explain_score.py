"""`python -m campaign.explain_score --seeds 300`: recordings whose truth is known; is `canbase explain` right?

Each seed is one scenario in virtual time: ordinary use (a goal, the joystick, a stop and its reset, a power cycle),
then one failure, none, or stops in turn: at standstill, two within 3 s, or one after a long hang. It is explained
from the driver's black box and from a listener's frames, with and without robot.yaml, cut at both ends, with gaps in
a node's frames, and read from ASC, BLF, TRC, candump and MCAP files. Each answer is right, "cannot tell", or wrong.
`--seed 7` tells one. Exit code 1: more than one answer of a hundred is wrong.
"""

from __future__ import annotations

import math
import sys
import tempfile
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Final

import can

from campaign.scores import CANNOT_TELL, RIGHT, WRONG, main
from canbase_campaign.forked import in_a_copy
from canbase_campaign.scenario import Start
from canbase_campaign.twins import GOAL, TWINS, Twin
from canbase_config.object_map import POSITION_ACTUAL
from canbase_config.robot import Robot
from canbase_driver.causes import DriverCause
from canbase_driver.runtime import black_box_notes as notes
from canbase_recording.cause import Cause
from canbase_recording.entry import Entry, FrameKind, Note, RecordedFrame
from canbase_recording.explanation import Explanation, explain
from canbase_recording.mcap_export import export
from canbase_recording.recording_file import RecordingFile
from canbase_recording.standstill import WheelStop
from canbase_recording.story import Story
from canbase_runtime.driver_state import DriverState
from canbase_velocity.twist import ZERO, Twist
from support.recorded_failures import FAILURES, MORE
from support.recorded_world import WorldRecorder

SCENARIOS = 300
LOOK_S, JOYSTICK_S, RESTS_S = 0.005, 0.02, 0.6
EARLY_S: Final = 0.15
"""The last sign of life of what fails lies so much before the failure at most: a heartbeat's period and half of it."""
STOOD_S, PATH_M, PATH_SHARE, GAP_S = 0.15, 0.01, 0.05, 0.1
"""A standstill's time and way may differ from the plant's by so much; a longer gap in 6064h is unknown."""
SEEN_S: Final = 0.7
"""A failure that lies so close to an end of the recording need not be in it."""
BOX, WIRE = "black box", "listener"
NO_ANSWER: Final = (Cause.UNKNOWN, Cause.REPORTED)
WEAK: Final = (Cause.WHEEL_SLOW, Cause.NO_MOTION)
"""Of a wheel that gets ever slower."""
LOST: Final = (Cause.FEEDBACK_LOST, Cause.NODE_SILENT)
APPROACH_S: Final = 3.0
"""The base drives ever slower towards an obstacle, before it is stopped for it."""
BOX_S: Final = 10.0
"""`black_box.seconds`."""
TITLE: Final = notes.title("motor_driver", DriverCause.STOP_REQUESTED.value, "service motor_driver/stop")
MCAP: Final = ".mcap"
FILES: Final = (".asc", ".blf", ".trc", ".log", MCAP)

FAILED: Final = (
    *((next(twin for twin in TWINS if twin.key == (what, how)), box, wire) for what, how, box, wire in FAILURES),
    *MORE,
)


@dataclass(frozen=True, slots=True)
class Episode:
    """Something that stops the base, and its first cause by recording; None: this one shows no stop."""

    at_s: float
    causes: dict[str, Cause | None]


@dataclass(slots=True)
class Truth:
    """What happened: rim speeds and ways of both sides over time, from the plant."""

    robot: Robot
    episodes: list[Episode] = field(default_factory=list)
    what: list[str] = field(default_factory=list)
    lies: bool = False
    times: list[float] = field(default_factory=list)
    speeds: dict[str, list[float]] = field(default_factory=lambda: {"left": [], "right": []})
    paths: dict[str, list[float]] = field(default_factory=lambda: {"left": [], "right": []})

    def moved_s(self, side: str, since_s: float, until_s: float, limit_mps: float) -> float:
        """The last time at which the wheel turned faster."""
        first, end = bisect_right(self.times, since_s), bisect_right(self.times, until_s)
        turned = (at for at in range(end - 1, first - 1, -1) if abs(self.speeds[side][at]) > limit_mps)
        at = next(turned, None)
        return since_s if at is None else self.times[at]

    def path_m(self, side: str, since_s: float, until_s: float) -> float:
        """How far the rim went."""
        last = len(self.times) - 1
        first, end = min(bisect_left(self.times, since_s), last), min(bisect_left(self.times, until_s), last)
        return self.paths[side][end] - self.paths[side][first]


class Play:
    """One scenario, in this very world, which is spent then."""

    def __init__(self, start: Start, seed: int) -> None:
        self.world, self.around, self.random = start.world, start.around, Random(f"explain {seed}")
        self.world.random.seed(seed)
        self.recorder, self.truth = WorldRecorder(self.world), Truth(self.world.robot)
        self.ordered: Twist | None = None
        self.boxed_s = math.nan
        """When a stop was requested at standstill, and the driver wrote its black box [s]."""
        self._push()

    def run(self) -> None:
        """Ordinary use, then a failure or none."""
        for _ in range(self.random.choice((0, 1, 1, 2))):
            self.random.choice((self._goal, self._goal, self._joystick, self._estop, self._stop, self._power_cycle))()
            self._pass(self.random.choice((self.random.uniform(0.3, 2.0), self.random.uniform(0.3, 8.0))))
        if self.world.driver.core.state is not DriverState.ENABLED or self.random.random() < 0.15:
            self._joystick()
            self._note("nothing fails")
            if self.world.driver.core.state is DriverState.ENABLED:
                self.random.choice((self._releases, self._stop_at_rest, self._stop_twice, self._hang))()
        else:
            self._fail(*self.random.choice(FAILED))
        self._rest()
        self._pass(self.random.uniform(0.5, 4.0))

    def _push(self) -> None:
        if self.ordered is not None:
            self.world.topics.publish("cmd_vel_joy", self.ordered)
        self.world.clock.after(JOYSTICK_S, self._push)

    def _pass(self, seconds: float) -> None:
        base, truth = self.world.drives.bench.base, self.truth
        end = self.world.clock.now_s + seconds
        while self.world.clock.now_s < end - LOOK_S / 2.0:
            self.world.clock.run_until(self.world.clock.now_s + LOOK_S)
            truth.times.append(self.recorder.now_s)
            for side, speed in (("left", base.v_left_mps), ("right", base.v_right_mps)):
                path = truth.paths[side]
                path.append((path[-1] if path else 0.0) + abs(speed) * LOOK_S)
                truth.speeds[side].append(speed)

    def _until(self, holds: Callable[[], bool], longest_s: float = 12.0) -> None:
        end = self.world.clock.now_s + longest_s
        while not holds() and self.world.clock.now_s < end:
            self._pass(0.05)

    def _rest(self) -> None:
        base, since = self.world.drives.bench.base, [self.world.clock.now_s]

        def rests() -> bool:
            if max(abs(base.v_left_mps), abs(base.v_right_mps)) > self.world.robot.base.standstill_mps:
                since[0] = self.world.clock.now_s
            return self.world.clock.now_s > since[0] + RESTS_S

        self._until(rests, 8.0)

    def _note(self, what: str) -> None:
        self.truth.what.append(f"{self.recorder.now_s:.2f} s {what}")

    def _episode(self, what: str, box: Cause | None, wire: Cause | None) -> None:
        self._note(what)
        self.truth.episodes.append(Episode(self.recorder.now_s, {BOX: box, WIRE: wire}))

    def _drives(self) -> None:
        turn = self.random.choice((0.0, 0.0, self.random.uniform(-0.5, 0.5)))
        self.ordered = Twist(self.random.choice((-1.0, 1.0, 1.0)) * self.random.uniform(0.2, 0.5), turn)
        self._pass(self.random.uniform(1.5, 2.5))

    def _releases(self) -> None:
        self.ordered = ZERO
        self._rest()
        self.ordered = None
        self._pass(0.6)

    def _goal(self) -> None:
        self._note("goal")
        self.world.action.send_goal(self.random.uniform(0.1, 0.8), self.random.uniform(0.2, 0.5))
        self._pass(0.3)
        self._until(lambda: all(goal.ends for goal in self.world.action.goals))

    def _joystick(self) -> None:
        self._note("joystick")
        for _ in range(self.random.randint(1, 2)):
            self._drives()
        self._releases()

    def _estop(self) -> None:
        self._drives()
        self._episode("emergency stop", Cause.EMERGENCY_STOP, None)
        self.around.press(True)
        self._rest()
        self.around.press(False)
        self._resets()

    def _stop(self) -> None:
        self._drives()
        self._episode("stop requested", Cause.STOP_REQUESTED, None)
        self.world.driver.stop()
        self._rest()
        self._resets()

    def _stop_at_rest(self) -> None:
        self._pass(self.random.uniform(0.5, 9.5))
        self._episode("stop requested at standstill", Cause.STOP_REQUESTED, None)
        self.boxed_s = self.recorder.now_s
        self.world.driver.stop()
        self._rest()

    def _stop_twice(self) -> None:
        self._stop_at_rest()
        self.ordered = ZERO
        while self.world.driver.core.state is not DriverState.ENABLED:
            self.world.velocity.reset()
            self.world.driver.reset([])
            self._pass(0.3)
        self.ordered = Twist(self.random.uniform(0.2, 0.4), 0.0)
        self._pass(self.random.uniform(0.8, 2.2))
        self._episode("stop requested", Cause.STOP_REQUESTED, None)
        self.world.driver.stop()
        self._rest()

    def _hang(self) -> None:
        self._drives()
        self._episode("motor_driver hangs", Cause.RECORDER_PAUSED, Cause.DRIVER_SILENT)
        self.world.processes["driver"].hang("explain")
        self._pass(self.random.uniform(BOX_S, 2.0 * BOX_S))
        self.world.processes["driver"].go_on("explain")
        self._resets()
        self._stop_at_rest()

    def _power_cycle(self) -> None:
        self._drives()
        self._episode("a drive without power", Cause.NODE_RESTARTED, Cause.NODE_RESTARTED)
        self.world.drives.node(self.random.randrange(2)).power_cycle(self.world.clock.now_s, 0.5)
        self._rest()
        self._resets()

    def _resets(self) -> None:
        self.ordered = ZERO
        self._pass(self.random.uniform(0.2, 1.0))
        driver = self.world.driver
        for _ in range(12):
            self.world.velocity.reset()
            driver.reset([])
            self._pass(2.0)
            if driver.core.state is DriverState.ENABLED:
                break
        self._note(f"reset: {driver.core.state.name}")
        self.world.release()
        self._pass(0.3)
        self.ordered = None
        self._pass(0.7)

    def _fail(self, twin: Twin, box: Cause | None, wire: Cause | None) -> None:
        if twin.by == GOAL:
            self.world.action.send_goal(4.5, self.random.uniform(0.25, 0.5))
            self.around.cruise_mps = self.world.action.goals[-1].speed_mps if self.world.action.goals else 0.4
            self._pass(self.random.uniform(1.6, 2.5))
        else:
            self.ordered = Twist(self.random.uniform(0.25, 0.5), 0.0)
            self.around.cruise_mps = self.ordered.linear_mps
            self._pass(self.random.uniform(1.6, 2.5))
        self._pass(self.random.uniform(0.0, 0.1))
        self._episode(": ".join(twin.key), box, wire)
        self.truth.lies = twin.lies
        twin.begin(self.world, self.around, self.random)
        if twin.then_zero_s:
            self._pass(twin.then_zero_s)
            self.ordered = ZERO


@dataclass(frozen=True, slots=True)
class View:
    """One recording: which, with robot.yaml or not, from when to when, and what it lost."""

    name: str
    entries: list[Entry]
    robot: Robot | None
    from_s: float
    until_s: float
    lost: tuple[int, float, float]
    file: str
    title: str = ""
    """Of a black box that was written for its last stop."""

    def __str__(self) -> str:
        node, since_s, until_s = self.lost
        words = [f"{self.name} from {self.from_s:.2f} to {self.until_s:.2f} s"]
        words += ["without robot.yaml"] if self.robot is None else []
        words += [f"node {node} lost from {since_s:.2f} to {until_s:.2f} s"] if node else []
        return ", ".join((*words, *filter(None, (self.file, self.title))))


def views(play: Play) -> Iterator[View]:
    """Both recordings as they are, and four that a person may have of them."""
    draw, truth = Random(play.random.random()), play.truth
    end_s, first_s = play.recorder.now_s, truth.episodes[-1].at_s if truth.episodes else play.recorder.now_s / 2.0
    for name, entries in ((BOX, play.recorder.box), (WIRE, play.recorder.wire)):
        whole = View(name, entries, play.world.robot, 0.0, end_s, (0, 0.0, 0.0), "")
        yield whole
        for _ in range(2):
            from_s = draw.choice((0.0, draw.uniform(0.0, first_s)))
            until_s = draw.choice((end_s, draw.uniform(first_s, end_s)))
            lost_s = first_s + draw.uniform(0.1, 1.0)
            node = draw.choice((0, 0, draw.choice(play.world.robot.drives).node_id))
            robot = draw.choice((play.world.robot, None))
            file = draw.choice(("", *FILES)) if name == WIRE else ""
            lost = (node, lost_s, lost_s + draw.uniform(0.15, 2.5)) if node else (0, 0.0, 0.0)
            yield View(name, entries, robot, from_s, until_s, lost, file)
    if play.boxed_s > 0.0:
        from_s, nothing = max(0.0, play.boxed_s - BOX_S), (0, 0.0, 0.0)
        yield View(BOX, play.recorder.box, play.world.robot, from_s, play.boxed_s, nothing, "", TITLE)


def read(view: View) -> tuple[float, list[Entry]]:
    """The entries of this recording, and what its times are less than the truth's."""
    node, lost_s, found_s = view.lost
    entries = [
        entry for entry in view.entries
        if view.from_s <= entry.at_s <= view.until_s
        and not (node and isinstance(entry, RecordedFrame) and entry.cob_id & 0x7F == node
                 and 0x180 <= entry.cob_id < 0x580 and lost_s <= entry.at_s <= found_s)
    ]  # fmt: skip
    if not view.file or not entries:
        return 0.0, [Note(entries[0].at_s, view.title), *entries] if view.title else entries
    with tempfile.TemporaryDirectory(prefix="canbase-explain-") as folder:
        path = Path(folder) / f"recording{'.asc' if view.file == MCAP else view.file}"
        with can.Logger(str(path)) as logger:
            for entry in entries:
                assert isinstance(entry, RecordedFrame)
                at = 1.7e9 + entry.at_s
                logger(can.Message(at, entry.cob_id, is_extended_id=False, data=entry.data, channel=0))
        if view.file == MCAP:
            export(path, path.with_suffix(MCAP), view.robot, None)
            path = path.with_suffix(MCAP)
        with RecordingFile(path) as recording:
            return entries[0].at_s, list(recording.entries())


@dataclass(frozen=True, slots=True)
class Answer:
    """What explain said of one recording. `wrong`: each wrong claim."""

    seed: int
    view: str
    wrong: tuple[str, ...]
    unknown: bool
    what: tuple[str, ...]

    @property
    def score(self) -> str:
        """In one word."""
        return WRONG if self.wrong else CANNOT_TELL if self.unknown else RIGHT


def judge(seed: int, view: View, truth: Truth) -> Answer:
    """What it says against what was."""
    shift_s, entries = read(view)
    told = explain(entries, view.robot)
    wrong: list[str] = []
    said: dict[int, Story] = {}
    for story in told.stories:
        found_s = story.found.at_s + shift_s
        wrong += _numbers(story)
        at = next((n for n in reversed(range(len(truth.episodes))) if truth.episodes[n].at_s - EARLY_S <= found_s), -1)
        cause = truth.episodes[at].causes[view.name] if at >= 0 else None
        if story.cause in NO_ANSWER:
            said.setdefault(at, story)
        elif (cause is story.cause or (cause in WEAK and story.cause in WEAK)) and at not in said:
            said[at] = story
        elif _is_lost(view, story, found_s) or _is_cut(story, cause):
            said.setdefault(at, story)
        elif at < 0 or at not in said or said[at].cause not in NO_ANSWER:
            wrong.append(f"{story.cause.value} at {found_s:.3f} s: {story.found.text}")
        wrong += _standstills(story, told, entries, shift_s, truth)
    for at, episode in enumerate(truth.episodes):
        expected = episode.causes[view.name]
        late_s = APPROACH_S if expected is Cause.OBSTACLE else 1.3
        is_in = view.from_s + SEEN_S + 0.3 <= episode.at_s <= view.until_s - SEEN_S - late_s
        is_in = is_in or (bool(view.title) and episode.at_s == view.until_s)
        if expected is not None and is_in and at not in said:
            wrong.append(f"{expected.value} at {episode.at_s:.3f} s is not told")
    unknown = any(story.cause in NO_ANSWER for story in told.stories)
    return Answer(seed, str(view), tuple(wrong), unknown, tuple(truth.what))


def _is_lost(view: View, story: Story, found_s: float) -> bool:
    """What the recording lost looks as if it was never sent."""
    node, lost_s, back_s = view.lost
    return story.cause in LOST and story.found.node_id == node and lost_s - EARLY_S <= found_s <= back_s


def _is_cut(story: Story, cause: Cause | None) -> bool:
    """The boot-up of the node, or its EMCY, comes after the end."""
    return (
        story.cause is Cause.NODE_SILENT
        and cause in (Cause.NODE_RESTARTED, Cause.DRIVES_DEAF)
        and story.scene.ended_s < story.found.at_s + 1.0
    )


def _numbers(story: Story) -> Iterator[str]:
    """No reaction before its cause, nothing infinite."""
    if story.scene.reaction_s < story.found.at_s - 0.001:
        yield f"reaction {story.found.at_s - story.scene.reaction_s:.3f} s before its cause {story.cause.value}"
    words = [story.found.text, story.reported, *(found.text for _, found in story.also)]
    yield from (f"infinite: {text}" for text in words if " inf " in text or "-inf" in text or "nan" in text.split())


def _standstills(story: Story, told: Explanation, entries: list[Entry], shift_s: float, truth: Truth) -> Iterator[str]:
    if truth.lies:
        return
    robot = truth.robot
    since_s = story.found.at_s
    for wheel in story.standstill.wheels:
        if wheel.stood_s is None:
            continue
        drive = next(d for d in robot.drives if wheel.name in (d.joint, f"node {d.node_id}"))
        came = [since_s, *_positions(told, entries, drive.node_id, since_s, since_s + wheel.stood_s)]
        if came and max((b - a for a, b in pairwise(came)), default=0.0) > GAP_S:
            yield f"{wheel.name}: {wheel.stood_s:.2f} s across a gap of 6064h"
        yield from _differs(wheel, drive.side, since_s + shift_s, story.scene.ended_s + shift_s, truth, robot)


def _positions(
    told: Explanation, entries: Iterable[Entry], node_id: int, since_s: float, until_s: float
) -> list[float]:
    return [
        entry.at_s for entry in entries
        if isinstance(entry, RecordedFrame) and entry.kind is FrameKind.DATA and since_s < entry.at_s <= until_s
        and entry.cob_id & 0x7F == node_id and (layout := told.layouts.of(entry.cob_id, len(entry.data))) is not None
        and any(mapped.base == POSITION_ACTUAL for mapped in layout.mapped)
    ]  # fmt: skip


def _differs(wheel: WheelStop, side: str, since_s: float, ended_s: float, truth: Truth, robot: Robot) -> Iterator[str]:
    assert wheel.stood_s is not None
    limit = robot.base.standstill_mps
    real_s = truth.moved_s(side, since_s, ended_s, limit) - since_s
    slow_s = truth.moved_s(side, since_s, ended_s, 3.0 * limit) - since_s
    if not slow_s - STOOD_S <= wheel.stood_s <= real_s + STOOD_S:
        yield f"{wheel.name}: stationary after {wheel.stood_s:.2f} s, in truth {real_s:.2f} s"
    elif wheel.distance is not None and wheel.unit == "m":
        path_m = truth.path_m(side, since_s, since_s + wheel.stood_s)
        if abs(path_m - wheel.distance) > PATH_M + PATH_SHARE * path_m:
            yield f"{wheel.name}: {wheel.distance:.3f} m, in truth {path_m:.3f} m"


def answers(seeds: Iterable[int]) -> Iterator[Answer]:
    """All recordings of these scenarios; each scenario in a copy of one world."""
    start = Start()

    def played(seed: int) -> list[Answer]:
        play = Play(start, seed)
        play.run()
        return [judge(seed, view, play.truth) for view in views(play)]

    for seed in seeds:
        found = in_a_copy(partial(played, seed))
        yield from found if found is not None else [Answer(seed, "", ("an exception",), False, ())]


def told(answer: Answer) -> str:
    """One recording: what happened, and each wrong claim."""
    return "\n    ".join((f"seed {answer.seed}, {answer.view}: {answer.score}", "; ".join(answer.what), *answer.wrong))


if __name__ == "__main__":
    sys.exit(main("explain", "recordings", __doc__, SCENARIOS, answers, told))
