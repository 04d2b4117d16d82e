"""`python -m campaign.doctor_score --seeds 100`: does the first advice of `canbase doctor` lead to what is wrong?

Each seed is two robots in virtual time: one with the odd drives of this seed after its start and a drive of 1 m, and
the sample robot with one lasting fault, at rest or in motion, or none. The truth is what was drawn. The first advice is
that of the first row that fails, or of the first warning. Right: it names the joint, node or part, and nothing that is
well is accused. Cannot tell: it names none. `--seed 7` tells one. Exit code 1: more than one of a hundred is wrong.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from random import Random
from typing import Final

from campaign.scores import CANNOT_TELL, RIGHT, WRONG, main
from canbase_campaign.advice import read_advice
from canbase_campaign.faults import FAULTS
from canbase_campaign.forked import in_a_copy
from canbase_campaign.odd_trial import Start as OddStart
from canbase_campaign.robots import campaign_robot
from canbase_campaign.scenario import Start
from canbase_doctor.check import Check, Verdict
from canbase_sim.odd.draw import draw
from canbase_velocity.twist import Twist
from support.doctor_look import doctor

ROBOTS = 100
DRIVES_S, LASTS_S, JOYSTICK_S = 1.5, 3.0, 0.02
UNSURE: Final = ("cannot tell", "run doctor again")
WHEEL: Final = ""
"""The wheel that was drawn, by its joint or its node."""
DRIVER, VELOCITY, BUTTON = "motor_driver|driver silent", "safety_filter|velocity_mux", "emergency stop"
WATCHDOG, MASTER, SCANNER = "serve watchdog|watchdog.* has ended or hangs", "another program|foreign master", "scan"
CABLE: Final = "drive silent|no frame received|cable"
TRUTH: Final = {
    "": "nothing is wrong",
    **{f"driver_{how}": DRIVER for how in (
        "dies", "hangs", "asked_to_end", "deactivated", "dies_torn", "thread_stalls", "crashes",
        "switched_off_and_killed")},
    **{f"velocity_{how}": VELOCITY for how in ("dies", "hangs", "crashes")},
    **{f"watchdog_{how}": WATCHDOG for how in ("dies", "hangs", "dies_torn", "bus_problem", "crashes")},
    "watchdog_starved": "own loop late|overloaded", "stop_requested": "motor_driver/stop",
    "lease_lost": VELOCITY, "lease_garbage": "leases.refused", "lease_of_older_version": f"leases.refused|{VELOCITY}",
    "bus_problem": f"{DRIVER}|adapter", "status_lost": "motor_driver/status", "mux_lossy": "cmd_vel_mux",
    "sender_clock_slewed": "clock of the sender", "two_on_a_lock": r"\block\b", "estop_pressed": BUTTON,
    "button_tapped": BUTTON, "estop_stale": "estop_state", "scan_stale": SCANNER, "obstacle": "obstacle",
    **{name: SCANNER for name in FAULTS if name.startswith("scanner_") and name != "scanner_restarts"},
    "second_master_setpoints": MASTER, "second_master_nmt": MASTER, "second_master_sync": MASTER,
    "cable_cut": CABLE, "cable_cut_to_drives": CABLE, "cable_cut_from_drives": CABLE, "no_acknowledge": CABLE,
    "frame_loss": CABLE, "loss_bursts": CABLE, "babbling_node": "bus load|masters",
    "brownout": "3220h", "overvoltage": "3210h",
    **{name: WHEEL for name, kind in FAULTS.items() if "wheel" in kind.draw(Random(0))},
}  # fmt: skip
"""What lasts, and what an advice has to name. Without what ends by itself, what is nobody's fault (a slip, hands on a
joystick), and what doctor finds by processes and the ROS graph: an action server, a computer without canbase."""
LASTING: Final = sorted(TRUTH)
ACCUSED: Final = re.compile(r"\bnode \d|_wheel\b|another program|foreign master|motor_driver|driver's|serve |hangs")


@dataclass(frozen=True, slots=True)
class Answer:
    """What doctor said of one robot. `wrong`: why it is; `rows`: those that are not well."""

    seed: int
    what: str
    wrong: tuple[str, ...] = ()
    unsure: bool = False
    rows: tuple[str, ...] = field(default=(), repr=False)

    @property
    def score(self) -> str:
        """In one word."""
        return WRONG if self.wrong else CANNOT_TELL if self.unsure else RIGHT


def row_text(row: Check) -> str:
    """As a person reads it."""
    return f"{row.name}: {row.found} → {row.advice}"


def first_advice(rows: list[Check]) -> str:
    """Of the first row that fails, or else of the first that is not well; empty: all is."""
    failed = [row for row in rows if row.verdict is Verdict.FAIL]
    return next(map(row_text, failed + [row for row in rows if row.verdict is not Verdict.OK]), "")


def names(node_id: int) -> str:
    """A pattern for a drive of the sample robot."""
    joint = next(drive.joint for drive in campaign_robot().drives if drive.node_id == node_id)
    return rf"\bnode {node_id}\b|\b{joint}\b"


def faulty(start: Start, seed: int) -> Answer:
    """The sample robot with a fault, in this very world, which is spent then."""
    draw_from, world = Random(f"doctor {seed}"), start.world
    name, moves = draw_from.choice(LASTING), draw_from.random() < 0.6
    world.random.seed(seed)
    if moves:
        _push(start)
        world.clock.run_until(world.clock.now_s + DRIVES_S)
    given = FAULTS[name].draw(draw_from) if name else {}
    if name:
        FAULTS[name].begin(world, start.around, given)
    world.clock.run_until(world.clock.now_s + LASTS_S)
    wheel = world.drives.place(given["wheel"])[0] if "wheel" in given else 0
    what = f"{name or 'healthy'} {dict(given)}, {'in motion' if moves else 'at rest'}"
    return judge_fault(seed, what, TRUTH[name] or names(wheel), wheel, [row for row in doctor(world) if row.advice])


def _push(start: Start) -> None:
    start.world.topics.publish("cmd_vel_joy", Twist(0.3, 0.0))
    start.world.clock.after(JOYSTICK_S, _push, start)


def judge_fault(seed: int, what: str, truth: str, wheel: int, rows: list[Check]) -> Answer:
    """What the first advice names, and whether a drive is accused that is well."""
    first = first_advice(rows)
    other = names(3 - wheel) if wheel else "never said"
    wrong = [row_text(row) for row in rows if row.verdict is Verdict.FAIL and re.search(other, row.name)]
    is_right = bool(re.search(truth, first))
    if not is_right and ACCUSED.search(first.partition(": ")[2]):
        wrong.insert(0, f"first advice: {first}")
    unsure = not is_right and bool(first or truth != TRUTH[""])
    return Answer(seed, what, tuple(wrong), unsure, tuple(map(row_text, rows)))


def odd(seed: int) -> Answer:
    """A robot with the odd drives of this seed."""
    drives = draw(seed, [drive.node_id for drive in campaign_robot().drives])
    start = OddStart(campaign_robot(), drives, seed)
    message = start.message()
    rows = [row for row in doctor(start.world) if row.advice]
    message = message or ("" if start.world.driver.enabled else "stopped while doctor looked")
    what = "; ".join([*(f"drive {node}: {each}" for node, each in drives.items()), message or "drove"])
    told = tuple(map(row_text, rows))
    strange = {node for node, each in drives.items() if each.drawn}
    if not message:
        wrong = [text for row, text in zip(rows, told, strict=True)
                 if row.verdict is Verdict.FAIL or not strange & set(read_advice(text).nodes)]  # fmt: skip
        return Answer(seed, what, tuple(wrong), any(word in text for text in told for word in UNSURE), told)
    ails = [one for each in drives.values() for one in each.drawn if one.keys or one.tool or one.unusable or one.stops]
    guilty = {node for node, each in drives.items() if any(one in ails for one in each.drawn)}
    first = first_advice(rows)
    found = any(re.search(names(node), first) for node in guilty)
    wrong = [] if found or not ACCUSED.search(first.partition(": ")[2]) else [f"first advice: {first}"]
    wrong += [text for row, text in zip(rows, told, strict=True) if row.verdict is Verdict.FAIL
              and any(re.search(names(node), row.name) for node in drives.keys() - guilty)]  # fmt: skip
    return Answer(seed, what, tuple(wrong), not found, told)


def answers(seeds: Iterable[int]) -> Iterator[Answer]:
    """Both robots of each seed, each in a copy of this process."""
    start = Start()
    for seed in seeds:
        for each in (partial(odd, seed), partial(faulty, start, seed)):
            yield in_a_copy(each) or Answer(seed, "", ("an exception",))


def told(answer: Answer) -> str:
    """One robot: what was wrong with it, what doctor said, and each wrong advice."""
    lines = [f"seed {answer.seed}: {answer.score}: {answer.what}", *answer.rows]
    return "\n    ".join((*lines, *(f"WRONG: {what}" for what in answer.wrong)))


if __name__ == "__main__":
    sys.exit(main("doctor", "robots", __doc__, ROBOTS, answers, told))
