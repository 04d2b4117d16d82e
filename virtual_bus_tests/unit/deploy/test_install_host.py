"""What `canbase setup install` finds out about the machine: ROS 2, and whether the services would start with this
Python."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from canbase_deploy import host
from canbase_deploy.host import HIDDEN, chosen, rehearse, sourced
from canbase_deploy.plan import InstallError


def fake_python(folder: Path, text: str) -> str:
    """A program in the place of Python that is asked what the services import."""
    folder.mkdir(parents=True)
    program = folder / "python3"
    program.write_text(f"#!/bin/sh\n{text}\n")
    program.chmod(0o755)
    return str(program)


def test_services_that_would_not_start_are_not_installed(tmp_path: Path) -> None:
    python = fake_python(
        tmp_path / "bin", "echo 'Traceback' >&2; echo \"ImportError: librcl.so of $LD_LIBRARY_PATH\" >&2; exit 1"
    )

    with pytest.raises(InstallError, match=r"librcl.so of /opt/ros/lib.*sudo bash -c 'source") as error:
        rehearse(python, {"LD_LIBRARY_PATH": "/opt/ros/lib"})

    assert "Traceback" not in str(error.value)


def test_the_rehearsal_has_the_services_environment_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", "/home/me/ws")
    python = fake_python(tmp_path / "bin", 'echo "it was: $PYTHONPATH" >&2; exit 1')

    with pytest.raises(InstallError, match=r"it was:\. "):
        rehearse(python, {})


@pytest.mark.parametrize("hidden", HIDDEN)
def test_what_the_units_cannot_see_is_refused(monkeypatch: pytest.MonkeyPatch, hidden: str) -> None:
    answer = subprocess.CompletedProcess(
        [], 0, stdout=f"/opt/canbase/x.py\n{hidden}me/ws/canbase_cli/__init__.py\n", stderr=""
    )
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: answer)

    with pytest.raises(InstallError, match=f"do not see {hidden}me/ws/canbase_cli"):
        rehearse("/opt/canbase/bin/python", {})


def test_what_they_see_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = subprocess.CompletedProcess([], 0, stdout="/opt/canbase/x.py\n/usr/lib/y.py\n/usr/\n", stderr="")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: answer)

    rehearse("/opt/canbase/bin/python", {})


def test_this_python_has_all_that_the_services_import(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host, "HIDDEN", ("/nowhere/",))  # a checkout may be below /home

    rehearse(sys.executable, {})


def test_a_python_that_is_not_there_is_named() -> None:
    with pytest.raises(InstallError, match="--python /opt/no/python"):
        rehearse("/opt/no/python", {})


def test_one_that_does_not_answer_is_named_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host, "REHEARSAL_S", 0.05)
    python = fake_python(tmp_path / "bin", "exec sleep 5")

    with pytest.raises(InstallError, match="timed out"):
        rehearse(python, {})


def test_only_what_finds_ros_is_taken_from_a_sourced_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = {
        "PYTHONPATH": "/opt/ros",
        "ROS_DISTRO": "jazzy",
        "ROS_DOMAIN_ID": "5",
        "HOME": "/root",
        "LD_LIBRARY_PATH": "",
    }
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    assert sourced(seen) == {"PYTHONPATH": "/opt/ros", "ROS_DISTRO": "jazzy"}
    assert chosen(seen) == {"ROS_DOMAIN_ID": "5"}
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: object())
    assert sourced(seen) == {}
