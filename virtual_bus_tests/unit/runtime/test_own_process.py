"""A signal goes to a process of canbase of this user alone, whatever another process says that it is."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_base.single_instance import bus_name, take
from canbase_cli.main import app
from canbase_config.load import load_robot, sample
from canbase_runtime.own_process import NotOursError, refusal, send_signal

ME = os.geteuid()


def process(proc: Path, pid: int, executable: str, words: str) -> None:
    folder = proc / str(pid)
    folder.mkdir()
    (folder / "exe").symlink_to(executable)
    (folder / "cmdline").write_bytes(words.replace(" ", "\0").encode())


def test_a_process_is_ours_by_user_executable_and_command(tmp_path: Path) -> None:
    process(tmp_path, 1, "/usr/bin/python3.11", "python -m canbase_cli driver")
    process(tmp_path, 2, "/usr/bin/bash", "python -m canbase_cli driver")
    process(tmp_path, 3, "/usr/bin/python3", "python -m http.server")
    assert refusal(1, (ME,), tmp_path) == ""
    assert refusal(1, (ME + 1,), tmp_path) == f"process 1 belongs to user {ME}"
    assert refusal(2, (ME,), tmp_path) == "process 2 does not run Python"
    assert refusal(3, (ME,), tmp_path) == "process 3 does not run canbase"
    assert refusal(4, (ME,), tmp_path) == "process 4 cannot be checked: No such file or directory"


def test_a_stranger_gets_no_signal_and_a_process_of_canbase_does() -> None:
    wait = "import time; time.sleep(60)"
    stranger = subprocess.Popen([sys.executable, "-c", wait])
    ours = subprocess.Popen([sys.executable, "-c", wait, "canbase_driver.main"])
    try:
        with pytest.raises(NotOursError, match=f"process {stranger.pid} does not run canbase"):
            send_signal(stranger.pid, signal.SIGTERM)
        send_signal(ours.pid, signal.SIGTERM)
        assert ours.wait(10.0) == -signal.SIGTERM
        assert stranger.poll() is None
        with pytest.raises(ProcessLookupError):
            send_signal(ours.pid, signal.SIGTERM)
    finally:
        stranger.kill()
        stranger.wait()
        ours.kill()
        ours.wait()


def test_inject_refuses_a_process_that_only_holds_the_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever binds the socket of the driver first would get its signal: here this test run itself."""
    file = tmp_path / "robot.yaml"
    file.write_text(sample("bench").read_text().replace("port: 43113", "port: 43199"))
    monkeypatch.setattr("canbase_runtime.own_process.refusal", lambda pid, _: f"process {pid} does not run canbase")
    with take("driver", bus_name(load_robot(file).robot.bus.arguments())):
        done = CliRunner().invoke(app, ["inject", "driver", "kill", "-c", str(file)])
    assert done.exit_code == 1
    assert f"driver of bench gets no signal: process {os.getpid()} does not run canbase" in done.output
