"""`canbase setup install` and `uninstall` carried out below a folder, without root: the first time, again, and gone."""

from __future__ import annotations

import stat
from pathlib import Path, PurePosixPath

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.load import load_robot, sample
from canbase_deploy.actions import Remove, Run
from canbase_deploy.execute import ExecuteError, Executor
from canbase_deploy.host import manifests
from canbase_deploy.plan import InstallError, Request, install_plan, network_warning, next_step, uninstall_plan
from support.install_plans import EXAMPLE, UNITS, carried_out, changed, files_below, on_bus, request


def test_the_second_time_nothing_changes(tmp_path: Path) -> None:
    carried_out(tmp_path, install_plan(request(), {}))
    before = {path: (tmp_path / path[1:]).read_bytes() for path in files_below(tmp_path) if ".wants" not in path}

    said = carried_out(tmp_path, install_plan(request(), manifests(tmp_path)))

    assert {line[:9] for line in said} == {"as it was"}
    assert {path: (tmp_path / path[1:]).read_bytes() for path in before} == before


def test_modes_below_a_prefix(tmp_path: Path) -> None:
    carried_out(tmp_path, install_plan(request(), {}))

    def mode(path: str) -> int:
        return stat.S_IMODE((tmp_path / path).stat().st_mode)

    assert mode("etc/canbase/example.yaml") == 0o640
    assert mode("etc/canbase/example.env") == 0o640
    assert mode("etc/systemd/system/canbase@.target") == 0o644


def test_an_upgrade_keeps_what_the_owner_wrote(tmp_path: Path) -> None:
    carried_out(tmp_path, install_plan(request(), {}))
    env, yaml = tmp_path / "etc/canbase/example.env", tmp_path / "etc/canbase/example.yaml"
    env.write_text("ROS_DOMAIN_ID=7\n")
    yaml.write_text("# mine\n")

    said = carried_out(tmp_path, install_plan(request(yaml=None), manifests(tmp_path)))

    assert (env.read_text(), yaml.read_text()) == ("ROS_DOMAIN_ID=7\n", "# mine\n")
    assert "kept      /etc/canbase/example.env" in said


def test_a_robot_yaml_that_is_replaced_stays_beside_the_new_one(tmp_path: Path) -> None:
    carried_out(tmp_path, install_plan(request(), {}))

    carried_out(tmp_path, install_plan(request(yaml="# new\n"), manifests(tmp_path)))

    assert (tmp_path / "etc/canbase/example.yaml").read_text() == "# new\n"
    assert (tmp_path / "etc/canbase/example.yaml.old").read_text() == EXAMPLE.read_text()


TARGET = "canbase@example.target"
RESTARTED = f"now, with the robot at standstill: sudo systemctl restart {TARGET}"


def upgraded(root: Path, wanted: Request) -> str:
    """The last words of an installation over the one of `request()`."""
    carried_out(root, install_plan(request(), {}))
    executor = Executor(root, lambda _: None)
    executor.carry_out(install_plan(wanted, manifests(root)))
    return next_step(wanted, executor.changed, upgrade=True)


def test_a_new_bit_rate_comes_into_force_with_the_interface_while_the_robot_is_stopped(tmp_path: Path) -> None:
    robot = changed(bus=load_robot(EXAMPLE).robot.bus.model_copy(update={"bitrate": 250_000}))

    assert upgraded(tmp_path, request(robot=robot)) == (
        f"now, with the robot at standstill: sudo systemctl stop {TARGET} && "
        f"sudo systemctl restart canbase-can@can0.service && sudo systemctl start {TARGET}"
    )


def test_a_new_unit_of_the_interface_restarts_it_too(tmp_path: Path) -> None:
    templates = {**request().templates, "canbase-can@.service": "[Service]\n"}

    assert "restart canbase-can@can0.service" in upgraded(tmp_path, request(templates=templates))


@pytest.mark.parametrize("wanted", [request(), request(cpus="2"), request(bring_up_can=False)])
def test_an_interface_that_stays_as_it_is_is_left_alone(wanted: Request, tmp_path: Path) -> None:
    assert upgraded(tmp_path, wanted) == RESTARTED


def test_the_first_time_the_robot_is_started(tmp_path: Path) -> None:
    executor = Executor(tmp_path, lambda _: None)
    executor.carry_out(install_plan(request(), {}))

    assert next_step(request(), executor.changed, upgrade=False).startswith(f"now: sudo systemctl start {TARGET},")


def test_an_option_that_is_no_longer_given_leaves_no_file_behind(tmp_path: Path) -> None:
    carried_out(tmp_path, install_plan(request(cpus="2"), {}))

    carried_out(tmp_path, install_plan(request(), manifests(tmp_path)))

    assert [path for path in files_below(tmp_path) if "cpus" in path] == []


def test_uninstalled_only_what_the_owner_may_miss_is_left(tmp_path: Path) -> None:
    carried_out(tmp_path, install_plan(request(hardware_watchdog_s=5), {}))

    carried_out(tmp_path, uninstall_plan("example", manifests(tmp_path)))

    assert files_below(tmp_path) == [
        "/etc/canbase/example.env",
        "/etc/canbase/example.yaml",
        "/etc/sysusers.d/canbase.conf",
    ]


def test_the_units_stay_as_long_as_another_robot_needs_them(tmp_path: Path) -> None:
    carried_out(tmp_path, install_plan(request(), {}))
    carried_out(tmp_path, install_plan(request(name="second", robot=on_bus(channel="can1")), manifests(tmp_path)))

    carried_out(tmp_path, uninstall_plan("example", manifests(tmp_path)))

    left = files_below(tmp_path)
    assert f"{UNITS}/canbase-driver@.service" in left
    assert [path for path in left if "@example" in path] == []
    assert list(manifests(tmp_path)) == ["second"]


def test_services_are_stopped_before_they_are_removed() -> None:
    plan = uninstall_plan("example", {"example": "/etc/a\n"})

    assert isinstance(plan[0], Run)
    assert plan[0].argv[:3] == ("systemctl", "stop", "canbase@example.target")
    assert plan[1] == Remove(PurePosixPath("/etc/a"))


def test_uninstalled_its_interface_goes_down_unless_it_is_another_robots_and_udev_forgets_it() -> None:
    own = f"/etc/canbase/can/can0.env\n{UNITS}/canbase@.target\n"
    can = Run(("systemctl", "stop", "canbase-can@can0.service"), may_fail=True)
    reload = Run(("udevadm", "control", "--reload"))

    alone, beside = uninstall_plan("a", {"a": own}), uninstall_plan("a", {"a": own, "b": own})

    removed = Remove(PurePosixPath("/etc/canbase/can/can0.env"))
    assert 0 < alone.index(can) < alone.index(removed) < alone.index(reload)
    assert can not in beside


@pytest.mark.parametrize(
    ("argv", "why"),
    [(("sleep", "60"), "timed out"), (("false",), "exit status 1"), (("/nowhere/program",), "No such file")],
)
def test_a_command_that_may_fail_or_hang_does_not_hold_up_the_rest(
    argv: tuple[str, ...], why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("canbase_deploy.execute.COMMAND_S", 0.1)
    there = tmp_path / "there"
    there.write_text("")
    rest = Remove(PurePosixPath(there))

    said: list[str] = []
    Executor(Path("/"), said.append).carry_out([Run(argv, may_fail=True), rest])
    assert not there.exists()
    assert said[1].startswith("failed")
    assert why in said[1]

    with pytest.raises(ExecuteError, match=argv[0]):
        Executor(Path("/"), said.append).carry_out([Run(argv), rest])


def test_a_robot_that_is_not_installed_is_named_with_those_that_are() -> None:
    with pytest.raises(InstallError, match="installed: example"):
        uninstall_plan("exmple", {"example": ""})


def test_a_dry_run_changes_nothing(tmp_path: Path) -> None:
    said: list[str] = []

    Executor(tmp_path, said.append, dry_run=True).carry_out(install_plan(request(), {}))

    assert files_below(tmp_path) == []
    assert "would write   /etc/canbase/example.yaml" in said
    assert {line.split()[0] for line in said} == {"would"}


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "etc").write_text("a file\n")

    with pytest.raises(ExecuteError, match="canbase"):
        carried_out(tmp_path, install_plan(request(), {}))


def test_the_commands(tmp_path: Path) -> None:
    runner = CliRunner()

    installed = runner.invoke(app, ["setup", "install", "--config", str(EXAMPLE), "--prefix", str(tmp_path)])
    refused = runner.invoke(app, ["setup", "install", "--config", str(sample("bench")), "--prefix", str(tmp_path)])
    unknown = runner.invoke(app, ["setup", "uninstall", "nobody", "--prefix", str(tmp_path)])
    removed = runner.invoke(app, ["setup", "uninstall", "example", "--prefix", str(tmp_path), "--purge"])

    codes = [result.exit_code for result in (installed, refused, unknown, removed)]
    assert codes == [0, 2, 2, 0]
    assert files_below(tmp_path) == ["/etc/sysusers.d/canbase.conf"]


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        (("--network", "lan"), (), "set ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST in /etc/canbase/example.env"),
        ((), ("--network", "lan"), "set ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET in /etc/canbase/example.env"),
    ],
)
def test_a_network_that_does_not_fit_the_environment_that_is_kept_is_told(
    before: tuple[str, ...], after: tuple[str, ...], told: str, tmp_path: Path
) -> None:
    def install(*options: str) -> str:
        words = ["install", "-c", str(EXAMPLE), "--prefix", str(tmp_path), *options]
        said = CliRunner().invoke(app, words).output.splitlines()
        return "\n".join(line for line in said if not line.startswith(f"warning: {EXAMPLE}:"))  # of robot.yaml itself

    assert "warning" not in install(*before)
    assert "warning" not in install(*before)

    warned = install(*after)
    assert told in warned
    assert f"{UNITS}/canbase-driver@example.service.d/20-lan.conf" in warned

    env = tmp_path / "etc/canbase/example.env"
    env.write_text('# ROS_AUTOMATIC_DISCOVERY_RANGE=OFF\nROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET"\nA=1\n')
    assert "warning" not in install("--network", "lan")


def test_peers_that_are_named_need_no_discovery() -> None:
    lan = request(network="lan")

    assert network_warning(lan, {"ROS_STATIC_PEERS": "10.0.0.7"}) == ""
    assert "RANGE=OFF" in network_warning(lan, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"})
