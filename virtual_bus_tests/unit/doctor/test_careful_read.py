"""The support bundle, as root, reads out of folders in which the services write: what it takes, and what never."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tarfile
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_base.latch_file import LatchFile, create_first
from canbase_base.latch_folder import machine
from canbase_base.latch_record import Mark, Record
from canbase_cli.main import app
from canbase_config.load import load_robot, sample
from canbase_doctor import support_bundle as module
from canbase_doctor.bounded_run import run
from canbase_doctor.bundle_contents import Command
from canbase_doctor.careful_read import RefusedError, modified, names, read_end
from canbase_doctor.support_bundle import Bundle, collect

ROBOT = load_robot(sample("bench")).robot


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of recordings with everything in it that a service may lay there, beside one recording."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "nowhere"))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    monkeypatch.setattr("canbase_doctor.bundle_contents.commands", lambda *_: ())
    folder = tmp_path / "state"
    folder.mkdir()
    (tmp_path / "shadow").write_text("root:$6$hash\n")
    (tmp_path / "other").write_text("another file of root\n")
    os.mkfifo(folder / "stop_bench_1.asc")
    (folder / "stop_bench_2.asc").symlink_to(tmp_path / "shadow")
    (folder / "stop_bench_3.asc").symlink_to("/dev/zero")
    (folder / "stop_bench_4.asc").hardlink_to(tmp_path / "other")
    (folder / "stop_bench_5.asc").write_text("date\n")
    (folder / "stop_bench_6.asc").mkdir()
    return folder


def test_of_a_folder_of_the_services_only_ordinary_files_are_taken_and_nothing_hangs(
    state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("canbase_doctor.bundle_contents.BOXES", 10)

    bundle = collect(ROBOT, state / "none.yaml", "-1h", state / "etc", state)

    assert [name for name in bundle.files if name.startswith("black_box")] == ["black_box/stop_bench_5.asc"]
    assert b"$6$" not in b"".join(bundle.files.values())
    why = {number: bundle.missing[f"black_box/stop_bench_{number}.asc"] for number in (1, 2, 3, 4, 6)}
    assert why[1].endswith("it is no regular file")  # a FIFO: opened to be read it would wait for a writer
    assert why[2].endswith("it is a link; links are not followed")
    assert why[3].endswith("it is a link; links are not followed")
    assert why[4].endswith("it has another name too (hard link)")
    assert why[6].endswith("it is no regular file")


def test_a_socket_is_refused_too(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(str(tmp_path / "s"))
        with pytest.raises(RefusedError, match="no regular file"):
            read_end(tmp_path / "s", 10)


@pytest.fixture
def linked(tmp_path: Path) -> Path:
    """/var/lib may be a link of root; a folder that a service replaced by a link is none."""
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "a.asc").write_text("date\n")
    (tmp_path / "way").symlink_to("real")
    (tmp_path / "far").symlink_to(tmp_path / "way")
    return tmp_path


def test_a_link_on_the_way_counts_when_root_or_the_caller_made_it(linked: Path) -> None:
    assert read_end(linked / "far" / "a.asc", 100) == (str(linked / "real" / "a.asc"), b"date\n")
    assert names(linked / "far") == ["a.asc"]


@pytest.mark.needs_root("give a link to another user")
def test_a_link_of_a_service_on_the_way_is_refused(linked: Path) -> None:
    os.chown(linked / "way", 54321, 54321, follow_symlinks=False)
    for read in (lambda path: read_end(path, 100), modified, lambda path: names(path.parent)):
        with pytest.raises(RefusedError, match="way is a link of the user 54321"):
            read(linked / "far" / "a.asc")


def test_a_link_of_root_into_the_keys_opens_nothing(tmp_path: Path) -> None:
    (tmp_path / "keys").mkdir()
    (tmp_path / "keys" / "policy.yaml").write_text("a: 1\n")
    (tmp_path / "harmless").symlink_to("keys")
    bundle = Bundle()

    bundle.file("x", tmp_path / "harmless" / "policy.yaml", str)

    assert bundle.missing["x"].endswith("it may be a key; such files are never taken")


def test_a_loop_of_links_ends(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")

    with pytest.raises(OSError, match="link"):
        read_end(tmp_path / "a" / "x", 1)


def test_of_a_long_file_the_end_is_taken(tmp_path: Path) -> None:
    (tmp_path / "long").write_bytes(b"a" * 1000 + b"end")

    assert read_end(tmp_path / "long", 5)[1] == b"aaend"


def test_a_full_bundle_says_what_it_leaves_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_FILES", 3)
    bundle = Bundle()
    for number in range(5):
        bundle.text(str(number), "text", lambda: "text")
    assert (sorted(bundle.files), sorted(bundle.missing)) == (["0", "1", "2"], ["3", "4"])

    monkeypatch.setattr(module, "TOTAL_BYTES", 10)
    bundle = Bundle()
    for number in range(5):
        bundle.text(str(number), "text", lambda: "12345678")
    assert (sorted(bundle.files), "full" in bundle.missing["4"]) == (["0", "1"], True)


def test_of_a_program_that_prints_without_end_the_last_is_kept() -> None:
    code = "import sys; sys.stdout.write('x' * 5_000_000 + 'end'); sys.stderr.write('y' * 1_000_000)"

    ended, said, complaint = run((sys.executable, "-c", code), None, 30.0, 1000)

    assert (ended, len(said), said[-4:], len(complaint)) == (0, 1000, "xend", 100_000)


def test_a_program_that_hangs_is_killed_with_all_that_it_has_started() -> None:
    """A child that keeps the output open would hold up the bundle."""
    begin = time.monotonic()
    with pytest.raises(subprocess.TimeoutExpired):
        run(("sh", "-c", "sleep 600 & sleep 600"), None, 0.3, 1000)

    assert time.monotonic() - begin < 60.0


@pytest.mark.parametrize("text", ["name: [", "nobody: knows\n", "", "\x00"])
def test_a_robot_yaml_with_mistakes_is_collected_with_them(
    state: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    """Just then the bundle is needed."""
    monkeypatch.setattr(
        "canbase_doctor.bundle_contents.commands", lambda *_: (Command("system/kernel.txt", ("uname", "-a")),)
    )
    monkeypatch.setattr(module, "ETC", tmp_path / "etc")
    monkeypatch.setattr(module, "STATE", state)
    config, output = tmp_path / "robot.yaml", tmp_path / "b.tar.gz"
    config.write_text(text)

    done = CliRunner().invoke(app, ["record", "bundle", "--config", str(config), "--output", str(output)])

    assert done.exit_code == 0, done.output
    assert f"{config} cannot be used; collected all the same:" in done.stderr
    with tarfile.open(output) as archive:
        problems = archive.extractfile("b/config/problems.txt")
        assert problems is not None
        assert "robot.yaml:" in problems.read().decode()
        assert {"b/config/robot.yaml", "b/system/kernel.txt"} <= set(archive.getnames())


def test_of_a_robot_without_a_name_all_recordings_count(state: Path) -> None:
    bundle = collect(None, state / "robot.yaml", "-1h", state / "etc", state, problems="broken")

    assert "black_box/stop_bench_5.asc" in bundle.files
    assert bundle.files["config/problems.txt"] == b"broken\n"


def test_the_records_of_stops_are_taken_in_words_and_name_no_computer(state: Path) -> None:
    folder = state / ROBOT.name
    create_first(folder, ROBOT.name)
    stop = Record(Mark.LATCHED, 7, "drive fault", "left_wheel: EMCY 2310h\x1b[2J, token=abcdef123456789")
    file = LatchFile(folder, "driver", ROBOT.name)
    file.open()
    file.write(stop)
    file.close()
    (folder / "velocity.latch").unlink()
    (folder / "velocity.latch").symlink_to("/etc/machine-id")

    bundle = collect(ROBOT, state / "none.yaml", "-1h", state / "etc", state)

    text = bundle.files["stops/installed/driver.txt"].decode()
    assert text.startswith("needs a reset: yes\nmark: LATCHED, code 7, written 3 times, last at 2")
    assert "cause: drive fault\ndetail: …\n" in text
    assert "\x1b" not in text
    assert "abcdef" not in text
    assert bundle.files["stops/installed/watchdog.txt"].startswith(b"needs a reset: no\nmark: CLEAR")
    assert bundle.missing["stops/installed/velocity.txt"].endswith("links are not followed")
    everything = b"".join(content for name, content in bundle.files.items() if name.startswith("stops/"))
    assert machine().encode() not in everything or not machine()


def test_a_robot_that_has_no_records_of_stops_is_said(state: Path) -> None:
    bundle = collect(ROBOT, state / "none.yaml", "-1h", state / "etc", state)
    assert bundle.missing["stops"].startswith(f"no record of stops of {ROBOT.name} in ")
