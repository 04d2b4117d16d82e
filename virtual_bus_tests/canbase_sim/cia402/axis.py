"""One axis of a simulated drive: controlword, option codes, modes 2, 3 and 9, statusword (CiA 402-2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from canopen import SdoAbortedError

from canbase_sim.cia301 import abort
from canbase_sim.cia301.dictionary import AXIS_STRIDE, Dictionary
from canbase_sim.cia402.raw_units import Scale
from canbase_sim.cia402.states import (
    POWERED,
    TRANSITIONS,
    Bit,
    Command,
    Event,
    State,
    Transition,
    after,
    decode,
)
from canbase_sim.personality import GENERIC, Personality
from canbase_sim.plant.encoder import Encoder, EncoderFault
from canbase_sim.plant.motor import AT_ONCE, Motor


class Supply(Enum):
    """What feeds the power stage."""

    FULL = "all there"
    NO_MAINS = "no main voltage: bit 4 is 0, and READY TO SWITCH ON the most that it reaches"
    NO_TORQUE = "STO open: it stays in SWITCH ON DISABLED"


VL, PROFILE_VELOCITY, CYCLIC_VELOCITY, NO_MODE = 2, 3, 9, 0
"""6060h. Without a mode the drive does not enable."""
VL_RUNS, VL_UNLOCKED, VL_FOLLOWS = 0x10, 0x20, 0x40
"""Controlword in mode 2: the ramp generator runs, is not locked, and has the target as its input."""
VL_RAMPS = {0x83: 0x48, 0x84: 0x49, 0x85: 0x4A}
"""Ramps of modes 3 and 9 → those of mode 2, each a speed and a time in s."""
POSITION_POLARITY, VELOCITY_POLARITY = 0x80, 0x40
"""607Eh: what is set counts the other way."""
_ENABLED = State.OPERATION_ENABLED
_ALWAYS = int(Bit.VOLTAGE_ENABLED | Bit.REMOTE)
_SATURATED, _REACHED, _SPECIFIC = int(Bit.INTERNAL_LIMIT), int(Bit.TARGET_REACHED), int(Bit.MODE_SPECIFIC)
_NEEDS = {2: (Supply.NO_TORQUE,), 3: (Supply.NO_TORQUE, Supply.NO_MAINS)}
"""Transitions on the way up, and without which supply they are closed."""
STAYS_IN_QUICK_STOP = range(5, 9)
"""605Ah: after the stop QUICK STOP ACTIVE stays, and transition 16 is open."""


@dataclass(slots=True)
class AxisFaults:
    """What is broken in one axis; plain switches for tests."""

    frozen_position: int | None = None
    """6064h shows this and no longer moves."""
    stuck_velocity: int | None = None
    """606Ch shows this."""
    ignores_setpoints: bool = False
    """60FFh is taken, and has no effect on the motor."""
    setpoint_share: float = 1.0
    """Of 60FFh, that the motor is given."""
    stop_share: float = 1.0
    """Of the slopes with which it stops by itself, quick stop and fault reaction among them; 0: it keeps its speed."""
    frozen: bool = False
    """Its application hangs: the values of the last moment stay, no controlword, setpoint or lost heartbeat has an
    effect, and the motor keeps its last goal. CANopen stack and velocity loop run on; a reset of the node ends it."""
    stuck_on: bool = False
    """The power stage neither stops nor switches off, whatever the statusword shows; a reset of the node ends it."""
    stuck_status: int | None = None
    """6041h shows this."""
    stuck_torque: int | None = None
    """6077h and 6078h show this."""
    cannot_enable: bool = False
    """The power stage is not ready: OPERATION ENABLED is refused."""
    force_share: float = 1.0
    """Of the force that 6072h allows. Set by `Axis.weaken`."""
    supply: Supply = Supply.FULL
    """Set by `Axis.lose`."""


@dataclass(slots=True)
class Axis:
    """Axis `number` of a node. `encoder` measures its motor, `on_change` receives every transition.

    `hold`: something holds its wheel with so much force [N].
    """

    dictionary: Dictionary
    number: int
    motor: Motor
    scale: Scale
    encoder: Encoder
    encoder_offset: int
    tell_error: Callable[[int], None]
    tell_clear: Callable[[int], None]
    on_change: Callable[[State, Transition], None]
    hold: Callable[[float], None]
    personality: Personality = GENERIC
    state: State = State.NOT_READY_TO_SWITCH_ON
    faults: AxisFaults = field(default_factory=AxisFaults)
    ramp_up_mps2: float = AT_ONCE
    """Its own ramp away from zero, where that is slower than 6083h: soft starts of the manufacturer [m/s²]."""
    uncoupled: bool = False
    """Its motor turns, and its wheel rolls without it."""
    causes: set[int] = field(default_factory=set)
    """Error codes whose cause still holds; no fault reset before it is empty."""
    _base: int = field(default=0, init=False)
    _state_bits: int = field(default=0, init=False)
    _told: list[int] = field(default_factory=list, init=False)
    _pending: Transition | None = field(default=None, init=False)
    _halted: bool = field(default=False, init=False)
    _controlword: int = field(default=0, init=False)
    _polarity: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._base = 0x6000 + AXIS_STRIDE * self.number
        d, at = self.dictionary, self._base
        d.on_write(at + 0x40, lambda subindex, value: self._on_controlword(value))
        for offset in (0xFF, 0x83, 0x84):
            d.on_write(at + offset, lambda subindex, value: self._steer())
        d.on_write(at + 0x72, lambda subindex, value: self._limit_force())
        d.on_write(at + 0x7E, lambda subindex, value: self._take_polarity())
        d.guard(at + 0x60, self._check_mode)
        d.on_write(at + 0x60, lambda subindex, value: self._show_mode())
        for index in self.personality.locked_with_power:
            d.guard(index + AXIS_STRIDE * self.number, lambda subindex, value: self._check_power())

    # What the node orders

    def boot(self) -> None:
        """Transitions 0 and 1: self-test, then SWITCH ON DISABLED."""
        self._go(after(self.state, Event.BOOTED))

    def restart(self) -> None:
        """Transition 0, power on or NMT reset node: power stage off, everything forgotten."""
        self.faults.frozen = self.faults.stuck_on = False
        self.motor.power_off()
        self._limit_force()
        self._take_polarity()
        self._go(Transition(0, State.NOT_READY_TO_SWITCH_ON))
        self._pending, self._controlword, self._halted = None, 0, False
        self._show_mode()
        self.causes.clear()
        self._told.clear()

    def weaken(self, share: float) -> None:
        """The motor gives `share` (0..1) of the force that 6072h allows."""
        self.faults.force_share = share
        self._limit_force()

    def lose_encoder(self, fault: EncoderFault) -> None:
        """Position, velocity and the drive's own loops have a faulty sensor, all at once."""
        self.encoder.suffer(fault, self.motor.speed_mps)
        self.motor.sensor = self.encoder.sample

    def heal(self) -> None:
        """Nothing is broken any more."""
        self.faults = AxisFaults()
        self.encoder.heal()
        self.motor.sensor = None
        self.hold(0.0)
        self._limit_force()

    def _limit_force(self) -> None:
        self.motor.limit_force(self.faults.force_share * self._value(0x72) / 1000.0)

    def fail(self, code: int) -> None:
        """A fault: transition 13, reaction by 605Eh, then 14. `code` is 603Fh and the EMCY code."""
        if self.faults.frozen:
            return
        self._put(0x3F, code)
        self._told.append(code)
        self.tell_error(code)
        if self.state in (State.FAULT_REACTION_ACTIVE, State.FAULT):
            return
        self._pending = None
        self._go(after(self.state, Event.ERROR))
        if not self.motor.powered:
            self._reaction_done()
        else:
            self._stop(self._value(0x5E), self._reaction_done)

    def abort_connection(self, code: int) -> None:
        """The connection is lost: 6007h chooses nothing, fault, disable voltage or quick stop."""
        option = 0 if self.faults.frozen else self._value(0x07)
        if option == 1:
            self.fail(code)
        elif option == 2:
            self._command(Command.DISABLE_VOLTAGE)
        elif option == 3:
            self._command(Command.QUICK_STOP)

    def lose(self, supply: Supply) -> None:
        """Main voltage or STO is lost: an axis with power coasts, in SWITCH ON DISABLED."""
        self.faults.supply = supply
        if self.state in POWERED or self.state is State.SWITCHED_ON:
            self._pending = None
            self._command(Command.DISABLE_VOLTAGE)

    def starve(self) -> None:
        """The vendor's own watchdog: the motor stops, nothing else changes, and the next target moves it again."""
        if self.state is _ENABLED and not self.faults.frozen:
            self._stop(1, _stay)

    def refresh(self) -> None:
        """Bring statusword, position, velocities and torque in the dictionary up to date."""
        values, base, motor, faults = self.dictionary.values, self._base << 8, self.motor, self.faults
        if faults.frozen:
            return
        position, velocity = faults.frozen_position, faults.stuck_velocity
        actual = self.velocity() if velocity is None else velocity
        values[base + 0x6400] = self.position() if position is None else position
        values[base + 0x6C00] = actual
        values[base + 0x4100] = self._statusword(actual) if faults.stuck_status is None else faults.stuck_status
        values[base + 0x6B00] = self._turned(self.scale.raw(motor.demand_mps))
        torque = faults.stuck_torque
        if torque is None:
            torque = int(1000.0 * motor.force_n / motor.peak_force_n)
        values[base + 0x7700] = values[base + 0x7800] = torque

    @property
    def stated_mps2(self) -> float:
        """Of 6084h and 6085h, the gentler slope [m/s²]."""
        return min(self._slope(offset) for offset in (0x84, 0x85))

    def position(self) -> int:
        """6064h as the encoder has it."""
        travel_m = self.encoder.travel_m
        return self.scale.counts(-travel_m if self._polarity & POSITION_POLARITY else travel_m, self.encoder_offset)

    def velocity(self) -> int:
        """606Ch as the drive measures it."""
        return self._turned(self.scale.raw(self.motor.speed_mps))

    # The state machine

    def _on_controlword(self, value: int) -> None:
        if self.faults.frozen or (value == self._controlword and self.state is _ENABLED):
            return
        rose = value & ~self._controlword & Bit.FAULT_RESET
        self._controlword = value
        if rose and self.state is State.FAULT and not self.causes:
            self._reset_fault()
        self._obey()

    def _reset_fault(self) -> None:
        for code in self._told:
            self.tell_clear(code)
        self._told.clear()
        self._put(0x3F, 0)
        self._go(after(self.state, Event.FAULT_RESET))

    def _obey(self) -> None:
        """The controlword is a level: obey it until it changes nothing more."""
        while self._command(decode(self._controlword)):
            pass
        halted = bool(self._controlword & Bit.HALT)
        if halted is not self._halted:
            self._halted = halted
            self._steer()
        elif self.personality.vl:
            self._steer()

    def _command(self, command: Command) -> bool:
        """Do one transition if the table and the option codes allow it."""
        transition = TRANSITIONS.get((self.state, command))
        if transition is None or not self._open(transition, command):
            return False
        number = transition.number
        if number in (5, 8) and self._value(0x5C if number == 5 else 0x5B) == 1:
            self._pending = transition
            self._stop(1, self._finish_pending)
            return False
        self._pending = None
        self._go(transition)
        if number in (4, 16):
            self._enable()
        elif number == 11:
            self._quick_stop()
        return True

    def _open(self, transition: Transition, command: Command) -> bool:
        if self._pending is not None:
            return command in (Command.DISABLE_VOLTAGE, Command.QUICK_STOP)
        if transition.number in _NEEDS and self.faults.supply in _NEEDS[transition.number]:
            return False
        if transition.number == 4:
            return self._value(0x60) != NO_MODE and not self.faults.cannot_enable
        return transition.number != 16 or self._value(0x5A) in STAYS_IN_QUICK_STOP

    def _go(self, transition: Transition) -> None:
        """Take the new state; outside of the powered states the power stage is off."""
        before, self.state = self.state, transition.target
        self._state_bits = self.state.value
        if self.state not in POWERED and not self.faults.stuck_on:
            self.motor.power_off()
        self._show_mode()
        self.on_change(before, transition)

    def _finish_pending(self) -> None:
        transition, self._pending = self._pending, None
        if transition is not None:
            self._go(transition)
            self._obey()

    def _reaction_done(self) -> None:
        self._go(after(self.state, Event.REACTION_DONE))

    def _quick_stop_done(self) -> None:
        if self._value(0x5A) not in STAYS_IN_QUICK_STOP:
            self._go(after(self.state, Event.STOP_DONE))
            self._obey()

    # The motor's orders

    def _enable(self) -> None:
        if not self.motor.powered:
            self.motor.power_on()
        self._steer()

    def _steer(self) -> None:
        """Give the motor its goal: the target velocity, or zero while halt is set."""
        if self.state is not _ENABLED or self._pending is not None or self.faults.frozen:
            return
        if self._halted:
            self._stop(self._value(0x5D), _stay)
        elif self.faults.ignores_setpoints or self._ramp_is_locked():
            return
        elif self._value(0x60) in (VL, PROFILE_VELOCITY):
            up = min(self.ramp_up_mps2, self._slope(0x83))
            self.motor.run(self._goal_mps(), up, self._slope(0x84))
        else:
            self.motor.run(self._goal_mps(), AT_ONCE, AT_ONCE)

    def _slope(self, offset: int) -> float:
        """Of 6083h, 6084h, 6085h, or what mode 2 has in their place [m/s²]."""
        if not self.personality.vl:
            return self.scale.slope(self._value(offset))
        speed, seconds = self._entry(VL_RAMPS[offset], 1), self._entry(VL_RAMPS[offset], 2)
        return self.scale.slope(speed) * self._vl_factor() / seconds if seconds else AT_ONCE

    def _quick_stop(self) -> None:
        option = self._value(0x5A)
        self._stop((option - 1) % 4 + 1 if option else 0, self._quick_stop_done)

    def _stop(self, option: int, then: Callable[[], None]) -> None:
        """Stop as 605Ah to 605Eh count: 0 coast, 1 ramp 6084h, 2 quick-stop ramp 6085h, 3 and 4 at the torque limit."""
        if self.faults.stuck_on:
            then()
            return
        if option == 0:
            self.motor.power_off()
            then()
            return
        ramps = {1: 0x84, 2: 0x85}
        slope = self._slope(ramps[option]) if option in ramps else AT_ONCE
        self.motor.stop(slope * self.faults.stop_share if self.faults.stop_share else 0.0, then)

    # What the bus sees

    def _statusword(self, actual: int) -> int:
        word = self._state_bits | _ALWAYS
        if self.faults.supply is Supply.NO_MAINS:
            word &= ~Bit.VOLTAGE_ENABLED
        if self.motor.saturated:
            word |= _SATURATED
        if self.state is _ENABLED and self._value(0x60) == CYCLIC_VELOCITY:
            return word if self._halted else word | _SPECIFIC
        if self._reached(actual):
            word |= _REACHED
        if self._value(0x60) == PROFILE_VELOCITY and abs(actual) <= self._value(0x6F):
            word |= _SPECIFIC
        return word

    def _reached(self, actual: int) -> bool:
        """Bit 10: the target is reached; in a halt and in QUICK STOP ACTIVE the target is zero."""
        if self.state is State.QUICK_STOP_ACTIVE or self._halted:
            return abs(actual) <= self._value(0x6F)
        target = self._turned(self.scale.raw(self._target_mps()))
        return self.state is _ENABLED and abs(actual - target) <= self._value(0x6D)

    def _check_mode(self, subindex: int, value: int) -> None:
        if value != NO_MODE and value not in self.personality.modes:
            raise SdoAbortedError(abort.INVALID_VALUE)
        if self.state in POWERED and value != self._value(0x60):
            raise SdoAbortedError(abort.DEVICE_STATE)

    def _check_power(self) -> None:
        if self.state in POWERED:
            raise SdoAbortedError(abort.DEVICE_STATE)

    def _show_mode(self) -> None:
        hidden = self.state is not _ENABLED and not self.personality.shows_mode_without_power
        self._put(0x61, NO_MODE if hidden else self._value(0x60))

    def _target_mps(self) -> float:
        raw = self._vl_target() if self.personality.vl else self._value(0xFF)
        return (-raw if self._polarity & VELOCITY_POLARITY else raw) * self.scale.target_mps

    def _take_polarity(self) -> None:
        """607Eh, of a drive that has it."""
        self._polarity = self.dictionary.values.get(self._base << 8 | 0x7E00, 0)

    def _turned(self, raw: int) -> int:
        return -raw if self._polarity & VELOCITY_POLARITY else raw

    def _ramp_is_locked(self) -> bool:
        """Mode 2, bit 5 is 0: the motor keeps its speed."""
        return self._value(0x60) == VL and not self._controlword & VL_UNLOCKED

    def _vl_target(self) -> float:
        """6042h within 6046h, in rpm: a speed below the least one becomes the least one, zero stays zero."""
        follows = VL_RUNS | VL_FOLLOWS
        raw = self._value(0xFF) if self._controlword & follows == follows else 0
        amount = min(max(abs(raw), self._entry(0x46, 1)), self._entry(0x46, 2)) if raw else 0
        return (amount if raw > 0 else -amount) * self._vl_factor()

    def _vl_factor(self) -> float:
        """604Ch: what one bit is worth in rpm."""
        return self._entry(0x4C, 1) / self._entry(0x4C, 2)

    def _goal_mps(self) -> float:
        return self.faults.setpoint_share * self._target_mps()

    def _put(self, offset: int, value: int) -> None:
        """Set object 60xxh of this axis."""
        self.dictionary.values[(self._base + offset) << 8] = value

    def _entry(self, offset: int, subindex: int) -> int:
        """An entry of object 60xxh of this axis."""
        return self.dictionary.values[(self._base + offset) << 8 | subindex]

    def _value(self, offset: int) -> int:
        """The value of object 60xxh of this axis."""
        return self.dictionary.values[(self._base + offset) << 8]


def _stay() -> None:
    """The halt has ended: OPERATION ENABLED stays."""
