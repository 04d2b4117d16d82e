"""Any valid robot, written as its effective configuration and read again, is the same robot."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from canbase_config.effective import effective
from canbase_config.load import Loaded, leaf_keys, load_robot
from canbase_config.robot import Robot
from canbase_config.tolerances import BOUNDS

Values = dict[str, Any]

TEXT = st.text(st.characters(codec="utf-8"), max_size=12)
PLAIN = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | TEXT
JSON = st.recursive(
    PLAIN, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3), max_leaves=6
)


def from_schema(shape: Values, definitions: Values) -> st.SearchStrategy[Any]:
    """Values that the JSON schema `shape` allows; keys that are not required come and go."""
    if "$ref" in shape:
        return from_schema(definitions[shape["$ref"].rpartition("/")[2]], definitions)
    if "anyOf" in shape:
        return st.one_of([from_schema(option, definitions) for option in shape["anyOf"]])
    if "enum" in shape:
        return st.sampled_from(shape["enum"])
    if shape["type"] == "object":
        return objects(shape, definitions)
    if shape["type"] == "array":
        return st.lists(from_schema(shape["items"], definitions), min_size=shape.get("minItems", 0), max_size=4)
    return scalars(shape)


def objects(shape: Values, definitions: Values) -> st.SearchStrategy[Any]:
    for pattern, inner in shape.get("patternProperties", {}).items():
        names = matching(pattern, max_length=64)
        return st.dictionaries(names, from_schema(inner, definitions), min_size=1, max_size=3)
    if "properties" not in shape:
        return st.dictionaries(TEXT, JSON, max_size=3)
    keys = {key: from_schema(inner, definitions) for key, inner in shape["properties"].items()}
    required = shape.get("required", ())
    return st.fixed_dictionaries(
        {key: keys[key] for key in required}, optional={key: keys[key] for key in keys if key not in required}
    )


def scalars(shape: Values) -> st.SearchStrategy[Any]:
    match shape["type"]:
        case "number":
            low = shape.get("minimum", shape.get("exclusiveMinimum"))
            return st.floats(low, shape["maximum"], exclude_min="exclusiveMinimum" in shape)
        case "integer":
            return st.integers(shape["minimum"], shape["maximum"])
        case "boolean":
            return st.booleans()
        case "null":
            return st.none()
    if "pattern" in shape:
        return matching(shape["pattern"], shape["maxLength"])
    return st.text(st.characters(codec="utf-8"), min_size=shape["minLength"], max_size=shape.get("maxLength", 30))


def matching(pattern: str, max_length: int) -> st.SearchStrategy[str]:
    """Text of `pattern`; without the line end that Python's `$` allows behind it, unlike pydantic's."""
    return st.from_regex(pattern, fullmatch=True).filter(lambda text: len(text) <= max_length and "\n" not in text)


def made_consistent(values: Values) -> Values:
    """`values` changed where two of them may contradict each other, as the model's own checks demand."""
    for index, drive in enumerate(values["drives"]):
        drive |= {"joint": f"{drive['joint'][:60]}_{index}", "node_id": index + 1, "side": ("left", "right")[index % 2]}
        drive |= {"profile": ("generic", "roboteq")[index % 2], "mode": (3, None)[index // 2 % 2]}
        drive["velocity_unit"] = "rpm"  # 32 bits hold every speed in it
        one_of_few = [each | {"bits": 8} for each in drive.get("values", [])[:1]]  # TPDOs and names are shared
        drive["values"] = one_of_few if index == 0 else []
    values["bus"].pop("sync_counter", None)
    values["bus"]["bitrate"] = 1_000_000 - values["bus"].get("bitrate", 0) % 300_000  # for eight drives at 200 Hz
    limits, safety, action = values["limits"], values["safety"], values.get("action", {})
    for key, least in (("deceleration_mps2", 1.0), ("angular_deceleration_radps2", 5.0), ("jerk_mps3", 1.0)):
        limits[key] = max(limits.get(key, 10.0), least)  # it stops in time
    limits["emergency_deceleration_mps2"] = max(limits["emergency_deceleration_mps2"], limits["deceleration_mps2"])
    safety["footprint"] = {side: max(size_m, 2.5) for side, size_m in safety["footprint"].items()}  # it has the wheels
    safety["stop_distance_m"] = min(safety.get("stop_distance_m", 0.15), 4.0)
    safety["slow_distance_m"] = safety["stop_distance_m"] + 0.5
    safety["reaction_s"] = max(safety.get("reaction_s", 0.3), 0.2)  # two control cycles
    for index, scan in enumerate(safety.get("more_scans", [])):
        scan["topic"] = f"{scan.get('topic', 'scan')[:100].rstrip('/')}_{index}"
    for what in ("distance_m", "speed_mps", "angle_rad", "speed_radps"):
        action.pop(f"max_{what}", None)
        action[f"min_{what}"] = min(action.get(f"min_{what}", 0.01), 0.4)
    action["spin_speed_radps"] = max(action.get("spin_speed_radps", 1.0), 0.4)
    action.pop("require_client_lease", None)  # not together with nav2_behaviors
    make_long_enough(values)
    make_tight_enough(values)
    for extra in ("interface", "channel", "bitrate"):
        values["bus"].get("extra", {}).pop(extra, None)
    make_mux_consistent(values.get("mux", {}))
    make_ordered(values.get("health") or {}, "voltage_low_v", "voltage_high_v")
    make_ordered(values.get("battery") or {}, "empty_v", "full_v")
    return values


def make_long_enough(values: Values) -> None:
    """Timeouts and tolerances that allow for the slowest rates, and encoders that are fine enough for the latter."""
    timeouts, watchdog = values.setdefault("timeouts", {}), values.setdefault("watchdog", {})
    timeouts.pop("standstill_s", None)
    timeouts |= {"command_s": 0.3, "lease_s": 0.3, "watchdog_s": 0.3, "feedback_s": 0.3, "odometry_s": 1.0}
    timeouts["drive_heartbeat_s"] = max(timeouts.get("drive_heartbeat_s", 0.3), 0.8)
    values["safety"]["command_timeout_s"] = 0.3
    rates = values.setdefault("rates", {})
    rates["odometry_hz"] = max(rates.get("odometry_hz", 50.0), 3.0)
    watchdog["travel_tolerance_m"] = 0.0625
    values["base"]["wheel_radius_m"] = min(values["base"]["wheel_radius_m"], 0.1)
    for drive in values["drives"]:
        drive["gear_ratio"] = max(drive["gear_ratio"], 1.0)
        drive["counts_per_motor_rev"] = max(drive["counts_per_motor_rev"], 100)


def make_tight_enough(values: Values) -> None:
    """The keys with a bound are at their defaults; a robot fast enough for its coarse encoders."""
    values["limits"]["linear_mps"] = max(values["limits"]["linear_mps"], 1.0)
    for row in BOUNDS:
        section, name = row.key.split(".")
        values[section].pop(name, None)
    values["watchdog"]["motion_missing_m"] = 0.06


def make_ordered(section: Values, low: str, high: str) -> None:
    if section.get(low) is not None and section.get(high) is not None:
        section[low], section[high] = 10.0 + section[low] / 10.0, 200.0 + section[high] / 10.0


def make_mux_consistent(mux: Values) -> None:
    mux.pop("twist_mux", None)  # files that would have to exist
    for index, source in enumerate(mux.get("sources", {}).values()):
        source |= {"priority": index, "topic": f"{source['topic'][:100].rstrip('/')}_{index}"}
        if source.get("type") == "joint_command":
            source |= {"stamped": True, "neutral_after_s": None}
    for lock in mux.get("locks", {}).values():
        lock |= {"priority": max(lock["priority"], 41), "topic": f"{lock['topic'][:100].rstrip('/')}_lock"}


SCHEMA = Robot.model_json_schema()
ROBOTS = from_schema(SCHEMA, SCHEMA["$defs"]).map(made_consistent).map(Robot.model_validate)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(ROBOTS)
def test_any_valid_robot_survives_being_written_and_read(robot: Robot) -> None:
    text = effective(Loaded(robot, Path("robot.yaml"), frozenset(), frozenset(leaf_keys(robot.model_dump()))))

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.yaml"
        file.write_text(text, encoding="utf-8", newline="")
        assert load_robot(file).robot == robot
