"""`canbase bus adopt` on the bus: bit rate, node ids, both stored. What is sent and decided: `lss/`, `census.py`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Final, TypeVar

from canbase_base.single_instance import TakenError, bus_name, take
from canbase_commissioning.bus_monitor import ListenSession
from canbase_commissioning.census import Census, require_no_power
from canbase_commissioning.conversation import Conversation, ConversationError, Talk, say
from canbase_commissioning.guide import Ask, CommissionError, Tell, confirm
from canbase_commissioning.lss import bit_rate_search, master, protocol
from canbase_commissioning.lss.adoption import discover, is_anybody_here, look, require_lss, take_into_use
from canbase_commissioning.lss.assignment import check_node_id, proposals, too_few, too_many
from canbase_commissioning.lss.bit_rate_search import Heard
from canbase_commissioning.lss.protocol import Identity
from canbase_commissioning.onbus.bus_session import BusSession
from canbase_commissioning.onbus.cable import THINKING_S, Cable
from canbase_commissioning.onbus.moving import refuse_beside_masters
from canbase_commissioning.onbus.operator import Operator, Stopped, answered, stopping_signals, unbroken
from canbase_commissioning.onbus.progress import Bar
from canbase_config.robot import Bus, Robot
from canbase_driver.cia301.frame import Frame
from canbase_runtime.terminal import FAILED, fail

T = TypeVar("T")
SWITCH_S: Final = 0.5
"""The drives change their bit rate so long after the order, and are silent as long again [s]."""
UNTOUCHED: Final = "Nothing was changed"
UNSTORED: Final = "Nothing was stored: a power cycle brings back the node ids and the bit rate of before"
STORED: Final = "Some settings may be stored: canbase bus scan shows what is there"
SAFE: Final = (
    "All drives on this bus lose their node ids and restart, then get new ones. No motor may have power: wheels up, "
    "emergency stop pressed. Go on?"
)


@dataclass(slots=True)
class Adoption:
    """One run. `left`: what the drives are like if it ends here."""

    cable: Cable
    robot: Robot | None
    person: Operator
    bar: Bar
    sent: set[Frame] = field(default_factory=set)
    left: str = UNTOUCHED
    line: BusSession | None = None

    @contextmanager
    def at(self, bitrate: int) -> Iterator[None]:
        """Talks at this bit rate. On every way out the drives are in LSS waiting."""
        with self.cable.at(bitrate) as self.line:
            try:
                yield
            finally:
                with unbroken():
                    self._farewell()
                self.line = None

    def talk(self, steps: Talk[T]) -> T:
        """The steps to their end. Raises ConversationError."""
        assert self.line is not None
        conversation = Conversation(steps, self.bar.show, self.sent)
        self.line.run(conversation)
        if conversation.error is not None:
            raise conversation.error
        if self.line.problem:
            raise ConversationError(self.line.problem)
        return conversation.result  # type: ignore[return-value]  # of T; None for steps that bring nothing

    def tell(self, text: str) -> None:
        """A line for the person."""
        self.bar.stop()
        self.person.tell(Tell(text))

    def ask(self, question: Ask) -> object:
        """The person's answer. Raises CommissionError where there is none, or a confirmation is refused."""
        self.bar.stop()
        return answered(self.person, question, partial(time.sleep, THINKING_S))

    def _farewell(self) -> None:
        """Where nothing of LSS was sent, there is nothing to end: another master may be on the bus."""
        assert self.line is not None
        if any(frame.cob_id == protocol.REQUEST for frame in self.sent):
            self.line.run(Conversation(_wait_again(), sent=self.sent))


def run(
    bus: Bus, robot: Robot | None, answers: Path | None, present: int | None, *, yes: bool, sets_link: bool
) -> None:
    """The whole way. `bus.bitrate` is what the drives shall have, `present` what they have, None: it is searched.

    Exits with 1 when the drives are not ready at its end, 128 + n after a signal.
    """
    person = Operator(answers, yes=yes)
    try:
        held = take("driver", bus_name(bus.arguments()))
    except TakenError as error:
        fail(str(error), FAILED)
    with held, Bar() as bar, stopping_signals():
        adoption = Adoption(Cable(bus, person, sets_link=sets_link), robot, person, bar)
        try:
            node_ids = _adopt(adoption, present)
        except (ConversationError, CommissionError) as error:
            bar.stop()
            fail(f"{error}. {adoption.left}", FAILED)
        except Stopped as stopped:
            bar.stop()
            fail(f"{stopped}. The drives are in LSS waiting. {adoption.left}", 128 + stopped.number)
        finally:
            with unbroken():
                adoption.cable.give_back()
    _report(person, node_ids, bus)


def _adopt(adoption: Adoption, present: int | None) -> dict[Identity, int]:
    wanted = adoption.cable.bus.bitrate if adoption.cable.has_rate else None
    bitrate = present or _search(adoption)
    adoption.tell(f"drives answer at {bitrate} bit/s")
    with adoption.at(bitrate):
        node_ids = _discover_and_assign(adoption, bitrate)
        adoption.talk(master.set_up_all(node_ids, None if bitrate == wanted else wanted))
        if wanted is None or bitrate == wanted:
            _store(adoption, node_ids, bitrate)
            return node_ids
        adoption.talk(master.change_rate(node_ids, SWITCH_S))
    ordered_at = time.monotonic()
    with adoption.at(wanted):
        time.sleep(max(0.0, ordered_at + 2 * SWITCH_S - time.monotonic()))
        _store(adoption, node_ids, wanted)
    return node_ids


def _search(adoption: Adoption) -> int:
    """The bit rate of the drives [bit/s]: by listening, then by asking. Raises ConversationError when there is none."""
    cable = adoption.cable
    if not cable.has_rate:
        return cable.bus.bitrate
    rates = [rate for rate in bit_rate_search.order(cable.bus.bitrate) if rate in cable.rates]
    heard = []
    for i, rate in enumerate(rates):
        adoption.bar.at(f"listening at {rate} bit/s", i, len(rates))
        heard.append(_listen(cable, rate))
    found = bit_rate_search.from_listening(heard)
    if found is not None:
        return found
    for i, rate in enumerate(rates):
        adoption.bar.at(f"asking at {rate} bit/s", i, len(rates))
        with adoption.at(rate):
            if adoption.talk(is_anybody_here(rate)):
                return rate
    raise ConversationError(bit_rate_search.nobody(heard) + cable.hint())


def _listen(cable: Cable, bitrate: int) -> Heard:
    with cable.at(bitrate, listen_only=True) as line:
        listening = ListenSession(bit_rate_search.LISTEN_S)
        line.run(listening)
        return Heard(bitrate, listening.heard.frames, line.error_frames)


def _discover_and_assign(adoption: Adoption, bitrate: int) -> dict[Identity, int]:
    assert adoption.line is not None
    heard = refuse_beside_masters(adoption.line)
    census = adoption.talk(look(bitrate))
    mute = sorted(set(heard.nodes) - set(census.node_ids))
    if mute:
        raise ConversationError(
            f"node {', '.join(map(str, mute))} sends and answers no SDO: whether it has power is unknown"
        )
    for text in described(census):
        adoption.tell(text)
    if surplus := too_many(sorted(census.identities.values()), adoption.robot):
        raise ConversationError(surplus)
    adoption.ask(Ask("start", SAFE, confirms=True))
    adoption.talk(require_no_power(census.node_ids, bitrate))  # the person may have taken long
    adoption.talk(require_lss(census))
    adoption.left = UNSTORED
    found = adoption.talk(discover(census, bitrate))
    if surplus := too_many(found, adoption.robot):
        raise ConversationError(surplus)
    missing = too_few(found, adoption.robot)
    if missing:
        adoption.ask(Ask("few", f"{missing}. Go on with these (yes, no)?", confirm))  # --yes does not mean this
    return _assigned(adoption, proposals(found, census.identities, adoption.robot))


def _assigned(adoption: Adoption, proposed: dict[Identity, int]) -> dict[Identity, int]:
    """What the person chooses for each drive."""
    node_ids: dict[Identity, int] = {}
    for one, node_id in proposed.items():
        taken = tuple(node_ids.values())
        default = str(node_id) if node_id not in taken else None
        chosen = adoption.ask(Ask(f"serial_{one.serial:X}", f"{one}: node id", check_node_id(taken), default=default))
        assert isinstance(chosen, int)
        node_ids[one] = chosen
    return node_ids


def described(census: Census) -> list[str]:
    """What answered, a line each."""
    if not census.node_ids:
        return ["no drive has a node id"]
    lines = []
    for node_id in census.node_ids:
        if node_id in census.twins:
            lines.append(f"node {node_id}: two drives or more have this node id")
        elif node_id in census.identities:
            lines.append(f"node {node_id}: {census.identities[node_id]}")
        else:
            kinds = ", ".join(":".join(f"{part:X}" for part in kind) for kind in sorted(census.kinds))
            lines.append(f"node {node_id}: one drive or several ({kinds or '1018h cannot be read'})")
    return lines


def _store(adoption: Adoption, node_ids: dict[Identity, int], bitrate: int) -> None:
    adoption.left = STORED
    adoption.talk(master.keep_all(node_ids))
    adoption.talk(take_into_use(node_ids, bitrate))
    adoption.cable.is_kept = True


def _wait_again() -> Talk[None]:
    yield say(protocol.switch_all(configuration=False), wait_s=master.SETTLE_S)


def _report(person: Operator, node_ids: dict[Identity, int], bus: Bus) -> None:
    for one, node_id in node_ids.items():
        person.tell(Tell(f"ready: node {node_id}, {bus.bitrate} bit/s, {one}; stored"))
    person.tell(
        Tell(
            "Write each node id on its drive. Switch the drives off and on once: canbase bus scan has to "
            "show the same.\n"
            "Next: canbase setup init writes a robot.yaml for them"
        )
    )
