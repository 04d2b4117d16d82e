"""The robot under the drives: mass and yaw inertia couple two sides of wheels; friction, slip, true pose. SI, REP 103.

Wheels of one side turn together. Each step applies the motors' forces and viscous friction, and then Coulomb friction
as the impulse, within its bound, that leaves the least kinetic energy: so friction alone never moves anything, and an
unpowered robot never gains speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, cos, pi, sin

from canbase_sim.plant.motor import Motor

SWEEPS = 8
"""Passes over both sides until friction's impulses settle."""
AT_REST_MPS = 1e-5
"""A side that friction leaves slower than this sticks: static friction is a little more than sliding friction [m/s]."""


@dataclass(frozen=True, slots=True)
class PlantParameters:
    """The robot's body. Forces are per wheel and at the rim. Raises ValueError for a body that cannot be."""

    mass_kg: float = 30.0
    """Mass of the empty robot."""
    payload_factor: float = 1.0
    """Mass and yaw inertia with load, in multiples of the empty robot's; the drives are tuned for the empty one."""
    yaw_gyration_m: float = 0.2
    """Yaw inertia = mass × this²."""
    wheel_mass_kg: float = 3.0
    """Rotor, gear and wheel inertia of one wheel, as mass at its rim."""
    rotor_share: float = 0.5
    """Of it the rotor has so much: what turns inside the play of a worn gear."""
    coulomb_n: float = 6.0
    """Dry friction of one wheel [N]."""
    viscous_nspm: float = 8.0
    """Friction of one wheel that grows with speed [N·s/m]."""
    peak_force_n: float = 90.0
    """Force of one wheel at its motor's torque limit [N]."""
    bandwidth_radps: float = 200.0
    """Velocity loop of the drives [rad/s]."""
    slip_left: float = 0.0
    """Share of the left rim's way that does not move the robot, below 1; negative: larger wheel than configured."""
    slip_right: float = 0.0
    """The same on the right."""
    step_s: float = 0.002
    """Fixed inner step [s]."""

    def __post_init__(self) -> None:
        positive = (self.mass_kg, self.payload_factor, self.yaw_gyration_m, self.wheel_mass_kg, self.peak_force_n)
        if not all(0.0 < value < 1e6 for value in (*positive, self.bandwidth_radps, self.step_s)):
            raise ValueError("masses, factor, gyration, force, bandwidth and step must be above 0 and finite")
        if not all(0.0 <= value < 1e6 for value in (self.coulomb_n, self.viscous_nspm)):
            raise ValueError("frictions must not be negative")
        if not 0.0 < self.rotor_share < 1.0:
            raise ValueError("rotor_share must be between 0 and 1")
        if not all(-1.0 < value < 1.0 for value in (self.slip_left, self.slip_right)):
            raise ValueError("slip must be between -1 and 1")
        if self.bandwidth_radps * self.step_s > 0.5:
            raise ValueError("step_s is too long for bandwidth_radps: their product must not exceed 0.5")

    def motor(self, wheels: int) -> Motor:
        """The servo of one of `wheels` wheels, tuned for its share of the empty robot."""
        mass = self.mass_kg / wheels + self.wheel_mass_kg
        return Motor(mass, self.bandwidth_radps, self.peak_force_n, self.step_s)


@dataclass(frozen=True, slots=True)
class MountedWheel:
    """A motor at its place: `direction` +1 where positive motor speed drives the base forward, else -1."""

    motor: Motor
    direction: int


class FreeRotor:
    """A motor whose coupling to its wheel is broken: it turns alone, and the wheel rolls without it. SI, at the rim."""

    def __init__(self, motor: Motor, mass_kg: float, friction_n: float, step_s: float) -> None:
        self.motor, self._mass_kg, self._friction_n, self._h = motor, mass_kg, friction_n, step_s
        self.speed_mps, self.travel_m = motor.speed_mps, 0.0

    def step(self) -> None:
        """One inner step."""
        speed = self.speed_mps + self.motor.step(self.speed_mps) / self._mass_kg * self._h
        rubs = self._friction_n / self._mass_kg * self._h
        speed = 0.0 if abs(speed) <= rubs else speed - copysign(rubs, speed)
        self.travel_m += (self.speed_mps + speed) * self._h / 2.0
        self.speed_mps = speed


class LooseRotor:
    """A motor with play to its wheel: inside the play both move alone, at its ends they push each other.

    A blow is inelastic: it makes both equally fast, and never more energy than there was. SI, at the rim, positive in
    the motor's own positive direction.
    """

    def __init__(self, motor: Motor, direction: float, side: str, mass_kg: float, step_s: float, play_m: float) -> None:
        self.motor, self.direction, self.side, self.mass_kg = motor, direction, side, mass_kg
        self._h, self._half_m = step_s, play_m / 2.0
        self.speed_mps, self.travel_m = motor.speed_mps, 0.0
        self.ahead_m = 0.0
        """Of its wheel, from the middle of the play."""
        self._new_mps = self.speed_mps

    def push(self) -> None:
        """Its motor alone, for one inner step."""
        self.motor.step(self.speed_mps)
        self._new_mps = self.speed_mps + self.motor.settle_mps(self.motor.speed_mps, self.mass_kg)

    def _touches(self, wheel_mps: float) -> bool:
        """It moves, relative to a wheel that is so fast, beyond the end of the play."""
        closing_m = (self._new_mps - wheel_mps) * self._h
        ahead_m = self.ahead_m + closing_m
        return ahead_m > self._half_m if closing_m > 0.0 else closing_m < 0.0 and ahead_m < -self._half_m

    def blow(self, wheel_mps: float, inverse_kg: float) -> float:
        """Impulse on a wheel that is so fast, and whose side has this inverse mass; both are equally fast then."""
        if not self._touches(wheel_mps):
            return 0.0
        impulse = (self._new_mps - wheel_mps) / (1.0 / self.mass_kg + inverse_kg)
        self._new_mps -= impulse / self.mass_kg
        return impulse

    def follow(self, wheel_mps: float, rolled_m: float) -> None:
        """The end of the step: its wheel has rolled so far, and friction that holds the wheel holds it too."""
        if self._touches(wheel_mps) and abs(wheel_mps) < abs(self._new_mps):
            self._new_mps = wheel_mps
        way_m = (self.speed_mps + self._new_mps) / 2.0 * self._h
        self.travel_m += way_m
        self.ahead_m += way_m - rolled_m
        self.speed_mps = self._new_mps


class Base:
    """The moving robot. All fields are ground truth: pose in the frame where it started, rim speeds, ways."""

    def __init__(
        self,
        parameters: PlantParameters,
        track_m: float,
        standstill_mps: float,
        left: Sequence[MountedWheel],
        right: Sequence[MountedWheel],
        now_s: float,
    ) -> None:
        self._h = parameters.step_s
        self._track, self._standstill = track_m, standstill_mps
        self._left, self._right = ([(w.motor, float(w.direction)) for w in side] for side in (left, right))
        self._viscous_left, self._viscous_right = (parameters.viscous_nspm * len(side) for side in (left, right))
        self._bound_left, self._bound_right = (parameters.coulomb_n * self._h * len(side) for side in (left, right))
        self._own_bounds = (self._bound_left, self._bound_right)
        self._grip_left, self._grip_right = 1.0 - parameters.slip_left, 1.0 - parameters.slip_right
        self._parameters = parameters
        self.free_rotors: list[FreeRotor] = []
        """Motors that do not drive their wheels any more."""
        self.loose_rotors: list[LooseRotor] = []
        """Motors with play."""
        self._wheels = {"left": len(left), "right": len(right)}
        self._loose_kg = {"left": 0.0, "right": 0.0}
        self._lifted: set[str] = set()
        self._invert_mass_matrix(parameters)
        self.x_m = self.y_m = self.turned_rad = 0.0
        self.v_left_mps = self.v_right_mps = 0.0
        self.push_n = 0.0
        """Force on the body along its x axis: a slope [N]."""
        self.travel_left_m = self.travel_right_m = 0.0
        self.travel_m = self.path_m = 0.0
        self.time_of_motion = now_s
        self.resting = True

    @property
    def v_mps(self) -> float:
        """True forward speed of the base."""
        return (self.v_left_mps * self._grip_left + self.v_right_mps * self._grip_right) / 2.0

    @property
    def w_radps(self) -> float:
        """True yaw rate, counter-clockwise positive."""
        return (self.v_right_mps * self._grip_right - self.v_left_mps * self._grip_left) / self._track

    @property
    def yaw_rad(self) -> float:
        """True heading, -π to π."""
        return (self.turned_rad + pi) % (2.0 * pi) - pi

    @property
    def kinetic_energy_j(self) -> float:
        """Of body and wheels together, without slip."""
        a, b = self._inverse_left, self._inverse_right
        c = self._cross
        vl, vr = self.v_left_mps, self.v_right_mps
        return (b * vl * vl - 2.0 * c * vl * vr + a * vr * vr) / (a * b - c * c) / 2.0

    def hold(self, side: str, force_n: float) -> None:
        """Something holds the wheels of a side with so much force beyond their friction: a threshold, a jammed gear."""
        impulse = force_n * self._h
        if side == "left":
            self._bound_left = self._own_bounds[0] + impulse
        else:
            self._bound_right = self._own_bounds[1] + impulse

    @property
    def is_as_configured(self) -> bool:
        """Each wheel rolls on the floor, with its size, and its motor turns it."""
        p = self._parameters
        grips = self._grip_left == 1.0 - p.slip_left and self._grip_right == 1.0 - p.slip_right
        return grips and not self.free_rotors and not self._lifted

    def grip(self, side: str, share: float) -> None:
        """The rims of a side move the base by `share` of their way: below 1 they slip, above 1 they are larger."""
        if side == "left":
            self._grip_left = share * (1.0 - self._parameters.slip_left)
        else:
            self._grip_right = share * (1.0 - self._parameters.slip_right)

    def lift(self, side: str, lifted: bool) -> None:
        """The wheels of a side leave the floor: they turn without the body, which turns about them."""
        self._lifted = self._lifted | {side} if lifted else self._lifted - {side}
        self.grip(side, 0.0 if lifted else 1.0)
        self._invert_mass_matrix(self._parameters)
        if not self._lifted:
            return
        p, wheels = self._parameters, {"left": len(self._left), "right": len(self._right)}
        free, body = ({side: p.wheel_mass_kg * max(1, count) for side, count in wheels.items()}, p.mass_kg / 2.0)
        left_kg, right_kg = (free[side] + (0.0 if side in self._lifted else body) for side in ("left", "right"))
        self._inverse_left, self._inverse_right, self._cross = 1.0 / left_kg, 1.0 / right_kg, 0.0

    def uncouple(self, motor: Motor) -> FreeRotor:
        """The coupling of this motor breaks, for good."""
        for side in (self._left, self._right):
            side[:] = [pair for pair in side if pair[0] is not motor]
        p = self._parameters
        self.free_rotors.append(FreeRotor(motor, p.wheel_mass_kg, p.coulomb_n / 4.0, self._h))
        return self.free_rotors[-1]

    @property
    def rotor_kg(self) -> float:
        """Mass of one motor's rotor, as seen at the rim."""
        return self._parameters.wheel_mass_kg * self._parameters.rotor_share

    def loosen(self, motor: Motor, play_m: float) -> LooseRotor:
        """The gear of this motor has so much play from now on, at the rim; its speed is that of its wheel."""
        for name, side in (("left", self._left), ("right", self._right)):
            for pair in [pair for pair in side if pair[0] is motor]:
                side.remove(pair)
                self._loose_kg[name] += self.rotor_kg
                self.loose_rotors.append(LooseRotor(motor, pair[1], name, self.rotor_kg, self._h, play_m))
        self._invert_mass_matrix(self._parameters)
        return self.loose_rotors[-1]

    def _knock(self, vl: float, vr: float) -> tuple[float, float]:
        """The speeds of both sides after the blows of rotors at the ends of their play."""
        for rotor in self.loose_rotors:
            rotor.push()
            left = rotor.side == "left"
            inverse = self._inverse_left if left else self._inverse_right
            impulse = rotor.direction * rotor.blow(rotor.direction * (vl if left else vr), inverse)
            vl += (self._inverse_left if left else self._cross) * impulse
            vr += (self._cross if left else self._inverse_right) * impulse
        return vl, vr

    def _follow(self, left_m: float, right_m: float) -> None:
        """The rotors with play, after the sides have rolled since these travels."""
        for rotor in self.loose_rotors:
            speed, rolled = self.v_left_mps, self.travel_left_m - left_m
            if rotor.side == "right":
                speed, rolled = self.v_right_mps, self.travel_right_m - right_m
            rotor.follow(rotor.direction * speed, rotor.direction * rolled)

    def step(self, now_s: float) -> None:
        """Advance by one inner step that ends at `now_s`."""
        vl, vr, h = self.v_left_mps, self.v_right_mps, self._h
        push = self.push_n / 2.0
        push_left, push_right = push - self._viscous_left * vl, push - self._viscous_right * vr
        for motor, direction in self._left:
            push_left += direction * motor.step(direction * vl)
        for motor, direction in self._right:
            push_right += direction * motor.step(direction * vr)
        for rotor in self.free_rotors:
            rotor.step()
        a, b, c = self._inverse_left, self._inverse_right, self._cross
        new_left = vl + (a * push_left + c * push_right) * h
        new_right = vr + (c * push_left + b * push_right) * h
        if not self.loose_rotors:
            self._move(*self._rub(new_left, new_right), now_s)
            return
        left_m, right_m = self.travel_left_m, self.travel_right_m
        self._move(*self._rub(*self._knock(new_left, new_right)), now_s)
        self._follow(left_m, right_m)

    def _rub(self, vl: float, vr: float) -> tuple[float, float]:
        """The speeds after Coulomb friction. While both sides slide on, both impulses are at their bounds."""
        impulse_left = -self._bound_left if vl > 0.0 else self._bound_left
        impulse_right = -self._bound_right if vr > 0.0 else self._bound_right
        new_left = vl + self._inverse_left * impulse_left + self._cross * impulse_right
        new_right = vr + self._cross * impulse_left + self._inverse_right * impulse_right
        if new_left * vl > AT_REST_MPS**2 and new_right * vr > AT_REST_MPS**2:
            return new_left, new_right
        return self._stick(vl, vr)

    def _stick(self, vl: float, vr: float) -> tuple[float, float]:
        """The same where a side comes to rest: minimise the energy over one impulse after the other."""
        a, b, c = self._inverse_left, self._inverse_right, self._cross
        impulse_left = impulse_right = 0.0
        for _ in range(SWEEPS):
            wanted = _clamp(impulse_left - vl / a, self._bound_left)
            change, impulse_left = wanted - impulse_left, wanted
            vl, vr = vl + a * change, vr + c * change
            wanted = _clamp(impulse_right - vr / b, self._bound_right)
            change, impulse_right = wanted - impulse_right, wanted
            vl, vr = vl + c * change, vr + b * change
        return (0.0 if abs(vl) < AT_REST_MPS else vl), (0.0 if abs(vr) < AT_REST_MPS else vr)

    def _move(self, vl: float, vr: float, now_s: float) -> None:
        half = self._h / 2.0
        left, right = (self.v_left_mps + vl) * half, (self.v_right_mps + vr) * half
        self.travel_left_m += left
        self.travel_right_m += right
        left *= self._grip_left
        right *= self._grip_right
        way, turn = (left + right) / 2.0, (right - left) / self._track
        heading = self.turned_rad + turn / 2.0
        self.x_m += way * cos(heading)
        self.y_m += way * sin(heading)
        self.turned_rad += turn
        self.travel_m += way
        self.path_m += abs(way)
        self.resting = vl == 0.0 == vr and left == 0.0 == right and not self.push_n and not self.free_rotors
        self.resting = self.resting and not self.loose_rotors
        self.v_left_mps, self.v_right_mps = vl, vr
        if abs(vl) > self._standstill or abs(vr) > self._standstill:
            self.time_of_motion = now_s

    def _invert_mass_matrix(self, p: PlantParameters) -> None:
        """Kinetic energy = ½ (vl, vr) A (vl, vr)ᵀ; kept is the inverse of A."""
        body = p.mass_kg * p.payload_factor
        turning = body * p.yaw_gyration_m**2 / self._track**2
        left = body / 4.0 + turning + p.wheel_mass_kg * self._wheels["left"] - self._loose_kg["left"]
        right = body / 4.0 + turning + p.wheel_mass_kg * self._wheels["right"] - self._loose_kg["right"]
        cross = body / 4.0 - turning
        determinant = left * right - cross * cross
        self._inverse_left, self._inverse_right = right / determinant, left / determinant
        self._cross = -cross / determinant


def _clamp(value: float, bound: float) -> float:
    return bound if value > bound else -bound if value < -bound else value
