"""What `canbase` and its processes import where somebody has put files into the current folder. With real processes."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from canbase_cli import forget_current_folder
from canbase_cli.stack import Stack
from canbase_config.load import sample
from canbase_runtime.own_modules import module_command
from support.bus_tool import write_robot
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus

ROOT = Path(__file__).parents[2]
CONSOLE_SCRIPT = Path(sys.executable).with_name("canbase")
PLANTED = ("difflib", "typer", "can", "msgpack", "pydantic", "ruamel", "canbase_config", "canbase_watchdog", "pip")
"""Names that canbase or its libraries import; `pip/__main__.py` is what `python -m pip` would run."""


@pytest.fixture
def trap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, in which every import leaves its name in the file `caught`."""
    for name in PLANTED:
        package = tmp_path / name
        package.mkdir()
        for file in ("__init__.py", "__main__.py"):
            (package / file).write_text(f"open({str(tmp_path / 'caught')!r}, 'a').write(__file__ + '\\n')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    return tmp_path


def run(*argv: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(argv, env=os.environ | environment, capture_output=True, text=True, timeout=60, check=False)


def caught(trap: Path) -> str:
    file = trap / "caught"
    return file.read_text() if file.exists() else ""


def test_the_trap_closes_on_an_ordinary_start(trap: Path) -> None:
    run(sys.executable, "-c", "import difflib")

    assert caught(trap) == f"{trap}/difflib/__init__.py\n"


@pytest.mark.parametrize("command", [[CONSOLE_SCRIPT], [sys.executable, "-m", "canbase_cli"]])
def test_the_command_itself_imports_nothing_from_the_current_folder(trap: Path, command: list[str]) -> None:
    done = run(*command, "config", "check", sample("bench"))

    assert (done.returncode, caught(trap)) == (0, ""), done.stderr


@pytest.mark.parametrize("version", [(3, 10), (3, 11)])
def test_neither_do_its_processes_whatever_the_python(trap: Path, version: tuple[int, int]) -> None:
    if sys.version_info < version:
        pytest.skip("NOT CHECKED: this Python has no -P")
    done = run(*module_command("canbase_cli", "config", "check", str(sample("bench")), version=version))

    assert (done.returncode, caught(trap)) == (0, ""), done.stderr
    assert done.stdout.strip()


def test_an_empty_entry_of_the_search_path_is_not_the_current_folder(trap: Path) -> None:
    """Of `export PYTHONPATH=$PYTHONPATH:/my/folder` where nothing was in it before."""
    done = run(sys.executable, "-m", "canbase_cli", "config", "check", str(sample("bench")), PYTHONPATH=":/nowhere")

    assert (done.returncode, caught(trap)) == (0, ""), done.stderr


@pytest.mark.parametrize("python_path", [":", ":/nowhere", "/nowhere:", ".", "/nowhere::/nowhere2"])
def test_neither_is_one_anywhere_in_it_nor_a_relative_one(trap: Path, python_path: str) -> None:
    path, environment = ["/opt/lib", str(trap)], {"PYTHONPATH": python_path}

    forget_current_folder(path, ["/opt/bin/canbase"], environment)

    assert path == ["/opt/lib"]
    assert environment["PYTHONPATH"] == python_path.strip(":.").replace("::", ":")


def test_a_part_of_the_stack_and_what_it_becomes_import_nothing_from_there(trap: Path) -> None:
    """The watchdog starts as `canbase_cli.child` and becomes `canbase_watchdog`; it says so when its bus is open."""
    stack = Stack(write_robot(trap, free_udp_port()), sim=True, logs=trap)
    stack._parts = ["sim", "watchdog"]  # those without ROS
    with stack:
        limit = time.monotonic() + 60.0
        while "watch" not in stack.log("watchdog").lower() and stack.death() is None and time.monotonic() < limit:
            time.sleep(0.05)
        assert stack.death() is None, stack.log("watchdog") + stack.log("sim")

    assert caught(trap) == ""


def test_the_support_bundle_asks_no_pip_and_no_canbase_of_the_current_folder(trap: Path) -> None:
    done = run(
        CONSOLE_SCRIPT,
        "support-bundle",
        "--config",
        write_robot(trap, free_udp_port()),
        "--since",
        "-1s",
        "-o",
        trap / "b.tar.gz",
    )

    assert (done.returncode, caught(trap)) == (0, ""), done.stderr


def test_the_services_have_a_safe_path_and_a_folder_that_is_roots() -> None:
    for file in ("canbase-common.conf", "canbase-metrics@.service"):
        unit = (ROOT / "deploy" / "systemd" / file).read_text().splitlines()
        assert "WorkingDirectory=/" in unit
        assert any(
            line.startswith("Environment=") and {"PYTHONSAFEPATH=1", "PYTHONNOUSERSITE=1"} <= set(line.split())
            for line in unit
        )


def test_without_a_safe_path_the_current_folder_is_taken_out_and_nothing_else() -> None:
    path, environment = ["/here", "/opt/lib"], {"PYTHONPATH": "/opt/lib"}

    forget_current_folder(path, ["/opt/bin/canbase"], environment)
    assert path == ["/here", "/opt/lib"]  # of a console script the first entry is its own folder

    forget_current_folder(path, ["-m", "demo"], environment)
    assert (path, environment) == (["/opt/lib"], {"PYTHONPATH": "/opt/lib"})
