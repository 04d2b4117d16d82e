"""The errors that a drive remembers, in words."""

from __future__ import annotations

from typing import TypeVar

from canopen import SdoAbortedError

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.error_history import ErrorHistory, clear_history, read_history, register_text
from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.sdo_session import SdoSession
from canbase_driver.boot.steps import Steps
from canbase_driver.cia301.sdo_client import SdoClient
from canbase_sim.cia301.dictionary import Dictionary
from support.session_world import SessionWorld

T = TypeVar("T")


def ask(world: SessionWorld, steps: Steps[T]) -> T:
    session = SdoSession({1: steps}, Listener(0.0), lambda node_id: SdoClient(node_id, 0.1, 2))
    world.run(session)
    result = session.tasks[1].result
    assert result is not None
    return result


def test_the_newest_error_comes_first_with_its_sentence_and_the_maker_s_words() -> None:
    world = SessionWorld()
    world.bench.nodes[1].fail(0, 0x2310)
    world.bench.nodes[1].fail(0, 0xFF01)
    world.wait(0.1)
    history = ask(world, read_history())
    assert history.entries is not None
    assert [entry & 0xFFFF for entry in history.entries] == [0xFF01, 0x2310]
    lines = history.lines({0xFF01: "the fan stands still"})
    assert lines[-3:] == [
        "2 errors in the history 1003h, the newest first",
        "  1 FF01h the fan stands still",
        "  2 2310h over-current",
    ]
    assert lines[0].startswith("error register 1001h: 03h (generic, current")


def test_a_drive_without_errors_says_so() -> None:
    history = ask(SessionWorld(), read_history())
    assert history.lines({}) == ["error register 1001h: 00h (no error)", "0 errors in the history 1003h"]


def test_a_cleared_history_is_read_back_empty() -> None:
    world = SessionWorld()
    world.bench.nodes[1].fail(0, 0x2310)
    assert ask(world, clear_history()) == ""
    assert ask(world, read_history()).entries == ()


def test_a_drive_that_keeps_or_refuses_is_not_called_cleared() -> None:
    world = SessionWorld()
    dictionary: Dictionary = world.bench.nodes[1].dictionary
    world.bench.nodes[1].fail(0, 0x2310)
    dictionary.on_write(0x1003, lambda sub, value: dictionary.values.__setitem__(0x100300, 1))
    assert ask(world, clear_history()) == "it still has 1 errors: they hold, or came at once again"

    def refuse(sub: int, value: int) -> None:
        raise SdoAbortedError(0x0800_0022)

    dictionary.guard(0x1003, refuse)
    assert ask(world, clear_history()).startswith("0800 0022h")


def test_a_drive_without_a_history_shows_what_it_has() -> None:
    history = ErrorHistory(None, "it has no 1003h", None, {Address(0x603F): 0x8611, Address(0x683F): 0})
    assert history.lines({}) == [
        "error register 1001h: unknown (1001h cannot be read)",
        "603Fh:0: 8611h following error",
        "it keeps no history: it has no 1003h",
    ]
    assert register_text(0x81) == "81h (generic, manufacturer)"
