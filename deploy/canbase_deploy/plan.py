"""Which files, links and commands make a robot's services. Pure: a request in, a list of actions out.

Files that the owner edits (`owner.py`) are in /etc/canbase; all others are ours and are written anew.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Final, Literal

from canbase_config.robot import Robot
from canbase_deploy.actions import Action, Existing, FirstRecords, Link, Remove, Run, WriteFile
from canbase_deploy.keystore import KEYS, SERVICES, view
from canbase_deploy.neighbours import DOMAIN, Neighbour, clash, namespace
from canbase_deploy.owner import ETC, USER, is_the_owners, misplaced, modes, old, owner_paths, place
from canbase_deploy.relay import APPLY, drop_in_text, udev_rule, wrong_chip

UNITS: Final = PurePosixPath("/etc/systemd/system")
RUN: Final = PurePosixPath("/run/canbase")
STATE: Final = PurePosixPath("/var/lib/canbase")
PARTS: Final = ("watchdog", "driver", "velocity", "action-server")
WITH_ROS: Final = PARTS[1:]
ON_THE_BUS: Final = PARTS[:2]
METRICS: Final = "metrics"
"""Its unit is installed and not started: nothing of the robot needs it."""
REACH: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"

ACCOUNT: Final = WriteFile(
    PurePosixPath("/etc/sysusers.d/canbase.conf"), f'u {USER} - "canbase motor driver stack" {RUN}\n'
)
MODES: Final = WriteFile(
    PurePosixPath("/etc/tmpfiles.d/canbase.conf"),
    f"d {ETC} 0750 root {USER}\nz {ETC}/*.yaml 0640 root {USER}\nz {ETC}/*.env 0640 root {USER}\n",
)
"""User and modes as declarations, so that they come true at the first boot of an image too."""

_INTERFACE: Final = re.compile(r"[A-Za-z0-9_.]{1,15}")
_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_CPUS: Final = re.compile(r"\d+(-\d+)?(,\d+(-\d+)?)*")
_ADAPTER: Final = re.compile(r"[A-Z_]+=\S+")
_PYTHON: Final = "@PYTHON@"
HARDENING: Final = "canbase-hardening.conf"
"""The sandbox of all parts: one file, a drop-in of each of their units. In `canbase-.service.d` it would be one of the
integrator's own units too, whatever they need."""
COMMON: Final = "canbase-common.conf"
"""What the four parts have in common beside it, likewise."""
ONLINE: Final = "network-online.target"
"""DDS looks at the network interfaces as a node starts, and uses no other ones."""


class InstallError(ValueError):
    """This robot cannot be installed so; the text says what to change."""


@dataclass(frozen=True, slots=True)
class Request:
    """What to install. `templates`: name and text of the files in deploy/systemd; `python`: runs `-m canbase_cli`.

    `yaml`: the text of robot.yaml, None: keep the installed one. `files`: texts of the files that it names by relative
    paths, by these. `adapter`: a udev property, `ID_PATH=…`, that names
    the adapter which is to get the interface's name. `cpus`: for CPUAffinity. `hardware_watchdog_s`: 0 leaves it alone.
    `environment`: what the owner chose of ROS; `sourced`: what a sourced ROS 2 set, by which the services find it.
    `namespace`: of its nodes, "/robot2"; empty: none. `kept`: what its environment file sets that is there already,
    which is kept; empty: there is none.
    """

    name: str
    robot: Robot
    yaml: str | None
    python: str
    templates: Mapping[str, str]
    environment: Mapping[str, str] = field(default_factory=dict)
    sourced: Mapping[str, str] = field(default_factory=dict)
    network: Literal["localhost", "lan"] = "localhost"
    bring_up_can: bool = True
    adapter: str = ""
    cpus: str = ""
    hardware_watchdog_s: int = 0
    sros2: bool = False
    files: Mapping[str, str] = field(default_factory=dict)
    namespace: str = ""
    kept: Mapping[str, str] = field(default_factory=dict)

    @property
    def services_environment(self) -> dict[str, str]:
        """What the environment file sets after the installation."""
        return dict(self.kept) or _environment_values(self)


def install_plan(request: Request, manifests: Mapping[str, str], neighbours: Sequence[Neighbour] = ()) -> list[Action]:
    """All actions, in order. `manifests`: what is installed now; files of this robot that it no longer has are removed.

    Raises InstallError for a robot that services cannot run, or not beside its `neighbours`.
    """
    _check(request)
    _check_namespace(request)
    _check_places(request, manifests)
    own = Neighbour(request.name, request.robot, request.files, request.services_environment)
    for other in neighbours:
        if wrong := clash(own, other):
            raise InstallError(wrong)
    before = [PurePosixPath(path) for path in manifests.get(request.name, "").splitlines()]
    named = dict.fromkeys([*map(place, request.files), *filter(is_the_owners, before)])
    files = [*_files(request), *_modes_of(request.name, named)]
    listed = dict.fromkeys([*named, *(action.path for action in files if not is_the_owners(action.path))])
    stale = [path for path in _own(request.name, manifests) if path not in listed]
    return [
        ACCOUNT,
        *(Run(("systemctl", "stop", unit), True) for unit in left_interfaces(request, manifests, neighbours)),
        Run(("systemd-sysusers", str(ACCOUNT.path))),
        FirstRecords(STATE / request.name, request.robot.name, USER),
        *files,
        *map(Remove, stale),
        WriteFile(manifest_path(request.name), "".join(f"{path}\n" for path in listed)),
        Run(("systemd-tmpfiles", "--create", str(MODES.path), *(str(f.path) for f in _modes_of(request.name, named)))),
        Run(("udevadm", "control", "--reload")),
        *([APPLY] if request.robot.watchdog.relay else []),
        Run(("systemctl", "daemon-reload")),
    ]


def left_interfaces(request: Request, manifests: Mapping[str, str], neighbours: Sequence[Neighbour] = ()) -> list[str]:
    """Units of the CAN interfaces that this robot was installed with and that no robot.yaml names any more.

    They are brought down before their files go. Not while the robot runs: it would lose its bus.
    """
    used = {_can_env(robot.bus.channel) for robot in (request.robot, *(other.robot for other in neighbours))}
    return _interfaces(path for path in _own(request.name, manifests) if path not in used)


def next_step(request: Request, changed: Collection[PurePosixPath], *, upgrade: bool) -> str:
    """What the user does when the plan has been carried out; `changed`: the files that are not as they were.

    An interface that is up keeps its bit rate however often the robot is restarted: canbase-can@ has to be, alone.
    """
    target, interface = f"canbase@{request.name}.target", request.robot.bus.channel
    if not upgrade:
        return f"now: sudo systemctl start {target}, or boot; wheels up for the first time"
    if not request.bring_up_can or not {_can_env(interface), UNITS / "canbase-can@.service"} & set(changed):
        return f"now, with the robot at standstill: sudo systemctl restart {target}"
    steps = (f"stop {target}", f"restart canbase-can@{interface}.service", f"start {target}")
    return f"now, with the robot at standstill: {' && '.join(f'sudo systemctl {step}' for step in steps)}"


def network_warning(request: Request, environment: Mapping[str, str]) -> str:
    """Where `--network` and the environment file, which an upgrade keeps, say different things; empty: they agree."""
    path = owner_paths(request.name)[1]
    lan = UNITS / f"{service('driver', request.name)}.d" / "20-lan.conf"
    reach = environment.get(REACH, "")
    is_open = reach in ("SUBNET", "SYSTEM_DEFAULT")
    if request.network == "localhost" and is_open:
        return (
            f"warning: {path} has {REACH}={reach}, but there is no {lan}, which lets others in: "
            f"set {REACH}=LOCALHOST in {path}, or install with --network lan"
        )
    if request.network == "lan" and not is_open and not environment.get("ROS_STATIC_PEERS"):
        return (
            f"warning: {lan} lets others in, but {path} has {REACH}={reach}, so they do not find the robot: "
            f"set {REACH}=SUBNET in {path}, or install without --network lan"
        )
    return ""


def uninstall_plan(name: str, manifests: Mapping[str, str], *, purge: bool = False) -> list[Action]:
    """Removes what `manifests[name]` lists and no other robot's manifest does; the owner's files only with `purge`.

    Raises InstallError when `name` is not installed.
    """
    if name not in manifests:
        known = ", ".join(sorted(manifests)) or "none"
        raise InstallError(f"the robot {name!r} is not installed; installed: {known}")
    own = _own(name, manifests)
    owners = [path for path in [*filter(is_the_owners, own), *owner_paths(name)] if purge]
    return [
        Run(("systemctl", "stop", f"canbase@{name}.target", *(service(part, name) for part in PARTS)), True),
        *(Run(("systemctl", "stop", unit), True) for unit in _interfaces(own)),
        *(Remove(path) for path in own if not is_the_owners(path)),
        *(Remove(one) for path in owners for one in (path, old(path))),
        Remove(manifest_path(name)),
        Run(("udevadm", "control", "--reload")),
        Run(("systemctl", "daemon-reload")),
    ]


def _interfaces(paths: Iterable[PurePosixPath]) -> list[str]:
    """Units of the interfaces whose environments are among these files."""
    return [f"canbase-can@{path.stem}.service" for path in paths if path == _can_env(path.stem)]


def _own(name: str, manifests: Mapping[str, str]) -> list[PurePosixPath]:
    """Files that belong to this robot and to no other one."""
    others = {path for other, text in manifests.items() if other != name for path in text.splitlines()}
    return [PurePosixPath(path) for path in manifests.get(name, "").splitlines() if path not in others]


def service(part: str, name: str) -> str:
    """Name of the unit of one part of one robot."""
    return f"canbase-{part}@{name}.service"


def manifest_path(name: str) -> PurePosixPath:
    """Where the files of one robot are listed."""
    return ETC / "installed" / f"{name}.txt"


def _check(request: Request) -> None:
    if not _NAME.fullmatch(request.name):
        raise InstallError(f"--name {request.name!r}: expected letters, digits and _, first a letter")
    if request.cpus and not _CPUS.fullmatch(request.cpus):
        raise InstallError(f"--cpus {request.cpus!r}: expected numbers and ranges, such as 2,3 or 4-7")
    bus, lease = request.robot.bus, PurePosixPath(request.robot.lease.socket)
    if bus.interface != "socketcan":
        raise InstallError(
            f"bus.interface is {bus.interface}: the services need socketcan; `canbase up` runs everything else"
        )
    if not _INTERFACE.fullmatch(bus.channel):
        raise InstallError(f"bus.channel is {bus.channel!r}: expected a CAN interface such as can0")
    if lease.parent not in (RUN, RUN / request.name):
        raise InstallError(
            f"lease.socket is {lease}: expected {RUN / request.name / 'lease.sock'}, a folder of canbase"
        )
    if request.adapter and not _ADAPTER.fullmatch(request.adapter):
        raise InstallError(
            f"--adapter {request.adapter}: expected a udev property such as ID_PATH=pci-0000:00:14.0-usb"
        )
    relay = request.robot.watchdog.relay
    if relay is not None and (wrong := wrong_chip(relay.chip)):
        raise InstallError(wrong)


def _check_namespace(request: Request) -> None:
    if request.namespace and request.kept and namespace(request.kept) != request.namespace:
        raise InstallError(
            f"--namespace {request.namespace}: {owner_paths(request.name)[1]} is kept and has the namespace "
            f"{namespace(request.kept)}: set CANBASE_OPTIONS=--namespace {request.namespace} there"
        )


def _check_places(request: Request, manifests: Mapping[str, str]) -> None:
    """No robot's robot.yaml takes the place of a file that robot.yaml names, nor the other way."""
    robots = {owner_paths(name)[0] for name in (request.name, *manifests)}
    for reference in request.files:
        if wrong := misplaced(reference):
            raise InstallError(wrong)
        if place(reference) in robots:
            raise InstallError(
                f"{place(reference)} is a robot: expected another name for its file {reference}; rename it"
            )
    for name, text in manifests.items():
        if str(owner_paths(request.name)[0]) in text.splitlines():
            raise InstallError(
                f"{request.name}.yaml is a file of the robot {name}: this one needs another name, --name"
            )


def _files(request: Request) -> list[WriteFile | Link]:
    return [
        *(_shared(part, HARDENING) for part in (*PARTS, METRICS)),
        *(_shared(part, COMMON) for part in PARTS),
        *(_unit(name, text, request.python) for name, text in sorted(request.templates.items(), key=_drop_ins_first)),
        MODES,
        *_of_the_owner(request),
        *_can(request),
        *_tuning(request),
        Link(UNITS / "multi-user.target.wants" / f"canbase@{request.name}.target", "../canbase@.target"),
    ]


def _shared(part: str, file: str) -> Link:
    return Link(UNITS / f"canbase-{part}@.service.d" / file.replace("canbase", "00"), f"../{file}")


def _drop_ins_first(template: tuple[str, str]) -> tuple[bool, str]:
    """An installation that is cut off leaves no unit without its sandbox."""
    return template[0] not in (HARDENING, COMMON), template[0]


def _unit(name: str, text: str, python: str) -> WriteFile:
    return WriteFile(UNITS / name, text.replace(_PYTHON, python))


def _of_the_owner(request: Request) -> list[WriteFile]:
    yaml_path, env_path = owner_paths(request.name)
    env = "# Environment of the services of this robot. Kept by upgrades.\n"
    env += "".join(f"{key}={value}\n" for key, value in _environment_values(request).items())
    env += "# CANBASE_OPTIONS=--namespace robot1\n# CANBASE_ROS_ARGS=-r scan:=front/scan\n"
    files = [WriteFile(env_path, env, 0o640, USER, Existing.KEEP)]
    for reference, text in request.files.items():
        files.append(WriteFile(place(reference), text, 0o640, USER, Existing.BACK_UP))
    if request.yaml is not None:
        files.append(WriteFile(yaml_path, request.yaml, 0o640, USER, Existing.BACK_UP))
    return files


def _environment_values(request: Request) -> dict[str, str]:
    """Of a new environment file; the domain is said aloud even where nobody has chosen one."""
    reach = "LOCALHOST" if request.network == "localhost" else "SUBNET"
    options = {"CANBASE_OPTIONS": f"--namespace {request.namespace}"} if request.namespace else {}
    return {REACH: reach, "ROS_DOMAIN_ID": DOMAIN, **request.environment, **options}


def _modes_of(name: str, named: Iterable[PurePosixPath]) -> list[WriteFile]:
    """Of the files that robot.yaml names: they may lie in folders of their own."""
    text = modes(named)
    return [WriteFile(PurePosixPath(f"/etc/tmpfiles.d/canbase-{name}.conf"), text)] if text else []


def _can_env(interface: str) -> PurePosixPath:
    return ETC / "can" / f"{interface}.env"


def _can(request: Request) -> list[WriteFile | Link]:
    """The interface, and who waits for it. Unplugged, the watchdog ends by itself, and its next start waits for the
    adapter. It is not bound to the device (BindsTo=): plugged in again while it still stops, nobody would start it."""
    interface, name = request.robot.bus.channel, request.name
    device = f"sys-subsystem-net-devices-{interface}.device"
    unit = f"canbase-can@{interface}.service" if request.bring_up_can else device
    waits = f"[Unit]\nWants={unit}\nAfter={unit}\n"
    files: list[WriteFile | Link] = [_drop_in(part, name, "10-can", waits) for part in ON_THE_BUS]
    if request.bring_up_can:
        files.append(Link(UNITS / f"{device}.wants" / unit, "../canbase-can@.service"))
        env = f"BITRATE={request.robot.bus.bitrate}\nRESTART_MS=100\nTXQUEUELEN=64\n"
        files.append(WriteFile(_can_env(interface), env))
    if request.adapter:
        link = f"[Match]\nType=can\nProperty={request.adapter}\n\n[Link]\nName={interface}\n"
        files.append(WriteFile(PurePosixPath(f"/etc/systemd/network/70-canbase-{interface}.link"), link))
    return files


def _tuning(request: Request) -> list[WriteFile]:
    files: list[WriteFile] = []
    if request.sourced:
        files += [_drop_in(part, request.name, "05-ros", _environment(request.sourced)) for part in (*PARTS, METRICS)]
    if request.network == "lan":
        text = f"[Unit]\nWants={ONLINE}\nAfter={ONLINE}\n\n[Service]\nIPAddressAllow=any\n"
        files += [_drop_in(part, request.name, "20-lan", text) for part in (*WITH_ROS, METRICS)]
    if request.cpus:
        text = f"[Service]\nCPUAffinity={request.cpus}\n"
        files += [_drop_in(part, request.name, "30-cpus", text) for part in PARTS]
    if request.sros2:
        files += [_drop_in(part, request.name, "50-sros2", _enclave(part)) for part in SERVICES]
    relay = request.robot.watchdog.relay
    if relay is not None:
        files.append(_drop_in("watchdog", request.name, "40-relay", drop_in_text(relay.chip)))
        files.append(udev_rule(request.name, relay.chip, USER))
    if request.hardware_watchdog_s:
        text = f"[Manager]\nRuntimeWatchdogSec={request.hardware_watchdog_s}s\n"
        files.append(WriteFile(PurePosixPath("/etc/systemd/system.conf.d/canbase.conf"), text))
    return files


def _environment(values: Mapping[str, str]) -> str:
    """In a drop-in, not among the owner's: an upgrade that moves ROS 2 or the workspace has to move it too."""
    escaped = {
        name: value.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%") for name, value in values.items()
    }
    return "[Service]\n" + "".join(f'Environment="{name}={value}"\n' for name, value in escaped.items())


def _enclave(part: str) -> str:
    """Each part has the enclave that deploy/sros2/policy.xml gives it."""
    strict = f"ROS_SECURITY_ENABLE=true ROS_SECURITY_STRATEGY=Enforce ROS_SECURITY_KEYSTORE={KEYS}"
    enclave = f"/canbase/{SERVICES[part]}"
    return f'[Service]\nEnvironment={strict}\nEnvironment="CANBASE_ENCLAVE=--enclave {enclave}"\n{view(part)}'


def _drop_in(part: str, name: str, file: str, text: str) -> WriteFile:
    return WriteFile(UNITS / f"{service(part, name)}.d" / f"{file}.conf", text)
