"""The .json file of a recorded stop: what stopped the base, when, and with which robot.yaml. Reads files alone.

docs/ros_api.md describes it ("The black box"); canbase_driver.runtime.black_box_json writes it.
"""

from __future__ import annotations

import copy
import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError

from canbase_config.robot import Robot
from canbase_config.watchdog import WatchdogConfig
from canbase_recording.input_lines import NoInputsError, Time, first_of
from canbase_runtime.driver_state import DriverState

MOST_BYTES: Final = 64_000_000
"""canbase writes a few MB."""
_Watchdog = Annotated[
    WatchdogConfig,
    BeforeValidator(lambda values: WatchdogConfig.from_json(json.dumps(values))),
    Field(validation_alias="watchdog_config"),
]


@dataclass(frozen=True, slots=True)
class StopFile:
    """Times: monotonic seconds of the robot's computer. `began_s`: of the recording; `at_s`: of the stop."""

    format: Literal[1]
    began_s: Time
    at_s: Time
    wall_offset_s: Time
    """On top of a time: seconds since 1970."""
    stopped_by: str
    cause: str
    detail: str
    robot_yaml: dict[str, Any]
    profiles: dict[str, str]
    watchdog: _Watchdog
    versions: dict[str, str]
    events: list[dict[str, Any]] = field(default_factory=list)
    """Commands and states, with their times (`at_s`)."""

    def was_enabled(self, since_s: float, until_s: float) -> bool:
        """The driver enabled its drives between these times."""
        return any(
            event.get("what") == "motor_driver/state"
            and event.get("state") == DriverState.ENABLED.name
            and isinstance(event.get("at_s"), float)
            and since_s < event["at_s"] <= until_s
            for event in self.events
        )

    @property
    def robot(self) -> Robot:
        """As it was configured, with the user's own profiles out of the recording. Raises NoInputsError."""
        values = copy.deepcopy(self.robot_yaml)
        listed = values.get("drives")
        drives = [each for each in listed if isinstance(each, dict)] if isinstance(listed, list) else []
        with tempfile.TemporaryDirectory(prefix="canbase-") as folder:
            for number, (name, text) in enumerate(self.profiles.items()):
                own = Path(folder) / f"{number}.yaml"
                own.write_text(text, encoding="utf-8")
                for drive in drives:
                    drive["profile"] = str(own) if drive.get("profile") == name else drive.get("profile")
            try:
                return Robot.model_validate(values)
            except ValidationError as error:
                raise NoInputsError(f"this canbase refuses the recorded robot.yaml: {first_of(error)}") from error


_FILE: Final = TypeAdapter(StopFile)


def stop_of(values: Mapping[str, Any]) -> StopFile:
    """What the JSON object has. Raises NoInputsError."""
    try:
        return _FILE.validate_python(values)
    except ValidationError as error:
        raise NoInputsError(first_of(error)) from error
    except (KeyError, TypeError, AttributeError) as error:  # of WatchdogConfig
        raise NoInputsError(f"watchdog_config: {str(error)[:200]}") from error


def read_stop(path: Path) -> StopFile:
    """`path`: either file of the stop. Raises NoInputsError."""
    beside = path.with_suffix(".json")
    try:
        with beside.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise NoInputsError(f"longer than {MOST_BYTES // 1_000_000} MB")
        return stop_of(json.loads(content))
    except FileNotFoundError as error:
        raise NoInputsError(
            f"{beside}: there is no such file; it is written beside the .asc, and needed for a replay "
            "(canbase explain needs the .asc alone)"
        ) from error
    except OSError as error:
        raise NoInputsError(f"{beside}: cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise NoInputsError(f"{beside}: no JSON: {error}") from error
    except NoInputsError as error:
        raise NoInputsError(f"{beside}: {error}") from error


def robot_beside(path: Path) -> Robot | None:
    """The robot in the .json file beside the .asc file of a stop; None: there is none. Raises NoInputsError."""
    if path.suffix != ".asc" or not path.with_suffix(".json").is_file():
        return None
    stop = read_stop(path)
    try:
        return stop.robot
    except NoInputsError as error:
        raise NoInputsError(f"{path.with_suffix('.json')}: {error}") from error
