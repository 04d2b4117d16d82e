"""`canbase setup init`: finds the drives on a bus, asks about the robot, writes its robot.yaml. It moves nothing."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from canbase_commissioning.bus_monitor import OURS, Listener
from canbase_commissioning.drive_survey import FoundAxis, profile_of, survey
from canbase_commissioning.guide import Ask, CommissionError, Tell
from canbase_commissioning.identification import Identification
from canbase_commissioning.onbus.bus_session import BusSession, open_line
from canbase_commissioning.onbus.moving import refuse_beside_masters
from canbase_commissioning.onbus.operator import BACK, NoAnswerError, Operator, Person
from canbase_commissioning.onbus.remote_operator import RemoteOperator
from canbase_commissioning.robot_draft import UNITS, Draft, Questions, ask_about, robot_yaml
from canbase_commissioning.scan_rows import twins_advice
from canbase_commissioning.sdo_session import SdoSession
from canbase_config.errors import ConfigError
from canbase_config.load import load_robot, sample
from canbase_config.robot import Bus
from canbase_driver.cia301.nmt import MAX_NODE_ID
from canbase_driver.cia301.sdo_client import SdoClient
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, warn

ATTEMPTS = 3
THINKING_S = 0.02
"""Between two looks whether the person has answered."""


def run(bus: Bus, output: Path, answers: Path | None, timeout_s: float, *, yes: bool, as_json: bool) -> None:
    """From the bus to the file; exits with 1 when no robot comes of what is there."""
    for file in (output, _draft(output)):
        if file.exists():
            fail(f"{file} exists; it is never overwritten: give --output another name", WRONG_INPUT)
    person: Person = RemoteOperator() if as_json else Operator(answers, yes=yes)
    if bus.is_virtual:
        values = "gear_ratio and velocity_unit are those of the robot.yaml with which they were started"
        person.tell(Tell(f"Simulated drives: {values} (20 and 0.1rpm with --bench)"))
    with open_line(bus) as line:
        axes = _axes(line, timeout_s, person)
    if len(axes) < 2:
        fail(
            "a base needs two motors; check power, cable, termination, bit rate, and that node ids differ. "
            "For drives fresh from the box: canbase bus adopt",
            FAILED,
        )
    try:
        draft = answered_draft(axes, person)
    except CommissionError as error:
        fail(str(error), FAILED)
    _write(output, robot_yaml(_sample_for(bus), draft, bus), person)


def _axes(line: BusSession, timeout_s: float, person: Person) -> list[FoundAxis]:
    """All axes of all motor drives, by node id. Exits with 1 where another master is on the bus."""
    heard = refuse_beside_masters(line)
    node_ids = (node_id for node_id in range(1, MAX_NODE_ID + 1) if node_id not in OURS)
    roster = Identification(node_ids, heard, timeout_s, with_texts=False)
    line.run(roster)
    if roster.twins:
        fail(twins_advice(roster.twins), FAILED)
    for reason in roster.lost.values():
        person.tell(Tell(f"lost while it was read: {reason}", is_loud=True))
    profiles = {node_id: profile_of(card) for node_id, card in roster.cards.items()}
    for node_id in (node_id for node_id, profile in profiles.items() if not profile):
        person.tell(Tell(f"node {node_id} is no motor drive (1000h)"))
    return _surveyed(line, {n: profile for n, profile in profiles.items() if profile}, heard, timeout_s, person)


def _surveyed(
    line: BusSession, profiles: dict[int, str], heard: Listener, timeout_s: float, person: Person
) -> list[FoundAxis]:
    if not profiles:
        return []
    steps = {node_id: survey(node_id, profile) for node_id, profile in profiles.items()}
    session = SdoSession(steps, heard, lambda node_id: SdoClient(node_id, timeout_s, ATTEMPTS))
    line.run(session)
    axes: list[FoundAxis] = []
    for node_id, task in sorted(session.tasks.items()):
        if task.result is None:
            reason = task.error or "another client uses its SDO channel"
            person.tell(Tell(f"node {node_id} was found, then lost: {reason}", is_loud=True))
            continue
        axes += task.result
    for axis in axes:
        person.tell(Tell(f"found {axis.title}, profile {axis.profile}"))
    return axes


def answered_draft(axes: Sequence[FoundAxis], person: Person) -> Draft:
    """The answers of the person; BACK returns to the question before. Raises CommissionError."""
    person.tell(Tell(f"Enter takes the value in [brackets]; {BACK} returns to the question before"))
    given: list[object] = []
    missing: list[Ask] = []
    while True:
        draft = _asked(ask_about(axes), given, missing, person)
        if missing:
            raise NoAnswerError(*missing)
        if draft is not None:
            return draft
        given.pop()


def _asked(questions: Questions, given: list[object], missing: list[Ask], person: Person) -> Draft | None:
    """Asks what is not `given` yet, and notes the answers there. None: the person wants to go back.

    Without a terminal it notes the questions without an answer in `missing`, and the draft is none.
    """
    known = list(given)
    answer: object = None
    while True:
        try:
            step = questions.send(answer)
        except StopIteration as end:
            draft = end.value
            assert isinstance(draft, Draft)
            return draft
        answer = None
        if isinstance(step, Tell):
            if not known:
                person.tell(step)
        elif known:
            answer = known.pop(0)
        else:
            answer = _answer(step, person, missing, is_first=not given)
            if answer == BACK:
                return None
            given.append(answer)


def _stand_in(question: Ask) -> object:
    """Any answer that the question takes."""
    for text in filter(None, (question.default, "1", *UNITS)):
        with suppress(ValueError):
            return question.check(text)
    raise NoAnswerError(question)


def _answer(question: Ask, person: Person, missing: list[Ask], *, is_first: bool) -> object:
    """What the answer means, or BACK."""
    while True:
        try:
            text = person.ask(question, lambda: time.sleep(THINKING_S))
        except NoAnswerError:
            missing.append(question)
            return _stand_in(question)
        try:
            if text != BACK:
                return question.check(text)
            if not is_first:
                return BACK
            raise ValueError("this is the first question")
        except ValueError as error:
            person.again(question, error)


def _sample_for(bus: Bus) -> str:
    """The sample whose other keys fit: a simulated bus is on a bench."""
    return sample("bench" if bus.is_virtual else "example_can0").read_text(encoding="utf-8")


def _draft(output: Path) -> Path:
    """Where the file is until it has passed the check."""
    return output.with_name(f"{output.name}.draft.yaml")


def _write(output: Path, text: str, person: Person) -> None:
    """A robot.yaml that does not pass the check is written beside its name, so that no answer is lost."""
    draft = _draft(output)
    _write_first(draft, text)
    try:
        loaded = load_robot(draft)
    except ConfigError as error:
        print(str(error), file=sys.stderr)
        fail(f"these values do not fit together; they are in {draft}: correct them there, and rename it", FAILED)
    _write_first(output, text)
    draft.unlink()
    for warning in loaded.warnings:
        warn(str(warning).replace(str(draft), str(output)))
    told = (
        f"wrote {output}. It passes canbase config check. Next, with the wheels up:\n"
        f"  canbase doctor --config {output}        what the drives report\n"
        f"  canbase setup commission --config {output}    direction, scale, and whether the drives stop by themselves"
    )
    person.tell(Tell(told))


def _write_first(file: Path, text: str) -> None:
    """A file of that name may have come while the person answered."""
    try:
        with file.open("x", encoding="utf-8") as stream:
            stream.write(text)
    except OSError as error:
        fail(f"{file} cannot be written: {error}", FAILED)
