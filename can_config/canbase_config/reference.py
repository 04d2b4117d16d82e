"""docs/configuration.md: every key of robot.yaml and of a drive profile, written from the models that check them."""

from __future__ import annotations

from typing import Any, Final

from canbase_config import reserves, tolerances
from canbase_config.load import load_robot, sample
from canbase_config.profile_file import PROFILE_SCHEMA
from canbase_config.robot import Robot
from canbase_config.schema import Schema, Shape, kind_of

_HEAD: Final = """\
# Configuration

Every key with its range, default and meaning. `canbase config keys` writes this page from the models that check
the files; a test compares them.

- `canbase config check --config robot.yaml` names each mistake with its line, and prints all keys with defaults.
- Lengths are in m, speeds in m/s and rad/s, times in s; the name of a key carries its unit. Forward, left and
  counter-clockwise are positive (REP 103).
- **must be given**: there is no default that fits every robot. No timeout can be switched off.
- The bus load of the cyclic frames is computed from `bus.bitrate`, `rates.control_hz`, the drives' PDOs,
  SYNC and heartbeats: above 90 % the file is refused (eight drives at 250 kbit/s and 100 Hz), above 60 % there is a
  warning. Both name what to change. Boots and tools need the rest.
- A file has at most 256,000 bytes, 5,000 keys and values with every alias written out, 32 levels, 4,000 characters in a
  text and 40 in a number. Of its mistakes the first twenty are printed.
- `drives[…]` is each entry of a list, `mux.sources.…` each entry under a name that you choose.
"""
_PROFILE_HEAD: Final = """\
# Drive profiles

A `.yaml` file for a kind of drive, named by `drives[…].profile` of robot.yaml. A key that is left out has the value of
the `generic` profile. How to write one: [drive_types.md](drive_types.md#a-new-drive-in-five-steps).
"""
_ROW: Final = "| {} | {} | {} | {} |"


_RESERVES: Final = """\
## Keys that depend on each other

A timeout must allow for one lost message: two periods, plus the time by which a message may be late. An encoder must
be fine enough for the tolerance that it is compared with. The footprint must contain the wheels, where each side has
one drive: with more of them the base skids, and turns by a wider track than it has. A file in which a key is less than
*at least* is refused, and the message names the least value that is accepted. *Sample*: the value of the bench robot,
and the least one for it.

| key | is for | at least | sample |
|---|---|---|---|
"""


_WITHOUT: Final = """\
Every other key that is a time or a rate, and why no rule compares it:

| key | reason |
|---|---|
"""


_BOUNDS: Final = """\
## How much the watchdog may forgive

A tolerance that is too wide for a robot hides a failure. A file with more than *at most* (with less, where the row has
*at least*) is refused, and the message names the bound and where it comes from. The default of a key always passes.
*Sample*: the value of the bench robot, and the bound for it.

| key | hides beyond that | bound | sample |
|---|---|---|---|
"""
_BY_RANGE: Final = """\
Every other key below `watchdog`, and what bounds it:

| key | reason |
|---|---|
"""


def _bounds() -> str:
    robot = load_robot(sample("bench")).robot
    rows = [
        _ROW.format(f"`{row.key}`", _cell(row.hides), f"at {row.word} {_cell(row.rule)}", _bound(robot, row))
        for row in tolerances.BOUNDS
    ]
    others = [f"| `{key}` | {_cell(reason)} |" for key, reason in tolerances.BY_RANGE.items()]
    return _BOUNDS + "\n".join((*rows, "")) + "\n" + _BY_RANGE + "\n".join((*others, ""))


def _bound(robot: Robot, row: tolerances.Bound) -> str:
    given = row.given(robot)
    return f"{'default' if given is None else f'{given:g}'}, {row.word} {row.bound(robot):.3g}"


def _reserves() -> str:
    robot = load_robot(sample("bench")).robot
    rows = [
        _ROW.format(f"`{row.key}`", _cell(row.waits_for), _cell(row.rule), _figures(robot, row))
        for row in reserves.RESERVES
    ]
    others = [f"| `{key}` | {_cell(reason)} |" for key, reason in reserves.WITHOUT_RESERVE.items()]
    return _RESERVES + "\n".join((*rows, "")) + "\n" + _WITHOUT + "\n".join((*others, ""))


def _figures(robot: Robot, row: reserves.Reserve) -> str:
    given = min(reserves.at(robot, loc) for loc in row.keys(robot))
    return f"{given:g}, least {row.least(robot):.3g}"


def configuration_page() -> str:
    """The whole of docs/configuration.md."""
    parts = [
        _HEAD,
        _reserves(),
        _bounds(),
        *_tables(Schema(Robot), "robot.yaml"),
        _PROFILE_HEAD,
        *_tables(PROFILE_SCHEMA, "profile"),
    ]
    return "\n".join(parts)


def _tables(schema: Schema, file: str) -> list[str]:
    tables: list[str] = []
    first: dict[str, str] = {}
    for path, shape in schema.shapes:
        alike = first.setdefault(repr((shape.get("title"), shape["properties"])), path)
        heading = f"## {f'`{path}`' if path else f'{file}, top level'}\n"
        tables.append(heading if alike == path else f"{heading}\nAs `{alike}`.\n")
        if alike == path:
            tables.append(_table(schema, shape))
    return tables


def _table(schema: Schema, shape: Shape) -> str:
    required = shape.get("required", ())
    lines: list[str] = []
    if shape.get("description"):
        lines += [" ".join(str(shape["description"]).split()), ""]
    lines += [_ROW.format("key", "value", "default", "meaning"), "|---|---|---|---|"]
    for key, inner in shape["properties"].items():
        at = schema.resolved(inner)
        default = "**must be given**" if key in required else _default(at, at.get("default"))
        lines.append(_ROW.format(f"`{key}`", _cell(_value(at)), default, _cell(_meaning(at))))
    return "\n".join((*lines, ""))


def _value(shape: Shape) -> str:
    """Of a section its keys have a table of their own."""
    return "section" if shape.get("type") == "object" else kind_of(shape)


def _meaning(shape: Shape) -> str:
    return str(shape.get("description", ""))


def _default(shape: Shape, value: Any) -> str:
    if value is None:
        return "none" if shape.get("type") != "object" or "default" in shape else "empty"
    if isinstance(value, (dict, list)):
        return _collection(shape, value)
    if isinstance(value, bool):
        return str(value).lower()
    return f"`{value}`" if isinstance(value, str) else f"{value:.10g}"


def _collection(shape: Shape, value: dict[str, Any] | list[Any]) -> str:
    if not value:
        return "empty"
    if isinstance(value, list):
        return ", ".join(str(each) for each in value)
    return "as below" if "properties" in shape else ", ".join(value)


def _cell(text: str) -> str:
    """Without what ends a cell of a table."""
    return " ".join(text.split()).replace("|", "\\|").replace(">=", "≥").replace("<=", "≤")
