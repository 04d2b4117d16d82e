"""`canbase prove qualify` with its real processes: killed, broken off, resumed, and in parts."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from canbase_config.load import sample
from canbase_qualification.results_file import read
from support.command_world import canbase

pytestmark = [pytest.mark.bus, pytest.mark.timeout(600)]
FEW = ("--seed", "24", "--scenarios", "2", "--stops", "0", "--drives", "0")
"""Two bodies: seed 24 has another one than 25."""
BATCHES_S = 240.0


def command(folder: Path, *arguments: str, file: Path | None = None) -> list[str]:
    robot = str(file or sample("bench"))
    return [sys.executable, "-m", "canbase_cli", "prove", "qualify", robot, "--out", str(folder), *arguments]


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(folder, *arguments), capture_output=True, text=True, timeout=BATCHES_S)


def results(folder: Path) -> bytes:
    return (folder / "results.jsonl").read_bytes()


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """FEW by one worker."""
    folder = tmp_path_factory.mktemp("few")
    done = run(folder, *FEW, "--workers", "1")
    assert done.returncode == 0, done.stderr
    assert "Every property held in every run" in done.stdout
    return folder


def wait_for(what: str, condition: object, seconds: float = BATCHES_S) -> None:
    end = time.monotonic() + seconds
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end, what
        time.sleep(0.05)


def children(pid: int, module: str) -> list[int]:
    """Processes of a module below this one."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            status, line = (entry / "status").read_text(), (entry / "cmdline").read_text()
        except OSError:
            continue
        parent = int(next(row.split()[1] for row in status.splitlines() if row.startswith("PPid:")))
        if parent == pid and module in line:
            found.append(int(entry.name))
    return found


def test_the_folder_has_what_was_run_and_assumed(few: Path) -> None:
    about = json.loads((few / "qualification.json").read_text())
    assert about["amount"] == {"scenarios": 2, "stops": 0, "drives": 0, "first": 24}
    assert about["full_mps"] == 0.8
    assert any("no scanner is required" in sentence for sentence in about["not_judged"])
    assert (few / "robot.yaml").read_bytes() == sample("bench").read_bytes()
    assert [outcome.seed for outcome in read(few / "results.jsonl")] == [24, 25]


def test_any_number_of_workers_gives_the_same_file_also_when_one_is_killed(few: Path, tmp_path: Path) -> None:
    qualify = subprocess.Popen(command(tmp_path / "q", *FEW, "--workers", "2"), stdout=subprocess.DEVNULL)
    worker: list[int] = []

    def runs_one() -> bool:
        worker[:] = children(qualify.pid, "canbase_qualification.carry_out")
        return len(worker) == 2

    wait_for("two workers", runs_one)
    os.kill(worker[0], signal.SIGKILL)
    assert qualify.wait(BATCHES_S) == 0
    assert results(tmp_path / "q") == results(few)


def test_ctrl_c_keeps_what_is_done_and_resume_goes_on_as_if_nothing_had_been(few: Path, tmp_path: Path) -> None:
    folder = tmp_path / "q"
    begun = subprocess.Popen(
        command(folder, *FEW, "--workers", "1"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    wait_for("a result", lambda: (folder / "results.jsonl").exists() and results(folder))
    begun.send_signal(signal.SIGINT)
    out, err = begun.communicate(timeout=30)
    assert begun.returncode == 130, err
    assert "1 scenarios" in out
    assert "--resume goes on" in err
    assert children(begun.pid, "carry_out") == []
    with (folder / "results.jsonl").open("ab") as file:
        file.write(b'{"kind": "scen')  # as a computer leaves it that lost its power
    again = run(folder, "--resume", "--workers", "1")
    assert again.returncode == 0, again.stderr
    assert results(folder) == results(few)


def test_parts_of_several_computers_become_the_same_file(few: Path, tmp_path: Path) -> None:
    for name, seed in (("part1", "24"), ("part2", "25")):
        words = ("--seed", seed, "--scenarios", "1", "--stops", "0", "--drives", "0")
        assert run(tmp_path / name, *words).returncode == 0
    with (tmp_path / "part1" / "results.jsonl").open("ab") as file:
        file.write(results(tmp_path / "part2"))
    merged = run(tmp_path / "part1", "--scenarios", "2", "--resume")
    assert merged.returncode == 0, merged.stderr
    assert results(tmp_path / "part1") == results(few)


def test_resume_refuses_another_load_and_another_robot(few: Path, tmp_path: Path) -> None:
    other = tmp_path / "robot.yaml"
    other.write_text(sample("bench").read_text().replace("linear_mps: 0.8", "linear_mps: 0.7"))
    before = results(few)
    for arguments, file, words in (
        (("--slope", "0.05"), None, "has --payload 0.5..2 --slope 0.03; now it is --payload 0.5..2 --slope 0.05"),
        ((), other, "is about another configuration"),
    ):
        refused = canbase(*command(few, "--resume", *arguments, file=file)[3:])
        assert refused.exit_code == 2
        assert words in refused.stderr
    assert results(few) == before
