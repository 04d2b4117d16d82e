"""The power state machine: all statuswords, all states × goals, and every walk against a small reference machine."""

from itertools import product

import pytest

from canbase_driver.cia402 import (
    COMMANDS,
    FAULT_RESET_CYCLES,
    INTERNAL_LIMIT,
    PREPARED,
    REMOTE,
    STATUSWORD_STATES,
    WARNING,
    DriveState,
    PowerGoal,
    common_controlword,
    decode_statusword,
    next_controlword,
)

NOT_READY, DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, REACTION, FAULT = DriveState
ALL = (None, *DriveState)
WAYS_DOWN = (PowerGoal.OFF, PowerGoal.QUICK_STOP, PowerGoal.RESET)


def test_all_65536_statuswords_match_one_row_of_the_table_or_none() -> None:
    for word in range(0x10000):
        rows: list[DriveState | None] = [state for mask, value, state in STATUSWORD_STATES if word & mask == value]
        assert len(rows) <= 1
        assert [decode_statusword(word)] == (rows or [None])


@pytest.mark.parametrize(
    ("word", "state"),
    [
        # CiA 402-2, statusword: xxxx xxxx x0xx 0000 and so on, with the other bits as real drives set them
        (0x0000, NOT_READY),
        (0x0250, DISABLED),
        (0x0231, READY),
        (0x0233, SWITCHED_ON),
        (0x1637, ENABLED),
        (0x0A37, ENABLED),  # internal limit active, as a maxon EPOS4 shows it from the start
        (0x0217, QUICK_STOP),
        (0x021F, REACTION),
        (0x023F, REACTION),
        (0x0218, FAULT),
        (0x0238, FAULT),
        (0xFFFF, None),
        (0x0011, None),  # ready to switch on needs bit 5
        (0x0041, None),
    ],
)
def test_statuswords_as_drives_send_them(word: int, state: DriveState | None) -> None:
    assert decode_statusword(word) == state


def test_only_the_bits_of_the_state_count() -> None:
    for word, noise in product(range(0x70), (0x10, 0x80, 0x100, 0x200, 0x400, 0x800, 0x1000, 0xF000)):
        assert decode_statusword(word | noise) == decode_statusword(word & ~noise)


OFF_WORDS = dict.fromkeys(ALL, 0x00)
WORDS = {
    PowerGoal.OFF: OFF_WORDS,
    PowerGoal.QUICK_STOP: dict.fromkeys(ALL, 0x02),
    PowerGoal.READY: OFF_WORDS | {DISABLED: 0x06, READY: 0x07, SWITCHED_ON: 0x07},
    PowerGoal.RELEASE: OFF_WORDS | {DISABLED: 0x06, READY: 0x07, SWITCHED_ON: 0x07, ENABLED: 0x07},
    PowerGoal.RESET: OFF_WORDS | {FAULT: 0x80},
    PowerGoal.ON: {
        None: 0x02,
        NOT_READY: 0x00,
        DISABLED: 0x06,
        READY: 0x07,
        SWITCHED_ON: 0x0F,
        ENABLED: 0x0F,
        QUICK_STOP: 0x02,
        REACTION: 0x00,
        FAULT: 0x00,
    },
}


@pytest.mark.parametrize(("goal", "state"), list(product(PowerGoal, ALL)))
def test_each_state_and_goal_has_its_word(goal: PowerGoal, state: DriveState | None) -> None:
    assert next_controlword(state, goal) == WORDS[goal][state]


def test_the_table_has_no_hole() -> None:
    assert {goal: set(row) for goal, row in COMMANDS.items()} == {goal: set(ALL) for goal in PowerGoal}


def test_only_on_ever_sets_enable_operation_and_only_reset_sets_bit_7() -> None:
    for goal, state in product(PowerGoal, ALL):
        word = next_controlword(state, goal)
        assert goal is PowerGoal.ON or not word & 0x08
        assert (goal, state) == (PowerGoal.RESET, FAULT) or not word & 0x80


class Machine:
    """The drive's side, transitions 2…16 of CiA 402-2, written apart from the code under test."""

    def __init__(self, state: DriveState, *, automatic_enable: bool = False, stays_in_quick_stop: bool = False) -> None:
        self.state = state
        self.visited = [state]
        self._automatic_enable = automatic_enable
        self._stays = stays_in_quick_stop
        self._bit_7 = True  # an edge needs a 0 first

    def control(self, word: int) -> None:
        """One controlword; afterwards the motor has had time to stop."""
        edge = bool(word & 0x80) and not self._bit_7
        self._bit_7 = bool(word & 0x80)
        for state in self._after(word & 0x0F, edge=edge):
            self.state = state
            self.visited.append(state)

    def _after(self, bits: int, *, edge: bool) -> list[DriveState]:
        if self.state is FAULT:
            return [DISABLED] if edge else []
        if self.state is REACTION:
            return [FAULT]
        if self.state is NOT_READY:
            return [DISABLED]
        if self.state is QUICK_STOP and (not bits & 0x02 or (not self._stays and bits != 0x0F)):
            return [DISABLED]
        if self.state is DISABLED:
            return [READY] if bits & 0x07 == 0x06 else []
        if not bits & 0x02:
            return [DISABLED]
        if not bits & 0x04:
            return [QUICK_STOP] if self.state in (ENABLED, QUICK_STOP) else [DISABLED]
        return self._powered(bits)

    def _powered(self, bits: int) -> list[DriveState]:
        if not bits & 0x01:
            return [READY]
        if bits == 0x0F and self.state is READY:
            return [SWITCHED_ON, ENABLED] if self._automatic_enable else [SWITCHED_ON]
        if bits == 0x0F:
            return [ENABLED]
        return [SWITCHED_ON]


def walk(machine: Machine, goal: PowerGoal, words: int = 8) -> list[DriveState]:
    for _ in range(words):
        machine.control(next_controlword(machine.state, goal))
    return machine.visited


@pytest.mark.parametrize("start", [NOT_READY, DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP])
@pytest.mark.parametrize("automatic_enable", [False, True])
def test_on_reaches_operation_enabled_from_every_state_without_a_fault(
    start: DriveState, automatic_enable: bool
) -> None:
    machine = Machine(start, automatic_enable=automatic_enable)
    walk(machine, PowerGoal.ON)
    assert machine.state is ENABLED


def test_on_goes_up_one_step_at_a_time() -> None:
    steps = walk(Machine(DISABLED), PowerGoal.ON, words=3)
    assert steps == [DISABLED, READY, SWITCHED_ON, ENABLED]


@pytest.mark.parametrize("start", [REACTION, FAULT])
def test_on_never_leaves_a_fault(start: DriveState) -> None:
    assert walk(Machine(start), PowerGoal.ON)[-1] is FAULT


def test_on_waits_for_ever_in_a_drive_that_stays_in_quick_stop_and_off_frees_it() -> None:
    machine = Machine(QUICK_STOP, stays_in_quick_stop=True)
    assert set(walk(machine, PowerGoal.ON)) == {QUICK_STOP}
    walk(machine, PowerGoal.OFF)
    assert machine.state is DISABLED


@pytest.mark.parametrize(("goal", "start"), list(product(WAYS_DOWN, DriveState)))
@pytest.mark.parametrize("automatic_enable", [False, True])
def test_no_way_down_leads_through_operation_enabled(
    goal: PowerGoal, start: DriveState, automatic_enable: bool
) -> None:
    machine = Machine(start, automatic_enable=automatic_enable)
    walk(machine, goal)
    assert ENABLED not in machine.visited[1:]
    assert not machine.state.has_torque


def test_a_quick_stop_of_an_enabled_drive_goes_down_its_ramp() -> None:
    assert walk(Machine(ENABLED), PowerGoal.QUICK_STOP, words=2) == [ENABLED, QUICK_STOP, DISABLED]


def test_a_reset_needs_bit_7_at_0_first() -> None:
    machine = Machine(FAULT)
    walk(machine, PowerGoal.RESET)
    assert machine.state is FAULT  # the level alone does nothing
    walk(machine, PowerGoal.OFF, words=FAULT_RESET_CYCLES)
    walk(machine, PowerGoal.RESET, words=FAULT_RESET_CYCLES)
    assert machine.state is DISABLED


def test_torque_is_in_three_states_only() -> None:
    assert [state for state in DriveState if state.has_torque] == [ENABLED, QUICK_STOP, REACTION]


def test_two_states_lack_nothing_but_the_enable() -> None:
    assert [state for state in DriveState if state in PREPARED] == [SWITCHED_ON, ENABLED]


def test_bits_of_the_statusword_that_are_no_state() -> None:
    """CiA 402-2, 6041h: bit 7 warning, bit 9 remote, bit 11 internal limit active."""
    assert (WARNING, REMOTE, INTERNAL_LIMIT) == (0x0080, 0x0200, 0x0800)


def test_each_level_of_the_reset_bit_lasts_three_cycles() -> None:
    assert FAULT_RESET_CYCLES == 3


def test_states_are_named_as_in_the_standard() -> None:
    assert SWITCHED_ON.text == "switched on"


@pytest.mark.parametrize(
    ("states", "goal", "word"),
    [
        ((DISABLED, DISABLED), PowerGoal.ON, 0x06),
        ((ENABLED, DISABLED), PowerGoal.ON, 0x06),  # the one that is behind
        ((READY, SWITCHED_ON), PowerGoal.ON, 0x07),
        ((ENABLED, ENABLED), PowerGoal.ON, 0x0F),
        ((FAULT, ENABLED), PowerGoal.ON, 0x0F),  # the healthy motor comes down its ramp
        ((REACTION, ENABLED), PowerGoal.ON, 0x0F),
        ((FAULT, FAULT), PowerGoal.ON, 0x00),
        ((FAULT, ENABLED), PowerGoal.QUICK_STOP, 0x02),
        ((None, ENABLED), PowerGoal.OFF, 0x00),
        ((FAULT, DISABLED), PowerGoal.RESET, 0x80),
        ((DISABLED, DISABLED), PowerGoal.RESET, 0x00),
    ],
)
def test_one_controlword_for_two_motors(states: tuple[DriveState | None, ...], goal: PowerGoal, word: int) -> None:
    assert common_controlword(states, goal) == word
    assert common_controlword(states[::-1], goal) == word
