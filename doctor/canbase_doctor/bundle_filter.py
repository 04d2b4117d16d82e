"""What of a text a support bundle shows, by the kind of the text. Pure: a text in, the shown text out.

Each kind has its list of what is taken: keys, fields, variables, forms of a line. All else is left out.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from io import StringIO
from typing import Any, Final

from canbase_doctor.bundle_frames import Frames, asc_line
from canbase_doctor.bundle_words import LEFT_OUT, Words
from canbase_runtime.environment_file import variables

_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
_ROS_NAME: Final = re.compile(r"[~/]?[A-Za-z][A-Za-z0-9_]{0,63}(?:/[A-Za-z][A-Za-z0-9_]{0,63}){0,7}")
TEXTS: Final[Mapping[str, re.Pattern[str]]] = {
    **dict.fromkeys(("name", "joint"), _NAME),
    **dict.fromkeys(("topic", "odom_frame", "base_frame", "frame"), _ROS_NAME),
    "channel": re.compile(r"(?:v|sl)?can\d{1,3}|239(?:\.\d{1,3}){3}|PCAN_USBBUS\d{1,2}|/dev/tty[A-Z]{3}\d{1,2}"),
    "interface": re.compile(r"[a-z]{3,10}(?:_[a-z]{3,10})?"),
    "unit": re.compile(r"[A-Za-z%°µ/·*^0-9.]{1,8}"),
    "software": re.compile(r"[0-9A-Fa-fvV.]{1,12}"),
    "socket": re.compile(r"(?:\$XDG_RUNTIME_DIR|/run)/canbase(?:/[A-Za-z][A-Za-z0-9_]*)?/lease(?:\.sock)?"),
    **dict.fromkeys(("directions", "scale", "proof", "floor", "identities"), re.compile(r"[dspfi][0-9a-f]{12}")),
    "array": re.compile(r"[A-Za-z0-9+/]*={0,2}"),
    "kind": re.compile(r"[<>|][bif]\d"),
}
"""Keys of robot.yaml, and of recordings, whose value is a name or a form; the words of all others are canbase's own."""
FREE_KEYS: Final = frozenset(("sources", "locks", "profiles"))
"""Sections whose keys are names of the robot."""

_FLAG, _WORD, _ANY = re.compile(r"true|false|[0-3]|"), re.compile(r"[A-Za-z_]{1,24}"), re.compile(r"")
VARIABLES: Final[Mapping[str, re.Pattern[str]]] = {
    "ROS_DOMAIN_ID": re.compile(r"\d{1,3}"),
    "CANBASE_OPTIONS": re.compile(r"(?:--namespace[ =]/?[A-Za-z][A-Za-z0-9_/]{0,63})?"),
    "ROS_AUTOMATIC_DISCOVERY_RANGE": _WORD,
    "ROS_DISTRO": _WORD,
    "ROS_SECURITY_STRATEGY": _WORD,
    "RMW_IMPLEMENTATION": _WORD,
    "PYTHONFAULTHANDLER": _FLAG,
    "PYTHONNOUSERSITE": _FLAG,
    "PYTHONSAFEPATH": _FLAG,
    "PYTHONUNBUFFERED": _FLAG,
    "RCUTILS_COLORIZED_OUTPUT": _FLAG,
    "ROS_LOCALHOST_ONLY": _FLAG,
    "ROS_PYTHON_VERSION": _FLAG,
    "ROS_SECURITY_ENABLE": _FLAG,
    "ROS_VERSION": _FLAG,
    "_ROS_WHEELS_BOOTSTRAP_COMPLETE": _FLAG,
    "AMENT_PREFIX_PATH": _ANY,
    "CANBASE_ROS_ARGS": _ANY,
    "COLCON_PREFIX_PATH": _ANY,
    "CYCLONEDDS_URI": _ANY,
    "FASTDDS_DEFAULT_PROFILES_FILE": _ANY,
    "FASTRTPS_DEFAULT_PROFILES_FILE": _ANY,
    "PYTHONPATH": _ANY,
    "ROS_DISCOVERY_SERVER": _ANY,
    "ROS_SECURITY_KEYSTORE": _ANY,
    "ROS_STATIC_PEERS": _ANY,
}
"""Variables of the environment, and the values that are shown; of another value, that it is set."""

JOURNAL: Final = (
    "__REALTIME_TIMESTAMP", "__MONOTONIC_TIMESTAMP", "PRIORITY", "_SYSTEMD_UNIT", "UNIT", "_PID", "CANBASE_PART",
    "CANBASE_STATE", "CANBASE_CAUSE", "CANBASE_STOPPED_BY", "CANBASE_LATCHED", "CANBASE_STANDSTILL_S",
    "CANBASE_DISTANCE_M", "CANBASE_ACTION", "CANBASE_CLEARS_ON", "CANBASE_EMERGENCY", "CANBASE_TOPIC", "CANBASE_ACTIVE",
    "CANBASE_BEFORE", "CANBASE_LOCK", "CANBASE_LOCK_HOLDS", "CANBASE_STEP", "CANBASE_STATUS", "CANBASE_ERROR_CODE",
    "CANBASE_REASON", "CANBASE_ROBOT", "MESSAGE",
)  # fmt: skip
"""Fields of an entry of the journal."""
_UNIT: Final = re.compile(r"canbase[a-z-]*@?(?:[A-Za-z][A-Za-z0-9_]{0,63})?\.(?:service|target)")
UNIT_PROPERTIES: Final = (
    "Id", "LoadState", "ActiveState", "SubState", "UnitFileState", "Result", "NRestarts", "ExecMainCode",
    "ExecMainStatus", "ExecMainStartTimestampMonotonic", "ExecMainExitTimestampMonotonic", "MainPID", "MemoryCurrent",
    "CPUUsageNSec", "TasksCurrent", "WatchdogUSec", "StatusErrno", "OOMScoreAdjust", "LimitRTPRIO", "LimitMEMLOCK",
)  # fmt: skip
"""Of systemd's units. Environment=, Exec…= and Description= hold what an owner has written there."""
_PROPERTY: Final = re.compile(r"[A-Za-z0-9_.:@+-]{0,80}")
INTERFACE_KEYS: Final = frozenset((
    "ifindex", "ifname", "flags", "mtu", "operstate", "txqlen", "linkinfo", "info_kind", "info_data", "state",
    "ctrlmode", "restart_ms", "berr_counter", "tx", "rx", "bittiming", "bitrate", "sample_point", "tq", "prop_seg",
    "phase_seg1", "phase_seg2", "sjw", "brp", "clock", "info_xstats", "restarts", "bus_error", "arbitration_lost",
    "error_warning", "error_passive", "bus_off", "stats", "stats64", "bytes", "packets", "errors", "dropped",
    "over_errors", "multicast", "carrier_errors", "collisions",
))  # fmt: skip
"""Fields of `ip -json`; its alias of an interface is free text."""
_PLAIN: Final = re.compile(r"[A-Za-z0-9_.-]{1,20}")

LINES: Final[Mapping[str, re.Pattern[str]]] = {
    "system/kernel.txt": re.compile(r"Linux [\w.+~-]{1,60} [\w-]{1,20}"),
    "system/release.txt": re.compile(r"(?:ID|VERSION_ID|VERSION_CODENAME)=\"?[a-z0-9.]{1,20}\"?"),
    "system/load.txt": re.compile(r"[A-Za-z]\w{2,20}(?:\(\w+\))?:\s+\d+(?: kB)?|[\d. /]+"),
    "system/disks.txt": re.compile(
        r"(?:/dev/[a-z0-9-]{1,20}|tmpfs|overlay|udev|devtmpfs)(?:\s+[\d.]{1,8}[KMGT]?){3}\s+\d+%\s+"
        r"/(?:boot|var|tmp|home|run|dev|opt)?(?=/|$)"
    ),
    "system/usb.txt": re.compile(r"Bus \d{3} Device \d{3}: ID [0-9a-f]{4}:[0-9a-f]{4}"),
    "can/sockets.txt": re.compile(r"==> /proc/net/can/[a-z_-]+ <==|[\w\s.:%*#()/-]{0,160}"),
    "units/list.txt": re.compile(rf"[●*\s]*{_UNIT.pattern}\s+[a-z-]+\s+[a-z-]+\s+[a-z-]+"),
    "config/installed": re.compile(
        r"/(?:etc|usr/lib)/(?:systemd/system|canbase|udev/rules\.d|tmpfiles\.d|sysusers\.d|modules-load\.d)"
        r"/[A-Za-z0-9@_./-]{1,120}"
    ),
    "journal/kernel.txt": re.compile(
        r"((?:[A-Z][a-z]{2} [ \d]\d )?[\d:.]{8,15}) \S{1,64} (kernel: (?:\[[ \d.]+\] )?(?:"
        r"(?:[a-z0-9_]{1,16} [0-9a-f:.-]{1,20} )?(?:v|sl)?can\d{1,3}: [a-z -]{1,60}|"
        r"usb [\d.-]{1,12}: (?:USB disconnect, device number \d+|reset [a-z-]+ USB device number \d+ using [a-z_]+)|"
        r"Out of memory: Killed process \d+|oom-kill|PM: suspend (?:entry|exit)|"
        r"(?:clocksource|watchdog|hrtimer|sched): [a-z ]{1,60}|"
        r"INFO: task \S{1,15} blocked for more than \d+ seconds))"
    ),
}
"""By file of the bundle: the parts of a line that are taken."""


class Filter:
    """Knows the words; one for each bundle."""

    def __init__(self, words: Words) -> None:
        self.words = words
        self._of_lines: dict[str, Callable[[str], str]] = {
            "journal/canbase.json": self.journal,
            "can/interfaces.json": interfaces,
            "units/status.txt": unit_status,
        }

    def output(self, file: str, text: str) -> str:
        """Of a program."""
        if file in self._of_lines:
            return self._of_lines[file](text)
        if file in LINES:
            return matching(LINES[file], text)
        return self.words.lines(text)

    def configuration(self, text: str) -> str:
        """A YAML file: known keys with numbers, switches and known texts; no comments."""
        from ruamel.yaml import YAML
        from ruamel.yaml.error import YAMLError

        yaml = YAML(typ="safe", pure=True)
        yaml.default_flow_style = False
        try:
            found = yaml.load(text)
            written = StringIO()
            yaml.dump(self.plain(found), written)
        except (YAMLError, RecursionError, ValueError, OverflowError):
            return f"{LEFT_OUT} no YAML\n"
        return written.getvalue()

    def settings(self, text: str) -> str:
        """A file NAME=value a line, as units have it: known variables."""
        return environment(variables(text))

    def plain(self, value: Any, key: str = "", depth: int = 0) -> Any:
        """A value of JSON or YAML without what is not known."""
        if depth > 40:
            return LEFT_OUT
        if value is None or isinstance(value, (bool, float)):
            return value
        if isinstance(value, int):
            return value if -(2**63) <= value < 2**64 else LEFT_OUT
        if isinstance(value, Mapping):
            return self._mapping(value, key, depth)
        if isinstance(value, (list, tuple)):
            return [self.plain(each, key, depth + 1) for each in value]
        return self._text(str(value), key)

    def _mapping(self, value: Mapping[Any, Any], key: str, depth: int) -> dict[Any, Any]:
        kept: dict[Any, Any] = {}
        for number, (name, inner) in enumerate(value.items()):
            if key == "profiles" and isinstance(inner, str):
                kept[f"profile {number + 1}"] = self.configuration(inner)
            elif isinstance(name, int) or (isinstance(name, str) and self.words.knows_all(name)):
                kept[name] = self.plain(inner, name if isinstance(name, str) else key, depth + 1)
            else:
                kept[LEFT_OUT] = LEFT_OUT
        return kept

    def _text(self, text: str, key: str) -> str:
        form = TEXTS.get(key)
        return text if form is not None and form.fullmatch(text) else self.words.value(text)

    def recording(self, text: str) -> str:
        """An ASC file of canbase: frames, and notes of known words."""
        frames, kept = Frames(), []
        for line in text.splitlines():
            shown, note = asc_line(line, frames)
            if shown or note:
                kept.append(shown + (self.words.line(note) if note else ""))
        return "".join(f"{line}\n" for line in kept)

    def json_file(self, text: str) -> str:
        """One object, as the driver records it."""
        try:
            return json.dumps(self.plain(json.loads(text)), indent=1) + "\n"
        except (ValueError, RecursionError):
            return f"{LEFT_OUT} no JSON\n"

    def json_lines(self, text: str) -> str:
        """One object or list a line, as watchdog and velocity process record their inputs."""
        frames, kept = Frames(), []
        for line in text.splitlines():
            try:
                found = json.loads(line)
            except (ValueError, RecursionError):
                continue
            kept.append(json.dumps(_frame(found, frames) or self.plain(found)))
        return "".join(f"{line}\n" for line in kept)

    def journal(self, text: str) -> str:
        """`journalctl --output=json`: the fields of JOURNAL, the message of known words."""
        kept = []
        for line in text.splitlines():
            try:
                found = json.loads(line)
            except (ValueError, RecursionError):
                continue
            if isinstance(found, dict):
                kept.append(json.dumps({name: self._field(name, found[name]) for name in JOURNAL if name in found}))
        return "".join(f"{line}\n" for line in kept)

    def _field(self, name: str, value: object) -> str:
        text = value if isinstance(value, str) else ""
        if name in ("_SYSTEMD_UNIT", "UNIT"):
            return text if _UNIT.fullmatch(text) else LEFT_OUT
        if name.startswith("_") or name == "PRIORITY":
            return text if re.fullmatch(r"\d{1,20}", text) else LEFT_OUT
        return " ".join(self.words.line(line) for line in text.splitlines())


def journal_text(shown: str) -> str:
    """What `Filter.journal` has shown, for people: time, unit, priority, message."""
    lines = []
    for line in shown.splitlines():
        entry = json.loads(line)
        stamp = entry.get("__REALTIME_TIMESTAMP", "0")
        unit = entry.get("_SYSTEMD_UNIT") or entry.get("UNIT") or "-"
        seconds = int(stamp) / 1e6 if stamp.isdigit() else 0.0
        lines.append(f"{_utc(seconds)} {unit} <{entry.get('PRIORITY', '')}> {entry.get('MESSAGE', '')}")
    return "".join(f"{line}\n" for line in lines)


def _utc(seconds: float) -> str:
    from datetime import datetime, timezone

    return (
        datetime.fromtimestamp(seconds, tz=timezone.utc).isoformat(timespec="microseconds").removesuffix("+00:00") + "Z"
    )


def _frame(found: object, frames: Frames) -> list[Any] | None:
    match found:
        case ["frame", float() | int() as at, int(cob_id), str(data)] if re.fullmatch(r"(?:[0-9a-f]{2}){0,8}", data):
            return ["frame", at, cob_id, frames.shown(cob_id, bytes.fromhex(data)).hex()]
    return None


def environment(found: Mapping[str, str]) -> str:
    """The variables of VARIABLES, one a line."""
    return "".join(
        f"{name}={found[name] if VARIABLES[name].fullmatch(found[name]) else LEFT_OUT}\n"
        for name in sorted(found)
        if name in VARIABLES
    )


def matching(form: re.Pattern[str], text: str) -> str:
    """Of each line the groups of `form`, or what it matches; nothing else of it."""
    found = filter(None, map(form.match, text.splitlines()))
    kept = (" ".join(filter(None, each.groups())) or each.group() for each in found)
    return "".join(f"{line.rstrip()}\n" for line in kept if line.strip())


def interfaces(text: str) -> str:
    """`ip -details -statistics -json link`."""

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: plain(inner) for name, inner in value.items() if name in INTERFACE_KEYS}
        if isinstance(value, list):
            return [plain(inner) for inner in value]
        return value if not isinstance(value, str) or _PLAIN.fullmatch(value) else LEFT_OUT

    try:
        return json.dumps(plain(json.loads(text)), indent=1) + "\n"
    except (ValueError, RecursionError):
        return ""


def unit_status(text: str) -> str:
    """`systemctl show`: one unit a paragraph, first its state as `systemctl status` has it."""
    units = []
    for paragraph in re.split(r"\n\s*\n", text):
        pairs = (line.partition("=") for line in paragraph.splitlines())
        found = {name: value for name, _, value in pairs if name in UNIT_PROPERTIES and _PROPERTY.fullmatch(value)}
        if _UNIT.fullmatch(found.get("Id", "")):
            first = f"{found.pop('Id')}: {found.pop('ActiveState', '')} ({found.pop('SubState', '')})"
            units.append("".join(f"{line}\n" for line in (first, *(f"    {n}={v}" for n, v in found.items()))))
    return "\n".join(units)


def names_of(values: Any, key: str = "") -> Iterable[str]:
    """The names that a valid robot.yaml gives: of the robot, joints, topics, frames, sources and locks."""
    if isinstance(values, Mapping):
        for name, inner in values.items():
            if key in FREE_KEYS and key != "profiles":
                yield str(name)
            yield from names_of(inner, str(name))
    elif isinstance(values, (list, tuple)):
        for inner in values:
            yield from names_of(inner, key)
    elif isinstance(values, str) and (key in ("name", "joint", "topic") or key.endswith("frame")):
        yield values
