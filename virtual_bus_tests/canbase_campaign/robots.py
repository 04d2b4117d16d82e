"""The robots of the campaign, drawn from a seed: their robot.yaml, and the body and the floor that it does not contain.

What is drawn passes robot.yaml's own checks, and can do what its file states: its motors are strong enough for the
stated decelerations with its load on its slope, and without power it rolls out there. What cannot, no software stops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from functools import lru_cache
from math import ceil
from random import Random
from typing import Any

from pydantic import ValidationError

from canbase_config import bus_load
from canbase_config.commissioned import STEPS, Commissioned, mark
from canbase_config.errors import Loc
from canbase_config.load import load_robot, sample
from canbase_config.profile_file import load_profile
from canbase_config.reserves import COUNTS, RESERVES, Reserve, at, rounded_up
from canbase_config.robot import Robot
from canbase_sim.plant.base import PlantParameters

SCENARIOS = 25
"""This many scenarios in a row have one robot: a worker boots it once."""
GRAVITY_MPS2 = 9.81
MASSES_KG = (8.0, 15.0, 40.0)
"""Of the empty robot, for each wheel."""
FRICTION_NPKG = (0.3, 0.8)
"""Dry friction of all wheels and gears [N], for each kg of the empty robot."""
SLOPES = (0.0, 0.0, 0.03, 0.06, 0.1)
FRICTION_LEFT = 0.6
"""A slope takes at most so much of the friction: a base that rolls downhill without power needs brakes."""
CREEP_SHARE = 0.45
"""Of the rated torque: friction and slope take no more of a wheel that just turns. docs/bus.md demands half."""
TRIES = 100
EDGE_EVERY = 8
"""One robot of so many has every timeout as short, and its encoders as coarse, as `canbase config check` accepts."""
LEAST_TIMEOUT_S = 0.05
"""The ranges of timeouts begin there."""
EDGES = tuple(row for row in RESERVES if row.suffices)
"""The rows whose least value is enough for every robot."""
BITRATES = (125_000, 250_000, 500_000, 1_000_000)
STOP_THEMSELVES = ("generic", "epos4", "nanotec", "elmo_gold", "kinco", "technosoft", "inverter")
"""Kinds whose drives stop when their masters die: 1016h or node guarding, with 6007h."""
RELY_ON_OTHERS = ("roboteq", "zlac8015d", "tmcm1636", "dryve_d1")
ANY_UNIT = ("0.1rpm", "0.001rpm", "0.001rev/s", "counts/s")


@dataclass(frozen=True, slots=True)
class DrawnRobot:
    """One robot. `push_n`: what the slope does to its body along its x axis [N]."""

    number: int
    robot: Robot
    body: PlantParameters
    push_n: float = 0.0

    def __str__(self) -> str:
        robot, limits, body = self.robot, self.robot.limits, self.body
        return (
            f"robot {self.number}: {len(robot.drives)} motors, {robot.drives[0].profile} in mode "
            f"{robot.drives[0].used_mode}, {limits.linear_mps:g} m/s {limits.angular_radps:g} rad/s, "
            f"brakes {limits.deceleration_mps2:g} and {limits.emergency_deceleration_mps2:g} m/s², "
            f"jerk {limits.jerk_mps3:g} m/s³, {robot.rates.control_hz:g} Hz, {body.mass_kg:g} kg × "
            f"{body.payload_factor:g}, slope {self.push_n:+.0f} N"
        )


def robot_of(seed: int) -> DrawnRobot:
    """The robot of the scenario with this seed; the first SCENARIOS seeds have the sample robot."""
    return draw_robot(seed // SCENARIOS)


@lru_cache(maxsize=64)
def draw_robot(number: int, payload: float | None = None) -> DrawnRobot:
    """The same number gives the same robot; 0 is the sample. `payload`: this factor instead of the one drawn."""
    if number == 0:
        return DrawnRobot(0, campaign_robot(), PlantParameters())
    random = Random(f"robot {number}")
    for _ in range(TRIES):
        try:
            robot = commissioned(Robot.model_validate(_file(random)))
        except ValidationError:
            continue
        if bitrates(robot):
            edged = at_edges(robot) if number % EDGE_EVERY == EDGE_EVERY - 1 else robot
            return _with_body(number, edged, random, payload)
    raise RuntimeError(f"robot {number}: none of {TRIES} drawn files passes robot.yaml's checks")


def at_edges(robot: Robot, rows: Sequence[Reserve] = EDGES) -> Robot:
    """The same robot with each of these keys at the least value that its file may have; its encoders are as coarse as
    their tolerances allow. What another row demands then is raised to that row's least value."""
    coarse = _coarsened(robot, [row for row in rows if COUNTS in row.others])
    values = coarse.model_dump()
    for row in rows:
        if COUNTS not in row.others:
            for loc in row.keys(coarse):
                _set(values, loc, LEAST_TIMEOUT_S)
    for row in EDGES:
        least = rounded_up(row.least(coarse))
        for loc in row.keys(coarse):
            _set(values, loc, max(least, at(values, loc)))
    return commissioned(Robot.model_validate(values))


def _coarsened(robot: Robot, rows: Sequence[Reserve]) -> Robot:
    """With fewer increments for each motor revolution, so that the first of these tolerances is just met."""
    if not rows:
        return robot
    share = max(row.least(robot) / at(robot, loc) for row in rows for loc in row.keys(robot))
    drives = [
        drive.model_copy(update={"counts_per_motor_rev": ceil(drive.counts_per_motor_rev * share)})
        for drive in robot.drives
    ]
    return robot.model_copy(update={"drives": tuple(drives)})


def _set(values: dict[str, Any], loc: Loc, value: float) -> None:
    section = values
    for part in loc[:-1]:
        section = section[str(part)]
    section[str(loc[-1])] = value


def commissioned(robot: Robot) -> Robot:
    """The same robot after its commissioning: its limits are those of its file."""
    marks = {step: mark(robot, step) for step in STEPS}
    return robot.model_copy(update={"commissioned": Commissioned(**marks)})


def bitrates(robot: Robot) -> tuple[int, ...]:
    """Those of BITRATES that carry its frames [bit/s]."""
    return tuple(rate for rate in BITRATES if bus_load.cyclic_load(robot, rate) <= bus_load.FULL_LOAD)


def campaign_robot() -> Robot:
    """The sample robot with scanner and stop button, and with goals that give up soon enough for a short scenario."""
    robot = load_robot(sample("bench")).robot
    scan = robot.safety.scan.model_copy(update={"required": True})
    estop = robot.safety.estop.model_copy(update={"required": True})
    safety = robot.safety.model_copy(update={"scan": scan, "estop": estop})
    action = robot.action.model_copy(update=_ACTION)
    return robot.model_copy(update={"safety": safety, "action": action})


_ACTION = {"progress_timeout_s": 1.0, "overall_factor": 1.5, "overall_extra_s": 0.5, "control_hz": 50.0}


def _file(random: Random) -> dict[str, Any]:
    """A robot.yaml, which may be refused."""
    linear_mps, radius_m = _about(random, 0.3, 2.0), random.choice((0.05, 0.075, 0.1, 0.15))
    track_m = random.choice((0.25, 0.4, 0.5, 0.8))
    edge_m = round(track_m / 2.0 + 0.05, 3)
    control_hz = random.choice((50.0, 100.0, 100.0, 100.0, 200.0))
    return {
        "name": "drawn",
        "bus": {"interface": "socketcan", "channel": "can0", "bitrate": BITRATES[-1]},
        "drives": _drives(random),
        "base": {"wheel_radius_m": radius_m, "track_m": track_m},
        "limits": _limits(random, linear_mps, track_m),
        "rates": {
            "control_hz": control_hz,
            "odometry_hz": random.choice((20.0, 50.0)),
            "status_hz": random.choice((5.0, 10.0, 20.0)),
            "command_hz": random.choice((20.0, 50.0, 50.0, 100.0)),
        },
        "timeouts": _timeouts(random, control_hz),
        "mux": {"sources": _sources(random)},
        "safety": _safety(random, linear_mps, edge_m),
        "lease": {"socket": "/tmp/lease.sock"},
        "action": dict(_ACTION),
    }


def _about(random: Random, low: float, high: float) -> float:
    """Evenly on a logarithmic scale, with two digits."""
    return float(f"{low * (high / low) ** random.random():.2g}")


def _drives(random: Random) -> list[dict[str, Any]]:
    profile = random.choice(STOP_THEMSELVES if random.random() < 0.7 else RELY_ON_OTHERS)
    kind, wheels = load_profile(profile), random.choice((2, 2, 2, 2, 2, 2, 4, 4, 6, 8))
    axes = random.choice((1, kind.layout.axes)) if kind.layout.controlword == "own" else kind.layout.axes
    gear, counts = random.choice((10.0, 20.0, 33.0)), random.choice((1024, 4096, 65536))
    mode = random.choice(kind.modes)
    drives: list[dict[str, Any]] = []
    for wheel in range(wheels):
        side = "left" if wheel % 2 == 0 else "right"
        drive = {
            "joint": f"wheel_{wheel}", "node_id": 1 + wheel // axes, "axis": wheel % axes, "side": side,
            "direction": 1 if side == "left" else -1, "gear_ratio": gear, "counts_per_motor_rev": counts,
            "profile": profile, "mode": mode,
        }  # fmt: skip
        if kind.units.target_velocity is None:
            drive["velocity_unit"] = ANY_UNIT[0]
        elif profile == "generic":
            drive["velocity_unit"] = ANY_UNIT[int(gear) % len(ANY_UNIT)]
        drives.append(drive)
    return drives


def _limits(random: Random, linear_mps: float, track_m: float) -> dict[str, float]:
    """Ramps of 0.25 to 1.5 s; the turn in place is as fast as the wheels allow, or slower."""
    deceleration = float(f"{linear_mps / _about(random, 0.25, 1.5):.2g}")
    acceleration = float(f"{linear_mps / _about(random, 0.4, 2.0):.2g}")
    angular_radps = float(f"{linear_mps * random.uniform(0.4, 1.0) / (track_m / 2.0):.2g}")
    return {
        "linear_mps": linear_mps,
        "angular_radps": angular_radps,
        "acceleration_mps2": acceleration,
        "deceleration_mps2": deceleration,
        "emergency_deceleration_mps2": float(f"{min(15.0, deceleration * random.uniform(1.0, 2.5)) + 0.05:.2g}"),
        "angular_acceleration_radps2": float(f"{angular_radps / _about(random, 0.3, 1.0):.2g}"),
        "angular_deceleration_radps2": float(f"{angular_radps / _about(random, 0.25, 1.0):.2g}"),
        "jerk_mps3": _about(random, 2.0, 100.0),
    }


def _timeouts(random: Random, control_hz: float) -> dict[str, float]:
    least_s = 4.0 / control_hz
    return {
        "command_s": _about(random, 0.12, 0.4),
        "lease_s": _about(random, 0.12, 0.4),
        "drive_heartbeat_s": max(least_s, _about(random, 0.15, 0.8)),
        "feedback_s": max(least_s, _about(random, 0.06, 0.2)),
        "watchdog_s": _about(random, 0.15, 0.4),
    }


def _sources(random: Random) -> dict[str, dict[str, Any]]:
    program = {"neutral_after_s": 2.0}
    return {
        "joystick": {"topic": "cmd_vel_joy", "priority": 100, "timeout_s": _about(random, 0.15, 0.6)},
        "navigation": {"topic": "cmd_vel_nav", "priority": 50, "timeout_s": _about(random, 0.2, 0.8), **program},
        "action": {
            "topic": "cmd_vel_action", "priority": 40, "timeout_s": 0.3, "nodes": ["drive_distance_server"], **program,
        },
    }  # fmt: skip


def _safety(random: Random, linear_mps: float, edge_m: float) -> dict[str, Any]:
    stop_m = random.choice((0.1, 0.15, 0.3))
    return {
        "footprint": dict.fromkeys(("front_m", "rear_m", "left_m", "right_m"), edge_m),
        "scan": {"required": True},
        "estop": {"required": True, "latched": random.random() < 0.7},
        "stop_distance_m": stop_m,
        "slow_distance_m": round(stop_m + 0.5 * linear_mps, 3),
        "blind_mps": random.choice((0.0, 0.1, 0.15)),
        "command_timeout_s": _about(random, 0.12, 0.4),
    }


def _with_body(number: int, robot: Robot, random: Random, payload_factor: float | None) -> DrawnRobot:
    """With a load on a slope."""
    wheels = len(robot.drives)
    mass_kg, payload = wheels * random.choice(MASSES_KG), random.choice((0.5, 1.0, 1.0, 1.5, 2.0))
    payload = payload if payload_factor is None else payload_factor
    wheel_kg, coulomb_n = (
        mass_kg * random.uniform(0.03, 0.1) / wheels * 2.0,
        mass_kg * random.uniform(*FRICTION_NPKG) / wheels,
    )
    weight_n = mass_kg * payload * GRAVITY_MPS2
    most_n = FRICTION_LEFT * coulomb_n * wheels
    push_n = random.choice((-1.0, 1.0)) * min(weight_n * random.choice(SLOPES), most_n)
    return _strong_enough(number, robot, random, _Load(mass_kg, payload, wheel_kg, coulomb_n, push_n))


@dataclass(frozen=True, slots=True)
class _Load:
    """What the motors have to move and to hold; `wheel_kg` and `coulomb_n` of each wheel."""

    mass_kg: float
    payload: float
    wheel_kg: float
    coulomb_n: float
    push_n: float


def body_for(number: int, robot: Robot, payloads: tuple[float, float], slope: float) -> DrawnRobot:
    """A body for a given robot.yaml: the same number gives the same one.

    `payloads`: from, to, in multiples of the empty robot's mass; the ends are drawn more often than what lies between.
    `slope`: the steepest floor, as a share. Without power the base does not roll away on it: where dry friction as
    drawn does not hold the load there, it is as large as it has to be.
    """
    random = Random(f"body {number}")
    wheels = len(robot.drives)
    payload = random.choice((*payloads, random.uniform(*payloads)))
    floor = random.choice((-1.0, 1.0)) * random.choice((0.0, slope, random.uniform(0.0, slope)))
    mass_kg = wheels * random.choice(MASSES_KG)
    push_n = mass_kg * payload * GRAVITY_MPS2 * floor + 0.0  # never -0.0
    friction_n = max(mass_kg * random.uniform(*FRICTION_NPKG), abs(push_n) / FRICTION_LEFT)
    wheel_kg = mass_kg * random.uniform(0.03, 0.1) / wheels * 2.0
    return _strong_enough(number, robot, random, _Load(mass_kg, payload, wheel_kg, friction_n / wheels, push_n))


def _strong_enough(number: int, robot: Robot, random: Random, load: _Load) -> DrawnRobot:
    """Motors that can brake as the file states, with this load on this slope, and some force more."""
    wheels, limits = len(robot.drives), robot.limits
    mass_kg, payload, wheel_kg, coulomb_n, push_n = astuple(load)
    inertia_kg = mass_kg * payload + wheels * wheel_kg
    hardest = max(limits.emergency_deceleration_mps2, limits.acceleration_mps2)
    needs_n = (inertia_kg * hardest + abs(push_n)) / wheels + coulomb_n
    creeps_n = abs(push_n) / wheels + coulomb_n
    body = PlantParameters(
        mass_kg=mass_kg,
        payload_factor=payload,
        yaw_gyration_m=round(0.4 * robot.base.track_m, 3),
        wheel_mass_kg=round(wheel_kg, 2),
        coulomb_n=round(coulomb_n, 1),
        viscous_nspm=round(coulomb_n * random.uniform(0.3, 1.5), 1),
        peak_force_n=float(ceil(max(needs_n * random.uniform(1.2, 2.0), creeps_n / CREEP_SHARE))),
        bandwidth_radps=random.choice((60.0, 100.0, 200.0)),
    )
    return DrawnRobot(number, robot, body, round(push_n, 1))


def rolls_out(drawn: DrawnRobot) -> tuple[float, float]:
    """What dry friction takes at least of a base without power, downhill: of its speed [m/s²], of its turn [rad/s²].

    The least of three motions: straight on, in place, and about one side that is held while the other one rolls.
    """
    body, track_m = drawn.body, drawn.robot.base.track_m
    side_n = len(drawn.robot.drives) / 2.0 * body.coulomb_n - abs(drawn.push_n) / 2.0
    side_kg = len(drawn.robot.drives) / 2.0 * body.wheel_mass_kg
    mass_kg = body.mass_kg * body.payload_factor
    yaw_kg = mass_kg * (body.yaw_gyration_m / track_m) ** 2
    straight, in_place = (side_n / (mass_kg / 2.0 + side_kg), side_n / (2.0 * yaw_kg + side_kg))
    about_one = side_n / (mass_kg / 4.0 + yaw_kg + side_kg)
    return min(straight, about_one / 2.0), min(2.0 * in_place, about_one) / track_m
