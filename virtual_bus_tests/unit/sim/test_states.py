"""The CiA 402 state machine of the simulated drive: every state × every command, and the controlword's masks."""

from __future__ import annotations

import pytest

from canbase_sim.cia402.states import EVENTS, TRANSITIONS, Command, Event, State, after, decode
from support.sim_rig import MPS, Rig

SOD, READY, ON = State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, State.SWITCHED_ON
ENABLED, STOP = State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE
REACTION, FAULT = State.FAULT_REACTION_ACTIVE, State.FAULT

WORDS = (0x00, 0x02, 0x06, 0x07, 0x0F, 0x80)
# Where each controlword leads from each state, by hand from the standard's diagram.
#                disable  quick  shut-  switch  enable  bit 7
#                voltage  stop   down   on      oper.   rises
GRID = {
    SOD: (SOD, SOD, READY, SOD, SOD, SOD),
    READY: (SOD, SOD, READY, ON, ENABLED, READY),
    ON: (SOD, SOD, READY, ON, ENABLED, ON),
    ENABLED: (SOD, STOP, READY, ON, ENABLED, ENABLED),
    STOP: (SOD, STOP, STOP, STOP, ENABLED, STOP),
    REACTION: (REACTION,) * 6,
    FAULT: (FAULT, FAULT, FAULT, FAULT, FAULT, SOD),
}


def _in_state(state: State) -> Rig:
    """A drive in `state`, with a quick stop that stays (605Ah = 6) and a fault reaction that takes long."""
    rig = Rig()
    rig.write(0x6060, 3)
    rig.write(0x605A, 6)
    words = {READY: (0x06,), ON: (0x06, 0x07), ENABLED: (0x06, 0x07, 0x0F), STOP: (0x06, 0x07, 0x0F, 0x02)}
    for word in words.get(state, ()):
        rig.write(0x6040, word)
    if state is REACTION:
        rig.enable(target=MPS)
        rig.wait(0.5)
        rig.write(0x605E, 1)
    if state in (REACTION, FAULT):
        rig.node.fail(0, 0x2310)
    assert rig.state() is state
    return rig


@pytest.mark.parametrize(("state", "ends"), GRID.items(), ids=lambda value: getattr(value, "name", ""))
def test_every_command_in_every_state(state: State, ends: tuple[State, ...]) -> None:
    for word, end in zip(WORDS, ends, strict=True):
        rig = _in_state(state)
        rig.write(0x6040, word)
        rig.wait(0.02)  # 605Ch = 1 ramps down before it disables
        assert rig.state() is end, f"{state.name} with {word:#04x}"


@pytest.mark.parametrize(
    ("pattern", "command"),
    [
        ("0xx0x", Command.DISABLE_VOLTAGE),
        ("0x01x", Command.QUICK_STOP),
        ("0x110", Command.SHUTDOWN),
        ("00111", Command.SWITCH_ON),
        ("01111", Command.ENABLE_OPERATION),
        ("1xxxx", Command.NONE),
    ],
)
def test_bits_7_3_2_1_0_make_the_command_and_no_other_bit_does(pattern: str, command: Command) -> None:
    """Pattern: bits 7, 3, 2, 1, 0 as the standard's table of the controlword writes them; x is any."""
    bits = (7, 3, 2, 1, 0)
    for word in range(0x10000):
        fits = all(want in ("x", str(word >> bit & 1)) for bit, want in zip(bits, pattern, strict=True))
        assert (decode(word) is command) is fits, hex(word)


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("event", Event)
def test_an_event_that_the_table_does_not_list_is_refused(state: State, event: Event) -> None:
    if (state, event) in EVENTS:
        assert after(state, event) == EVENTS[state, event]
    else:
        with pytest.raises(ValueError, match=state.name):
            after(state, event)


def test_the_tables_have_every_transition_of_the_standard() -> None:
    numbers = {t.number for t in TRANSITIONS.values()} | {t.number for t in EVENTS.values()}
    assert numbers == set(range(1, 17))  # 0 is power on


def test_obeying_a_held_command_always_ends() -> None:
    """The controlword is a level: no command may lead round in a circle."""
    for command in Command:
        for start in State:
            state, steps = start, 0
            while (state, command) in TRANSITIONS:
                state, steps = TRANSITIONS[state, command].target, steps + 1
                assert steps < 4, f"{command.name} from {start.name}"


@pytest.mark.parametrize("option", [0, 1, 2, 3, 4])
def test_without_codes_5_to_8_quick_stop_active_cannot_be_left_by_enable(option: int) -> None:
    rig = Rig()
    rig.write(0x605A, option)
    rig.enable(target=MPS)
    rig.wait(0.5)
    rig.write(0x6040, 0x02)
    rig.write(0x6040, 0x0F)
    assert rig.state() is not ENABLED


def test_without_a_mode_the_drive_does_not_enable() -> None:
    rig = Rig()
    for word in (0x06, 0x07, 0x0F):
        rig.write(0x6040, word)
    assert rig.state() is ON
    rig.write(0x6060, 3)
    rig.write(0x6040, 0x0F)
    assert rig.state() is ENABLED
