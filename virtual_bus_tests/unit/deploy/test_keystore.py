"""SROS2 keys on a robot: the authority's key is not there, and no service sees the key of another one."""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
import tarfile
from pathlib import Path, PurePosixPath

import pytest

from canbase_deploy import host
from canbase_deploy.actions import Link
from canbase_deploy.host import refuse_keystore
from canbase_deploy.keystore import KEYS, SERVICES, KeyFile, found_in, refusals, view
from canbase_deploy.plan import HARDENING, InstallError, install_plan
from support.install_plans import TEMPLATES, UNITS, request, texts

ROOT = Path(__file__).parents[3]
SCRIPT = ROOT / "deploy" / "sros2" / "part_of_keystore"
ENCLAVES = (*SERVICES.values(), "joystick", "navigation", "sensors", "operator")


@pytest.fixture
def keystore(tmp_path: Path) -> Path:
    """As `ros2 security generate_artifacts` of sros2 0.13 lays it out."""
    keys = tmp_path / "keys"
    for top in ("private", "public", "enclaves"):
        (keys / top).mkdir(parents=True)
    (keys / "private" / "ca.key.pem").write_text("authority")
    (keys / "public" / "ca.cert.pem").write_text("certificate")
    for name in ("identity_ca", "permissions_ca"):
        (keys / "private" / f"{name}.key.pem").symlink_to("ca.key.pem")
        (keys / "public" / f"{name}.cert.pem").symlink_to("ca.cert.pem")
    for name in ("governance.p7s", "governance.xml"):
        (keys / "enclaves" / name).write_text(name)
    for enclave in ENCLAVES:
        folder = keys / "enclaves" / "canbase" / enclave
        folder.mkdir(parents=True)
        for name in ("cert.pem", "key.pem", "permissions.p7s", "permissions.xml"):
            (folder / name).write_text(f"{enclave} {name}")
        (folder / "governance.p7s").symlink_to("../../governance.p7s")
        for name in ("identity_ca", "permissions_ca"):
            (folder / f"{name}.cert.pem").symlink_to(f"../../../public/{name}.cert.pem")
    return keys


def pack(keystore: Path, out: Path, *enclaves: str) -> subprocess.CompletedProcess[str]:
    words = [str(SCRIPT), str(keystore), str(out), *enclaves]
    return subprocess.run(words, capture_output=True, text=True, timeout=30, check=False)


def unpacked(keystore: Path, *enclaves: str) -> Path:
    out, folder = keystore.parent / "part.tar.gz", keystore.parent / "robot"
    assert pack(keystore, out, *enclaves).returncode == 0
    folder.mkdir()
    with tarfile.open(out) as archive:
        archive.extractall(folder)
    return folder


def test_the_part_of_a_robot_has_its_enclaves_and_no_key_of_the_authority(keystore: Path) -> None:
    robot = unpacked(keystore, *SERVICES.values())

    keys = {path.parent.name for path in robot.rglob("key.pem")}
    assert keys == set(SERVICES.values())
    assert list(robot.rglob("*ca.key.pem")) == []
    assert not (robot / "private").exists()
    assert "authority" not in {path.read_text() for path in robot.rglob("*") if path.is_file()}
    driver = robot / "enclaves/canbase/driver"
    assert (driver / "governance.p7s").read_text() == "governance.p7s"
    assert (driver / "identity_ca.cert.pem").read_text() == "certificate"


def test_the_part_is_for_its_owner_alone(keystore: Path) -> None:
    out = keystore.parent / "part.tar.gz"
    pack(keystore, out, "joystick")

    assert stat.S_IMODE(out.stat().st_mode) == 0o600
    with tarfile.open(out) as archive:
        assert all(not member.mode & 0o077 for member in archive if not member.issym())
        assert {member.uid for member in archive} == {0}
        assert not any("driver" in member.name or "private" in member.name for member in archive)


@pytest.mark.parametrize("enclaves", [(), ("nobody",), ("../../private",), ("driver", ""), ("driver/..",), ("--help",)])
def test_what_is_no_enclave_is_packed_by_nobody(keystore: Path, enclaves: tuple[str, ...]) -> None:
    out = keystore.parent / "part.tar.gz"

    done = pack(keystore, out, *enclaves)

    assert (done.returncode, out.exists()) == (2, False)
    assert done.stderr


@pytest.fixture
def robot(keystore: Path) -> Path:
    """What the commands of docs/security.md leave on the robot, where whoever runs the test is root."""
    folder = unpacked(keystore, *SERVICES.values())
    for path in folder.rglob("*"):
        if not path.is_symlink():
            path.chmod(0o750 if path.is_dir() else 0o640)
    return folder


def seen(folder: Path) -> list[KeyFile]:
    return [KeyFile(file.path, file.mode, True) for file in found_in(folder)]


def test_that_part_can_be_used(robot: Path) -> None:
    assert refusals(seen(robot)) == []


@pytest.mark.parametrize(
    "name", ["private/ca.key.pem", "private/identity_ca.key.pem", "old/private/x", "enclaves/ca.key.pem"]
)
def test_a_key_of_the_authority_on_the_robot_is_refused(robot: Path, name: str) -> None:
    (robot / name).parent.mkdir(parents=True, exist_ok=True)
    (robot / name).write_text("authority")

    (wrong,) = refusals(seen(robot))

    assert wrong.startswith(f"/etc/canbase/keys/{name}: the authority's key signs anything")


@pytest.mark.parametrize("mode", [0o644, 0o641, 0o660, 0o646])
def test_a_key_that_more_may_read_or_write_is_refused(robot: Path, mode: int) -> None:
    (robot / "enclaves/canbase/driver/key.pem").chmod(mode)

    (wrong,) = refusals(seen(robot))

    assert "sudo chmod 640 /etc/canbase/keys/enclaves/canbase/driver/key.pem" in wrong


def test_a_key_of_another_owner_is_refused(robot: Path) -> None:
    files = [KeyFile(file.path, file.mode, file.path.parent.name != "velocity") for file in found_in(robot)]

    (wrong,) = refusals(files)

    assert "enclaves/canbase/velocity/key.pem: expected root, group canbase" in wrong


def test_a_key_of_a_process_of_another_user_is_refused(robot: Path, keystore: Path) -> None:
    shutil.copytree(keystore / "enclaves/canbase/joystick", robot / "enclaves/canbase/joystick", symlinks=True)

    (wrong,) = refusals(seen(robot))

    assert "joystick/key.pem: no service has this enclave" in wrong


def test_a_missing_enclave_is_refused_before_a_service_does_not_start(robot: Path) -> None:
    shutil.rmtree(robot / "enclaves/canbase/velocity")

    (wrong,) = refusals(seen(robot))

    assert wrong.startswith("/etc/canbase/keys/enclaves/canbase/velocity/key.pem is missing")
    assert len(refusals([])) == len(SERVICES)


def test_the_installer_refuses_it(keystore: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host, "KEYS", PurePosixPath(keystore))

    with pytest.raises(InstallError, match=r"--sros2:\n.*ca\.key\.pem: the authority's key"):
        refuse_keystore()


def test_a_service_sees_its_own_enclave_alone() -> None:
    for part, enclave in SERVICES.items():
        again, empty, shown = view(part).splitlines()
        assert again == "InaccessiblePaths="
        assert empty == f"TemporaryFileSystem={KEYS}:ro"
        words = shown.removeprefix("BindReadOnlyPaths=").split()
        assert [word for word in words if "/canbase/keys/enclaves/canbase" in word] == [
            f"{KEYS}/enclaves/canbase/{enclave}"
        ]
        assert f"{KEYS}/public" in words
        assert f"{KEYS}/enclaves" not in words


UNITS_THERE = sorted(path.name.partition("@")[0] for path in TEMPLATES.glob("canbase-*@.service"))


@pytest.mark.parametrize("unit", UNITS_THERE)
def test_every_unit_has_its_own_enclave_or_sees_no_key(unit: str) -> None:
    """By the unit files that are there: a new one is neither forgotten nor reads all keys."""
    files, part = texts(install_plan(request(sros2=True), {})), unit.removeprefix("canbase-")
    links = [str(action.path) for action in install_plan(request(), {}) if isinstance(action, Link)]
    template = files[f"{UNITS}/{unit}@.service"]
    sandbox = files[f"{UNITS}/{HARDENING}"] if f"{UNITS}/{unit}@.service.d/00-hardening.conf" in links else ""
    own = files.get(f"{UNITS}/{unit}@example.service.d/50-sros2.conf", "")
    lines = [line for text in (template, sandbox, own) for line in text.splitlines()]
    hidden = [line.partition("=")[2] for line in lines if line.startswith("InaccessiblePaths=")]

    assert ("--ros-args" in template) is (part in SERVICES)
    assert hidden[0] == f"-{KEYS}"
    if part not in SERVICES:
        assert (hidden[-1], own) == (f"-{KEYS}", "")
        return
    assert hidden[-1] == ""
    assert view(part) in own
    assert f'Environment="CANBASE_ENCLAVE=--enclave /canbase/{SERVICES[part]}"' in own
    assert f"ROS_SECURITY_ENABLE=true ROS_SECURITY_STRATEGY=Enforce ROS_SECURITY_KEYSTORE={KEYS}" in own
    assert "$CANBASE_ENCLAVE" in template
    assert f'path="/canbase/{SERVICES[part]}"' in SCRIPT.with_name("policy.xml").read_text()


def test_every_process_with_a_key_is_closed_to_others_of_its_user() -> None:
    mains = {"driver": "driver/canbase_driver/runtime", "velocity": "velocity_mux/canbase_velocity",
             "action-server": "action_server/canbase_action_server", "metrics": "fleet/canbase_fleet"}  # fmt: skip
    assert set(mains) == set(SERVICES)
    for folder in mains.values():
        assert "    guard_keys(os.environ)\n" in (ROOT / folder / "main.py").read_text()


def test_the_documentation_packs_the_keystore_that_is_taken(keystore: Path) -> None:
    text = (ROOT / "docs" / "security.md").read_text()
    (words,) = re.findall(r"part_of_keystore keys robot.tar.gz ([\w ]+)", text)

    assert set(words.split()) == set(SERVICES.values())
    assert [one for one in refusals(seen(unpacked(keystore, *words.split()))) if "is missing" in one] == []


def test_a_link_is_never_taken_for_a_key_that_is_in_order(robot: Path) -> None:
    key = robot / "enclaves/canbase/driver/key.pem"
    key.unlink()
    os.symlink("../velocity/key.pem", key)

    assert len(refusals(seen(robot))) == 1
