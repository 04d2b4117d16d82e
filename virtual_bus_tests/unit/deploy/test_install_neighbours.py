"""`canbase setup install` beside robots that are installed: no bus, lease socket, name, place in ROS or file for
two."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.load import sample
from canbase_deploy.neighbours import namespace

EXAMPLE = sample("example_can0").read_text()


def install(
    home: Path, root: Path, *replaced: tuple[str, str], profile: str = "", words: tuple[str, ...] = ()
) -> tuple[int, str]:
    """Exit code and output; the sample with other words in it, and with a profile of its own if one is given."""
    text, more = EXAMPLE, [("profile: generic", "profile: mine.yaml")] if profile else []
    for before, after in [*replaced, *more]:
        assert before in text
        text = text.replace(before, after)
    home.mkdir(exist_ok=True)
    (home / "mine.yaml").write_text(profile)
    (home / "robot.yaml").write_text(text)
    done = CliRunner().invoke(
        app, ["setup", "install", "--config", str(home / "robot.yaml"), "--prefix", str(root), *words]
    )
    return done.exit_code, done.output


def uninstall(root: Path, name: str) -> int:
    return CliRunner().invoke(app, ["setup", "uninstall", name, "--prefix", str(root)]).exit_code


def snapshot(root: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}


NAME = ("name: example", "name: second")
CHANNEL = ("channel: can0", "channel: can1")
LEASE = ("/run/canbase/lease.sock", "/run/canbase/second/lease.sock")
PLACE = ("--namespace", "second")


@pytest.mark.parametrize(
    ("replaced", "told"),
    [((NAME,), "bus.channel"), ((NAME, LEASE), "bus.channel"), ((NAME, CHANNEL), "/run/canbase/second/lease.sock")],
)
def test_a_robot_that_was_renamed_is_refused_until_the_old_one_is_gone(
    replaced: tuple[tuple[str, str], ...], told: str, tmp_path: Path
) -> None:
    root = tmp_path / "root"
    assert install(tmp_path / "home", root)[0] == 0
    before = snapshot(root)

    code, said = install(tmp_path / "home", root, *replaced)
    assert code == 2
    assert "`sudo canbase setup uninstall example`" in said
    assert told in said
    assert snapshot(root) == before

    assert uninstall(root, "example") == 0
    assert install(tmp_path / "home", root, *replaced)[0] == 0


def test_a_second_robot_with_all_of_its_own_is_installed_and_each_again(tmp_path: Path) -> None:
    root = tmp_path / "root"

    codes = [install(tmp_path, root)[0], install(tmp_path, root, NAME, CHANNEL, LEASE, words=PLACE)[0]]
    codes += [install(tmp_path, root)[0], install(tmp_path, root, NAME, CHANNEL, LEASE)[0]]

    assert codes == [0, 0, 0, 0]
    assert "CANBASE_OPTIONS=--namespace /second\n" in (root / "etc/canbase/second.env").read_text()


def test_two_robots_in_one_namespace_of_one_domain_follow_the_same_commands(tmp_path: Path) -> None:
    root = tmp_path / "root"
    install(tmp_path, root)
    before = snapshot(root)

    code, said = install(tmp_path, root, NAME, CHANNEL, LEASE)

    assert code == 2
    assert "the robot example is installed and has ROS_DOMAIN_ID=0 and the namespace / too" in said
    assert "--namespace second" in said
    assert snapshot(root) == before


def test_another_domain_is_another_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = tmp_path / "root"
    install(tmp_path, root)
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    assert install(tmp_path, root, NAME, CHANNEL, LEASE)[0] == 0


def test_what_the_kept_file_sets_counts_and_another_namespace_is_refused_with_its_path(tmp_path: Path) -> None:
    root = tmp_path / "root"
    assert install(tmp_path, root, NAME, CHANNEL, LEASE, words=PLACE)[0] == 0
    assert install(tmp_path, root)[0] == 0

    code, said = install(tmp_path, root, NAME, CHANNEL, LEASE, words=("--namespace", "third"))
    assert code == 2
    assert "/etc/canbase/second.env is kept and has the namespace /second" in said

    file = root / "etc/canbase/second.env"
    file.write_text(file.read_text().replace("--namespace /second", ""))
    code, said = install(tmp_path, root)
    assert code == 2
    assert "CANBASE_OPTIONS=--namespace example in /etc/canbase/example.env" in said


def test_two_robots_with_one_name_would_mix_up_their_recordings(tmp_path: Path) -> None:
    root = tmp_path / "root"
    install(tmp_path, root)

    code, said = install(tmp_path, root, CHANNEL, LEASE, words=("--name", "second", *PLACE))

    assert code == 2
    assert "has name: example too, in /etc/canbase/example.yaml and the one for /etc/canbase/second.yaml" in said


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({}, "/"),
        ({"CANBASE_OPTIONS": "--namespace robot1"}, "/robot1"),
        ({"CANBASE_OPTIONS": "--no-autostart -n /fleet/robot1/"}, "/fleet/robot1"),
        ({"CANBASE_OPTIONS": "--namespace=robot1"}, "/robot1"),
        ({"CANBASE_ROS_ARGS": "-r scan:=front/scan -r __ns:=/robot2"}, "/robot2"),
        ({"CANBASE_OPTIONS": "-n robot1", "CANBASE_ROS_ARGS": "-r __ns:=/robot2"}, "/robot1"),
        ({"CANBASE_OPTIONS": "--log-namespace"}, "/"),
    ],
)
def test_the_namespace_of_services_is_where_their_environment_puts_them(
    environment: dict[str, str], expected: str
) -> None:
    assert namespace(environment) == expected


def test_a_neighbour_that_cannot_be_read_may_be_on_any_bus(tmp_path: Path) -> None:
    root = tmp_path / "root"
    install(tmp_path, root)
    (root / "etc/canbase/example.yaml").write_text("name: example\n")

    code, said = install(tmp_path, root, NAME, CHANNEL, LEASE)

    assert code == 2
    assert "`sudo canbase setup uninstall example`" in said


def test_robots_of_one_kind_share_a_profile_and_none_changes_that_of_another(tmp_path: Path) -> None:
    root, second = tmp_path / "root", (NAME, CHANNEL, LEASE)
    assert install(tmp_path, root, profile="title: One\n")[0] == 0
    assert install(tmp_path / "b", root, *second, profile="title: One\n", words=PLACE)[0] == 0

    code, said = install(tmp_path / "b", root, *second, profile="title: Two\n")

    assert code == 2
    assert "second/mine.yaml" in said
    assert (root / "etc/canbase/mine.yaml").read_text() == "title: One\n"
