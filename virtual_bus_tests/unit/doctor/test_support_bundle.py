"""The support bundle: what is in it, what could not be had, and what must never be in it."""

from __future__ import annotations

import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from canbase_config.load import load_robot, sample
from canbase_doctor.bundle_contents import (
    BOXES,
    Command,
    allowed,
    commands,
    manifest,
    newest_boxes,
)
from canbase_doctor.support_bundle import Bundle, collect

ROBOT = load_robot(sample("bench")).robot
BOX = "stop_bench_20261124T210355.879Z_drive_silent"
KEY = "-----BEGIN EC PRIVATE KEY-----\nMHcCAQEE\n-----END EC PRIVATE KEY-----\n"


@pytest.mark.parametrize(
    "name",
    ["/etc/canbase/keys/a.yaml", "/x/keystore/p.xml", "/x/enclaves/y", "/x/key.pem", "/x/A.KEY", "/root/.ssh/config"],
)
def test_files_that_may_be_keys_are_not_allowed(name: str) -> None:
    assert not allowed(Path(name))


@pytest.mark.parametrize(
    "name", ["/etc/canbase/robot.yaml", "/var/lib/canbase/stop_bench_1.asc", "/home/monkeys/a.yaml"]
)
def test_ordinary_files_are_allowed(name: str) -> None:
    assert allowed(Path(name))


def test_the_newest_recordings_of_this_robot_are_taken() -> None:
    mine = {Path(f"/s/stop_bench_{n}.asc"): float(n) for n in range(BOXES + 3)}
    others = {Path("/s/stop_other_9.asc"): 99.0, Path("/s/stop_bench_99.txt"): 99.0}
    assert newest_boxes(ROBOT.name, mine | others) == [Path(f"/s/stop_bench_{n}.asc") for n in range(BOXES + 2, 2, -1)]


def test_the_manifest_begins_with_what_is_missing() -> None:
    text = manifest({"a.txt": "uname -a"}, {"b.txt": "ip: No such file"})
    assert text.index("b.txt: ip: No such file") < text.index("a.txt: uname -a")


@pytest.fixture
def quiet(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Of the programs only one that is everywhere; no recordings of whoever runs this."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "nowhere"))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    monkeypatch.setattr(
        "canbase_doctor.bundle_contents.commands", lambda *_: (Command("system/kernel.txt", ("uname", "-a")),)
    )


@pytest.mark.usefixtures("quiet")
def test_an_installed_robot_is_collected_without_its_keys(tmp_path: Path) -> None:
    etc, state = tmp_path / "etc", tmp_path / "state"
    for folder in (etc / "keys", etc / "installed", state):
        folder.mkdir(parents=True)
    (etc / "robot.yaml").write_text("name: bench\npassword: hunter2\n")
    (etc / "robot.env").write_text("CANBASE_OPTIONS=\n")
    (etc / "installed" / "robot.txt").write_text("")
    (etc / "installed" / "stolen.txt").write_text("")
    (etc / "keys" / "key.pem").write_text(KEY)
    (etc / "stolen.yaml").symlink_to(etc / "keys" / "key.pem")
    (state / f"{BOX}.asc").write_text("date\n")
    (state / f"{BOX}.json").write_text("{}\n")
    bundle = collect(ROBOT, etc / "robot.yaml", "-1h", etc, state)
    assert {"config/robot.yaml", "config/installed/robot.env", f"black_box/{BOX}.asc"} <= set(bundle.files)
    assert bundle.files[f"black_box/{BOX}.json"] == b"{}\n"
    everything = b"".join(bundle.files.values())
    assert b"hunter2" not in everything
    assert b"PRIVATE KEY" not in everything
    assert "links are not followed" in bundle.missing["config/installed/stolen.yaml"]


@pytest.mark.usefixtures("quiet")
def test_what_cannot_be_had_is_told_with_its_reason(tmp_path: Path) -> None:
    bundle = collect(ROBOT, tmp_path / "none.yaml", "-1h", tmp_path / "etc", tmp_path / "state")
    assert bundle.missing["config/robot.yaml"].endswith("No such file or directory")
    assert bundle.missing["config/installed"].endswith("nothing is installed")
    assert "no recording of a stop of bench" in bundle.missing["black_box"]
    assert "system/kernel.txt" in bundle.files


def test_programs_that_are_missing_hang_or_say_nothing_are_told() -> None:
    bundle = Bundle()
    bundle.output(Command("a", ("/nowhere/program",)))
    bundle.output(Command("b", (sys.executable, "-c", "import time; time.sleep(60)"), timeout_s=0.2))
    bundle.output(Command("c", (sys.executable, "-c", "raise SystemExit('no such unit')")))
    bundle.output(Command("d", (sys.executable, "-c", "print('half'); raise SystemExit(3)")))
    assert "No such file" in bundle.missing["a"]
    assert "not done within 0 s" in bundle.missing["b"]
    assert "exit code 1, no such unit" in bundle.missing["c"]
    assert bundle.taken["d"].endswith("(exit code 3)")


def test_the_archive_is_the_owners_alone_and_whole(tmp_path: Path) -> None:
    bundle, path = Bundle(), tmp_path / "b.tar.gz"
    bundle.text("x/y.txt", "why", lambda: "text")
    bundle.write(path)
    assert path.stat().st_mode & 0o777 == 0o600
    with tarfile.open(path) as archive:
        assert archive.getnames() == ["b/MANIFEST.txt", "b/x/y.txt"]
    assert list(tmp_path.iterdir()) == [path]


def test_units_journal_and_can_statistics_are_asked_for() -> None:
    asked = {command.file: " ".join(command.argv) for command in commands(Path("r.yaml"), "-1h")}
    assert "--unit=canbase*" in asked["journal/canbase.json"]
    assert "-statistics" in asked["can/interfaces.json"]
    assert asked["units/status.txt"].startswith("systemctl show")
    assert "doctor --config r.yaml" in asked["doctor.txt"]


def test_help_names_the_command() -> None:
    shown = subprocess.run([sys.executable, "-m", "canbase_cli", "record", "bundle", "--help"], capture_output=True)
    assert shown.returncode == 0
    assert b"--since" in shown.stdout
