"""The SROS2 keystore on the robot: what must not be in it, who may read it, and what each service sees of it.

Pure but for `found_in`. All services are one user, so modes cannot part them: each unit has a view of the folder in
which its own enclave is alone.
"""

from __future__ import annotations

import stat
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from canbase_deploy.owner import ETC

KEYS: Final = ETC / "keys"
SERVICES: Final = {
    "driver": "driver",
    "velocity": "velocity",
    "action-server": "action_server",
    "metrics": "metrics",
}
"""Enclaves of deploy/sros2/policy.xml by the units that have them. Other units see no key (canbase-hardening.conf)."""
_MADE: Final = "docs/security.md, Keys, makes the part of the keystore that a robot needs"


@dataclass(frozen=True, slots=True)
class KeyFile:
    """A file of the keystore, by its path in it; `mode` as of lstat."""

    path: PurePosixPath
    mode: int
    is_roots: bool


def found_in(folder: Path) -> list[KeyFile]:
    """Every file below `folder`; none where it is missing."""
    found = []
    for path in sorted(folder.rglob("*")):
        seen = path.lstat()
        if not stat.S_ISDIR(seen.st_mode):
            found.append(KeyFile(PurePosixPath(path.relative_to(folder)), seen.st_mode, seen.st_uid == 0))
    return found


def refusals(files: Iterable[KeyFile], keys: PurePosixPath = KEYS) -> list[str]:
    """What is wrong with the keystore of a robot, each with its cure; empty: it can be used."""
    files = list(files)
    wrong = [
        f"{keys / file.path}: the authority's key signs anything and has no place on a robot: move it off. {_MADE}"
        for file in files
        if _is_of_the_authority(file.path)
    ]
    for file in files:
        if file.path.name == "key.pem":
            wrong += _of_a_key(file, f"{keys / file.path}")
    there = {file.path for file in files}
    for enclave in SERVICES.values():
        key = PurePosixPath("enclaves", "canbase", enclave, "key.pem")
        if key not in there:
            wrong.append(f"{keys / key} is missing: the service would not start. {_MADE}")
    return wrong


def _is_of_the_authority(path: PurePosixPath) -> bool:
    return "private" in path.parts or path.name.endswith("ca.key.pem")


def _of_a_key(file: KeyFile, name: str) -> list[str]:
    if file.path.parent.name not in SERVICES.values():
        return [f"{name}: no service has this enclave; its process, another user, needs a keystore of its own. {_MADE}"]
    if not file.is_roots or file.mode & 0o037:
        return [
            f"{name}: expected root, group canbase, mode 0640: sudo chown root:canbase {name} && sudo chmod 640 {name}"
        ]
    return []


def view(part: str) -> str:
    """Lines of a unit's [Service] section: of the keystore this part sees its own enclave alone. The first takes back
    what the sandbox of all parts has: no keys."""
    shown = [f"{KEYS}/public", f"-{KEYS}/enclaves/governance.p7s", f"{KEYS}/enclaves/canbase/{SERVICES[part]}"]
    return f"InaccessiblePaths=\nTemporaryFileSystem={KEYS}:ro\nBindReadOnlyPaths={' '.join(shown)}\n"
