"""`canbase setup install` with a robot.yaml that names files of its own: they are installed, upgraded and removed
with it."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.load import load_robot, sample
from canbase_doctor.support_bundle import collect, installed_robot

PROFILE = "title: My drive\nlayout: {axes: 1}\n"
TWIST_MUX = "twist_mux: {ros__parameters: {topics: {joy: {topic: joy_vel, timeout: 0.5, priority: 100}}}}\n"
EXAMPLE = sample("example_can0").read_text()


def robot_yaml(folder: Path, reference: str = "drives/mine.yaml", name: str = "example") -> Path:
    """A robot.yaml whose drives have a profile of their own, that lies where it says."""
    config = folder / "robot.yaml"
    profile = folder / reference
    profile.parent.mkdir(parents=True, exist_ok=True)
    profile.write_text(PROFILE)
    text = EXAMPLE.replace("profile: generic", f"profile: {reference}").replace("name: example", f"name: {name}")
    config.write_text(text)
    return config


def canbase(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, list(arguments))
    return result.exit_code, result.output


def install(root: Path, *options: str) -> tuple[int, str]:
    return canbase("setup", "install", "--prefix", str(root), *options)


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    return robot_yaml(tmp_path / "home")


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return tmp_path / "root"


def test_the_installed_robot_can_be_loaded_as_the_services_do(robot: Path, root: Path) -> None:
    code, said = install(root, "--config", str(robot))

    assert code == 0, said
    assert "wrote     /etc/canbase/drives/mine.yaml" in said
    loaded = load_robot(root / "etc/canbase/example.yaml")
    assert {drive.kind.title for drive in loaded.robot.drives} >= {"My drive"}
    assert stat.S_IMODE((root / "etc/canbase/drives/mine.yaml").stat().st_mode) == 0o640


def test_its_folder_is_open_to_the_services_whatever_the_umask_of_root(robot: Path, root: Path) -> None:
    install(root, "--config", str(robot))

    assert (root / "etc/tmpfiles.d/canbase-example.conf").read_text() == (
        "d /etc/canbase/drives 0750 root canbase\nz /etc/canbase/drives/mine.yaml 0640 root canbase\n"
    )


def test_files_of_twist_mux_are_named_too(robot: Path, root: Path) -> None:
    (robot.parent / "mux.yaml").write_text(TWIST_MUX)
    text = robot.read_text()
    assert "\nmux:" not in text
    robot.write_text(f"{text}\nmux: {{twist_mux: [mux.yaml]}}\n")

    code, said = install(root, "--config", str(robot))

    assert code == 0, said
    assert "joy" in load_robot(root / "etc/canbase/example.yaml").robot.mux.sources


def test_a_dry_run_tells_of_them(robot: Path, root: Path) -> None:
    _, said = install(root, "--config", str(robot), "--dry-run")

    assert "would write   /etc/canbase/drives/mine.yaml" in said
    assert not root.exists()


def test_an_upgrade_keeps_what_the_owner_changed_in_them(robot: Path, root: Path) -> None:
    install(root, "--config", str(robot))
    installed = root / "etc/canbase/drives/mine.yaml"
    installed.write_text(f"# mine\n{PROFILE}")

    assert install(root, "--name", "example")[0] == 0
    assert installed.read_text() == f"# mine\n{PROFILE}"

    _, said = install(root, "--config", str(robot))
    assert "replaced  /etc/canbase/drives/mine.yaml (the old one is mine.yaml.old)" in said
    assert installed.read_text() == PROFILE
    assert (installed.parent / "mine.yaml.old").read_text() == f"# mine\n{PROFILE}"


def test_uninstall_keeps_them_with_robot_yaml_and_purge_removes_them_with_it(robot: Path, root: Path) -> None:
    etc = root / "etc/canbase"
    install(root, "--config", str(robot))
    canbase("setup", "uninstall", "example", "--prefix", str(root))
    assert load_robot(etc / "example.yaml").robot.name == "example"
    assert not (root / "etc/tmpfiles.d/canbase-example.conf").exists()

    install(root, "--name", "example", "--config", str(robot))
    (etc / "drives/mine.yaml.old").write_text("older\n")
    (etc / "example.yaml.old").write_text("older\n")
    install(root, "--name", "example")
    canbase("setup", "uninstall", "example", "--prefix", str(root), "--purge")
    assert list(etc.iterdir()) == []


@pytest.mark.parametrize(
    ("reference", "told"),
    [
        ("../mine.yaml", "beside robot.yaml"),
        ("my drive.yaml", "rename it"),
        ("keys/mine.yaml", "another folder"),
        ("example.yaml", "another name"),
    ],
)
def test_a_file_that_has_no_place_below_etc_canbase_is_refused(
    reference: str, told: str, tmp_path: Path, root: Path
) -> None:
    code, said = install(root, "--config", str(robot_yaml(tmp_path / "home", reference)))

    assert code == 2
    assert told in said
    assert not root.exists()


def test_a_file_that_the_services_do_not_see_is_refused_an_absolute_one_elsewhere_stays(
    robot: Path, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile = robot.parent / "drives/mine.yaml"
    robot.write_text(robot.read_text().replace("drives/mine.yaml", str(profile)))
    monkeypatch.setattr("canbase_deploy.host.HIDDEN", (f"{robot.parent}/",))
    code, said = install(root, "--config", str(robot))
    assert (code, "relative to robot.yaml" in said) == (2, True)

    monkeypatch.setattr("canbase_deploy.host.HIDDEN", ("/home/",))
    code, said = install(root, "--config", str(robot))
    assert (code, "mine.yaml" in said) == (0, False)


def test_a_robot_does_not_take_the_place_of_another_ones_file(tmp_path: Path, root: Path) -> None:
    install(root, "--config", str(robot_yaml(tmp_path / "a", "mine.yaml")))

    code, said = install(root, "--config", str(robot_yaml(tmp_path / "b", name="mine")))

    assert code == 2
    assert "a file of the robot example" in said


def test_a_profile_beside_robot_yaml_is_not_taken_for_a_robot(tmp_path: Path, root: Path) -> None:
    etc = root / "etc/canbase"
    install(root, "--config", str(robot_yaml(tmp_path / "home", "a_drive.yaml")))

    assert installed_robot(etc) == etc / "example.yaml"
    assert installed_robot(tmp_path / "home") == tmp_path / "home/robot.yaml"
    assert installed_robot(tmp_path / "none") is None


def test_the_support_bundle_has_them(robot: Path, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("canbase_doctor.bundle_contents.commands", lambda *_: ())
    loaded = load_robot(robot)

    bundle = collect(loaded.robot, robot, "-1h", root / "etc/canbase", root / "state", loaded.files)

    yaml = YAML(typ="safe")
    assert yaml.load(bundle.files["config/named_1.yaml"]) == yaml.load(PROFILE) | {"title": "…"}


@pytest.mark.parametrize("name", ["example.env", "other.env", "example.yaml.old", "drives/.yaml"])
def test_a_file_that_is_no_yaml_is_never_taken_along(robot: Path, root: Path, name: str) -> None:
    """It could take the place of the services' environment, PYTHONPATH included."""
    planted = robot.parent / name
    planted.parent.mkdir(parents=True, exist_ok=True)
    planted.write_text(TWIST_MUX)
    robot.write_text(f"{robot.read_text()}\nmux: {{twist_mux: [{name}]}}\n")

    code, said = install(root, "--config", str(robot))

    assert code == 2
    assert f"robot.yaml names {name}" in said
    assert not (root / "etc").exists()
