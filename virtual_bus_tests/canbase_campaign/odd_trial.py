"""A robot with odd drives from power on: it boots, drives 1 m and stops, or a message tells a person how to cure it.

What the message names is done as a person does it, with the drive's manual, and the robot is tried again: a message
that sends a person the wrong way does not get it to drive.
"""

from __future__ import annotations

import json
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from canbase_campaign.advice import OF_A_DRIVE, Advice, has_key, read_advice
from canbase_campaign.judge import Judge
from canbase_campaign.outside import Outside, Surroundings
from canbase_campaign.planned import Plan
from canbase_campaign.robots import campaign_robot
from canbase_campaign.world import World
from canbase_config.profile import Profile
from canbase_config.robot import Robot
from canbase_sim.odd.draw import OddDrive, draw

DISTANCE_M, SPEED_MPS = 1.0, 0.4
STARTS_S, SETTLES_S, LONGEST_GOAL_S, REST_S, LOOK_S = 40.0, 0.7, 15.0, 0.5, 0.05
MOST_TRIES = 10
"""More messages than that one after the other: nobody has so much patience."""
MISSING = "drive missing"
"""The cause of a driver whose drives do not boot, as /diagnostics has it."""
GOES_ON = "and goes on"
"""A boot that needs its time."""
SEND_A_NEW_GOAL, MOST_GOALS = "send a new goal", 4
"""What a message says, and how often a person does it."""
RESETS = 2
"""A person resets a robot whose message names no key so often before giving up."""


@dataclass(frozen=True, slots=True)
class Attempt:
    """One start. `message`: empty, when it drove and stopped."""

    message: str
    violations: tuple[str, ...] = ()
    virtual_s: float = 0.0
    resets: int = 0


@dataclass(slots=True)
class Trial:
    """All starts of one seed. `wrong`: what must not be; `cures`: what was done, in order."""

    seed: int
    drives: Mapping[int, OddDrive]
    cures: list[str] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    ended: str = ""
    virtual_s: float = 0.0


class Setup:
    """robot.yaml and the drive profiles of one robot, as a person edits them. The profiles are files in `folder`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._robot: dict[str, Any] = campaign_robot().model_dump(mode="json", exclude_unset=True)
        self._profiles: dict[int, dict[str, Any]] = {}
        self._common: dict[str, Any] = {}

    def set(self, node_id: int, key: str, value: Any) -> None:
        """A key of the profile of this node's drive, or of robot.yaml."""
        if has_key(Profile, key):
            _put(self._profiles.setdefault(node_id, {"title": "odd drive"}), key, value)
        elif key in OF_A_DRIVE:
            self._drive(node_id)[key] = value
        else:  # of the whole robot: what suits all of its drives
            suits = min if key.startswith("limits.") else max
            self._common[key] = suits(self._common.get(key, value), value)
            _put(self._robot, key, self._common[key])

    def robot(self) -> Robot:
        """As `canbase config check` reads it. Raises ValidationError."""
        for node_id, profile in self._profiles.items():
            text = json.dumps(profile, indent=1)
            file = self._folder / f"{sha256(text.encode()).hexdigest()[:16]}.yaml"
            file.write_text(text)
            self._drive(node_id)["profile"] = str(file)
        return Robot.model_validate(self._robot)

    def _drive(self, node_id: int) -> dict[str, Any]:
        return next(drive for drive in self._robot["drives"] if drive["node_id"] == node_id)


def _put(section: dict[str, Any], key: str, value: Any) -> None:
    *sections, last = key.split(".")
    for name in sections:
        section = section.setdefault(name, {})
    section[last] = value


def attempt(robot: Robot, drives: Mapping[int, OddDrive], seed: int) -> Attempt:
    """One start of this robot, from power on."""
    start = Start(robot, drives, seed)
    try:
        message = start.message()
    except Exception:  # noqa: BLE001 - whatever it is: that nothing raises is one of the properties
        return Attempt("", (f"exception: {traceback.format_exc(limit=-4)}",))
    found = tuple(f"{violation.name}: {violation.detail}" for violation in start.judge.violations)
    return Attempt(message, found, start.world.clock.now_s - start.began, start.resets)


class Start:
    """One start from power on, in its own world."""

    def __init__(self, robot: Robot, drives: Mapping[int, OddDrive], seed: int) -> None:
        self.world = world = World(robot, seed, odd=drives)
        self.began, self.resets = world.clock.now_s, 0
        around = Surroundings(world, has_scanner=robot.safety.scan.required)
        plan = Plan(seed, STARTS_S, robot.bus.bitrate, (), (), (), ())
        self._outside = Outside(world, around, plan, self.began)
        self.judge = Judge(world, around, self._outside, plan)

    def message(self) -> str:
        """Empty: it drove 1 m and stopped."""
        world, clock = self.world, self.world.clock
        if not self._is_enabled():
            return self._told()
        world.release()
        clock.run_until(clock.now_s + SETTLES_S)
        goals = world.action.goals
        for _ in range(MOST_GOALS):
            self._drive()
            if not (goals and goals[-1].ends and SEND_A_NEW_GOAL in goals[-1].ends[-1].message):
                break
        self.judge.finish()
        if not goals:
            return f"the goal was refused; {self._told()}"
        if not goals[-1].ends:
            return f"the goal never ended; {self._told()}"
        outcome = goals[-1].ends[-1]
        if outcome.code.name != "OK":
            return f"goal: {outcome.code.name}: {outcome.message}; {self._told()}"
        return "" if world.drives.bench.base.resting else f"the base does not stand; {self._told()}"

    def _drive(self) -> None:
        world, clock = self.world, self.world.clock
        before, end = len(world.action.goals), clock.now_s + LONGEST_GOAL_S
        world.action.send_goal(DISTANCE_M, SPEED_MPS)
        while clock.now_s < end and not (len(world.action.goals) > before and world.action.goals[-1].ends):
            clock.run_until(clock.now_s + LOOK_S)
        clock.run_until(clock.now_s + REST_S)

    def _is_enabled(self) -> bool:
        """Until it is, or is not after its time. A person resets what is latched, when the message has no key."""
        clock, driver = self.world.clock, self.world.driver
        end = clock.now_s + max(STARTS_S, self.world.robot.timeouts.boot_s + 2.0)
        while clock.now_s < end:
            clock.run_until(clock.now_s + LOOK_S)
            if driver.enabled:
                return True
            if driver.cause == MISSING and self._is_clear(read_advice(self._told())):
                return False
            if driver.latched:
                clock.run_until(clock.now_s + 1.0)
                if read_advice(self._told()).keys or self.resets == RESETS:
                    return False
                self.resets += 1
                self._outside.reset()
                clock.run_until(clock.now_s + 3.0)
        return False

    @staticmethod
    def _is_clear(advice: Advice) -> bool:
        """A person need not wait any longer."""
        return (bool(advice.keys) or advice.gives_up or advice.by_tool) and GOES_ON not in advice.text

    def _told(self) -> str:
        """The text that a person reads: state and cause of the driver, the boot problem of each drive (its own entry of
        /diagnostics), and the trip of the watchdog."""
        snapshot = self.world.driver.core.snapshot(self.world.clock.now_s)
        node_ids = {drive.joint: drive.node_id for drive in self.world.robot.drives}
        problems = dict.fromkeys(
            f"node {node_ids[drive.joint]}: {drive.boot_problem.removeprefix(f'node {node_ids[drive.joint]}: ')}"
            for drive in snapshot.drives
            if drive.boot_problem
        )
        finding = snapshot.finding
        watchdog = self.world.watchdog.core.status.verdict
        tripped = f"watchdog: {watchdog.cause.name}: {watchdog.detail}" if watchdog.cause.value else ""
        return "; ".join(
            filter(None, (f"{snapshot.state.name} {finding.cause.value}: {finding.detail}", *problems, tripped))
        )


def try_out(seed: int, folder: Path, only: tuple[str, ...] = ()) -> Trial:
    """The odd drives of this seed, tried until they drive, or until a message does not help. `only`: see `draw`."""
    setup = Setup(folder)
    node_ids = sorted(drive.node_id for drive in setup.robot().drives)
    trial = Trial(seed, draw(seed, node_ids, only))
    drives = dict(trial.drives)
    for _ in range(MOST_TRIES):
        try:
            robot = setup.robot()
        except ValidationError as error:
            trial.wrong.append(f"the named key is refused: {error.errors()[0]['msg']}")
            trial.ended = "refused key"
            return trial
        once = attempt(robot, drives, seed)
        trial.virtual_s += once.virtual_s
        trial.wrong += once.violations
        if not once.message:
            trial.ended = "drove" if not trial.cures else "drove after cures"
            return trial
        trial.messages.append(once.message)
        words = {word for odd in drives.values() for each in odd.drawn for word in each.stops}
        if any(word in once.message for word in words):
            trial.ended = "stopped, and told"
            return trial
        if _is_rightly_given_up(read_advice(once.message), drives):
            trial.ended = "cannot be used"
            return trial
        done = _cure(read_advice(once.message), setup, drives)
        if not done or any(cure in trial.cures for cure in done):
            trial.wrong.append("no named key helps" if not done else f"done before in vain: {'; '.join(done)}")
            trial.ended = "not cured"
            return trial
        trial.cures += done
    trial.wrong.append(f"{MOST_TRIES} messages")
    trial.ended = "not cured"
    return trial


def _is_rightly_given_up(advice: Advice, drives: Mapping[int, OddDrive]) -> bool:
    unusable = {node_id for node_id, drive in drives.items() if any(each.unusable for each in drive.drawn)}
    return advice.gives_up and bool(unusable & set(advice.nodes)) and advice.names_a_thing


def _cure(advice: Advice, setup: Setup, drives: dict[int, OddDrive]) -> list[str]:
    """Do what the message says, by the manuals of the drives that it names. What was done; empty: it helps nobody."""
    done = []
    if not advice.names_a_thing:
        return []
    for node_id in advice.nodes:
        odd = drives[node_id]
        for each in odd.drawn:
            for key in sorted(advice.keys.keys() & each.keys.keys()):
                value = each.keys[key] if advice.keys[key] is None else advice.keys[key]
                setup.set(node_id, key, value)
                done.append(f"node {node_id}: {key}: {value}")
        if advice.by_tool and not done:
            set_right = [each for each in odd.drawn if each.tool & set(advice.objects)]
            done += [f"node {node_id}: the manufacturer's tool cures {each.name}" for each in set_right]
            drives[node_id] = odd.without(set_right)
    return done
