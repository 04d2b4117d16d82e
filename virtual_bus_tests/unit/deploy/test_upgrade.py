"""An upgrade to a version that cannot use what is installed: refused, with the key, before anything changes."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Annotated, Any

import pytest
from pydantic import Field, create_model
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config import load
from canbase_config.load import sample
from canbase_config.robot import Robot
from canbase_deploy.host import refuse_running
from canbase_deploy.plan import InstallError

EXAMPLE = sample("example_can0").read_text()
LOAD = "payload_kg: 30.0\n"


def install(root: Path, *options: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["setup", "install", "--prefix", str(root), *options])
    return done.exit_code, done.output


def robot_yaml(folder: Path, text: str) -> str:
    folder.mkdir(exist_ok=True)
    (folder / "robot.yaml").write_text(text)
    return str(folder / "robot.yaml")


def snapshot(root: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A root with the sample as `example`, by today's version."""
    root = tmp_path / "root"
    assert install(root, "--config", robot_yaml(tmp_path / "home", EXAMPLE))[0] == 0
    return root


@pytest.fixture
def new_version(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on robot.yaml needs a key more."""
    assert installed.is_dir()
    key: Any = (Annotated[float, Field(description="what the base carries at most")], ...)
    monkeypatch.setattr(load, "Robot", create_model("Robot", __base__=Robot, payload_kg=key))


@pytest.mark.usefixtures("new_version")
def test_a_new_required_key_is_named_with_the_way_to_write_it_and_nothing_changes(installed: Path) -> None:
    before = snapshot(installed)

    code, said = install(installed, "--name", "example")

    assert code == 2
    assert "payload_kg: missing" in said
    path = installed / "etc/canbase/example.yaml"
    assert f"{path} cannot be used: 1 problem" in said
    assert "Nothing was changed: what is installed goes on as it is." in said
    assert f"Write into a copy of {path} what is missing, then: sudo canbase setup install --config COPY" in said
    assert snapshot(installed) == before


@pytest.mark.usefixtures("new_version")
def test_with_the_key_the_upgrade_is_done_and_the_old_robot_is_kept_for_the_way_back(
    installed: Path, tmp_path: Path
) -> None:
    code, said = install(installed, "--config", robot_yaml(tmp_path / "home", EXAMPLE + LOAD))

    assert code == 0, said
    assert (installed / "etc/canbase/example.yaml").read_text().endswith(LOAD)
    assert (installed / "etc/canbase/example.yaml.old").read_text() == EXAMPLE


@pytest.mark.usefixtures("new_version")
def test_a_neighbour_without_the_key_is_named_too(installed: Path, tmp_path: Path) -> None:
    """The units are of both: the neighbour would not start any more."""
    before = snapshot(installed)
    text = EXAMPLE.replace("name: example", "name: second").replace("can0", "can1")

    code, said = install(installed, "--config", robot_yaml(tmp_path / "home", text + LOAD))

    assert code == 2
    assert "payload_kg: missing" in said
    assert "the robot example is installed too, and this version cannot use its" in said
    assert "Nothing was changed" in said
    assert snapshot(installed) == before


def test_a_robot_that_was_never_installed_goes_on_nowhere(tmp_path: Path) -> None:
    code, said = install(tmp_path, "--name", "nobody")

    assert code == 2
    assert "Nothing was changed" not in said


# --- an interface that the robot of today runs on


@pytest.mark.parametrize(("active", "refused"), [(0, True), (3, False)])
def test_no_interface_is_taken_from_a_robot_that_runs(
    active: int, refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[list[str]] = []

    def systemctl(words: list[str], **_: object) -> subprocess.CompletedProcess[bytes]:
        asked.append(words)
        return subprocess.CompletedProcess(words, active)

    monkeypatch.setattr(subprocess, "run", systemctl)
    refuse_running("robot", [])
    assert asked == []  # nothing would be stopped: whether it runs is not asked

    if refused:
        with pytest.raises(
            InstallError, match=r"canbase-can@can0.service would be stopped.*stop canbase@robot\.target"
        ):
            refuse_running("robot", ["canbase-can@can0.service"])
    else:
        refuse_running("robot", ["canbase-can@can0.service"])
    assert asked[0][:3] == ["systemctl", "is-active", "--quiet"]
    assert "canbase-watchdog@robot.service" in asked[0]
