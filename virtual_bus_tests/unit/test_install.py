"""`canbase install` and `uninstall`: the plan as data, and the plan carried out below a folder, without root."""

from __future__ import annotations

import stat
from dataclasses import replace
from pathlib import Path, PurePosixPath

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.watchdog import RelayLine
from canbase_deploy.actions import Action, Existing, Link, Remove, Run, WriteFile
from canbase_deploy.execute import ExecuteError, Executor
from canbase_deploy.host import manifests, read_templates
from canbase_deploy.plan import PARTS, InstallError, Request, install_plan, next_step, uninstall_plan

TEMPLATES = Path(__file__).parents[2] / "deploy" / "systemd"
EXAMPLE = sample("example_can0")
UNITS = "/etc/systemd/system"


def request(**changes: object) -> Request:
    wanted = Request(
        name="example",
        robot=load_robot(EXAMPLE).robot,
        yaml=EXAMPLE.read_text(),
        python="/opt/canbase/bin/python",
        templates=read_templates(TEMPLATES),
    )
    return replace(wanted, **changes)  # type: ignore[arg-type]


def changed(**changes: object) -> Robot:
    return load_robot(EXAMPLE).robot.model_copy(update=changes)


def texts(actions: list[Action]) -> dict[str, str]:
    return {str(action.path): action.text for action in actions if isinstance(action, WriteFile)}


def carried_out(root: Path, actions: list[Action]) -> list[str]:
    said: list[str] = []
    Executor(root, said.append).carry_out(actions)
    return said


def files_below(root: Path) -> list[str]:
    return sorted(f"/{path.relative_to(root)}" for path in root.rglob("*") if not path.is_dir())


# ---- the plan -------------------------------------------------------------------------------------------------------


def test_no_placeholder_is_left_in_a_unit() -> None:
    units = {path: text for path, text in texts(install_plan(request(), {})).items() if path.startswith(UNITS)}

    assert [path for path, text in units.items() if "@PYTHON@" in text] == []
    assert "ExecStart=/opt/canbase/bin/python -m canbase_cli driver" in units[f"{UNITS}/canbase-driver@.service"]


def test_a_robot_starts_at_boot_and_its_interface_with_the_adapter() -> None:
    links = {str(action.path) for action in install_plan(request(), {}) if isinstance(action, Link)}

    assert links == {
        f"{UNITS}/multi-user.target.wants/canbase@example.target",
        f"{UNITS}/sys-subsystem-net-devices-can0.device.wants/canbase-can@can0.service",
    }


def test_the_user_is_made_before_a_file_belongs_to_it() -> None:
    plan = install_plan(request(), {})

    made = plan.index(Run(("systemd-sysusers", "/etc/sysusers.d/canbase.conf")))
    theirs = [place for place, action in enumerate(plan) if isinstance(action, WriteFile) and action.group]
    assert made < min(theirs)


def test_nobody_but_root_and_the_services_reads_what_is_the_owners() -> None:
    owners = [action for action in install_plan(request(), {}) if isinstance(action, WriteFile) and action.group]

    assert {(str(a.path), a.mode, a.group, a.existing) for a in owners} == {
        ("/etc/canbase/example.yaml", 0o640, "canbase", Existing.BACK_UP),
        ("/etc/canbase/example.env", 0o640, "canbase", Existing.KEEP),
    }


def test_by_default_nothing_is_heard_from_outside_this_computer() -> None:
    files = texts(install_plan(request(), {}))

    assert "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST\nROS_DOMAIN_ID=0\n" in files["/etc/canbase/example.env"]
    for part in ("driver", "velocity", "action-server"):
        unit = files[f"{UNITS}/canbase-{part}@.service"]
        assert "\nIPAddressDeny=any\n" in unit
        assert "\nIPAddressAllow=localhost\n" in unit
    assert "IPAddressAllow" not in files[f"{UNITS}/canbase-watchdog@.service"]


def test_a_domain_that_was_chosen_goes_along() -> None:
    files = texts(install_plan(request(environment={"ROS_DOMAIN_ID": "7"}), {}))

    assert [line for line in files["/etc/canbase/example.env"].splitlines() if "DOMAIN" in line] == ["ROS_DOMAIN_ID=7"]


def test_a_sourced_ros_2_reaches_every_process_and_an_upgrade_moves_it(tmp_path: Path) -> None:
    old = {"AMENT_PREFIX_PATH": "/opt/ws:/opt/ros/jazzy", "PYTHONPATH": '/opt/a 100% "b"'}
    carried_out(tmp_path, install_plan(request(sourced=old), {}))

    drop_in = "etc/systemd/system/canbase-{}@example.service.d/05-ros.conf"
    texts = {(tmp_path / drop_in.format(part)).read_text() for part in PARTS}
    paths = 'Environment="AMENT_PREFIX_PATH=/opt/ws:/opt/ros/jazzy"\nEnvironment="PYTHONPATH=/opt/a 100%% \\"b\\""\n'
    assert texts == {f"[Service]\n{paths}"}
    assert "PYTHONPATH" not in (tmp_path / "etc/canbase/example.env").read_text()

    new = {"AMENT_PREFIX_PATH": "/opt/ros/kilted"}
    carried_out(tmp_path, install_plan(request(sourced=new), manifests(tmp_path)))
    assert (tmp_path / drop_in.format("driver")).read_text() == (
        '[Service]\nEnvironment="AMENT_PREFIX_PATH=/opt/ros/kilted"\n'
    )


def test_a_network_that_is_opened_is_opened_on_purpose() -> None:
    files = texts(install_plan(request(network="lan"), {}))

    assert "ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET\n" in files["/etc/canbase/example.env"]
    opened = [path for path, text in files.items() if "IPAddressAllow=any" in text]
    assert opened == [
        f"{UNITS}/canbase-{part}@example.service.d/20-lan.conf" for part in ("driver", "velocity", "action-server")
    ]


def test_the_interface_gets_the_bit_rate_of_robot_yaml() -> None:
    robot = changed(bus=load_robot(EXAMPLE).robot.bus.model_copy(update={"bitrate": 250_000, "channel": "can7"}))

    files = texts(install_plan(request(robot=robot), {}))

    assert files["/etc/canbase/can/can7.env"] == "BITRATE=250000\nRESTART_MS=100\nTXQUEUELEN=64\n"
    for part in ("watchdog", "driver"):
        waits = files[f"{UNITS}/canbase-{part}@example.service.d/10-can.conf"]
        assert waits == "[Unit]\nWants=canbase-can@can7.service\nAfter=canbase-can@can7.service\n"


def test_who_brings_the_interface_up_himself_is_left_alone() -> None:
    files = texts(install_plan(request(bring_up_can=False), {}))

    assert [path for path in files if path.startswith("/etc/canbase/can/")] == []
    assert (
        "Wants=sys-subsystem-net-devices-can0.device"
        in files[f"{UNITS}/canbase-watchdog@example.service.d/10-can.conf"]
    )


def test_an_adapter_keeps_its_name_wherever_it_is_plugged_in() -> None:
    files = texts(install_plan(request(adapter="ID_SERIAL_SHORT=0042"), {}))

    assert files["/etc/systemd/network/70-canbase-can0.link"] == (
        "[Match]\nType=can\nProperty=ID_SERIAL_SHORT=0042\n\n[Link]\nName=can0\n"
    )


def test_cpus_relay_and_hardware_watchdog_are_drop_ins() -> None:
    robot = load_robot(EXAMPLE).robot
    relay = robot.watchdog.model_copy(update={"relay": RelayLine("/dev/gpiochip0", 3)})

    files = texts(
        install_plan(request(robot=changed(watchdog=relay), cpus="2,3", hardware_watchdog_s=5), {}),
    )

    assert files[f"{UNITS}/canbase-driver@example.service.d/30-cpus.conf"] == "[Service]\nCPUAffinity=2,3\n"
    assert "DeviceAllow=/dev/gpiochip0 rw" in files[f"{UNITS}/canbase-watchdog@example.service.d/40-relay.conf"]
    assert files["/etc/systemd/system.conf.d/canbase.conf"] == "[Manager]\nRuntimeWatchdogSec=5s\n"


def test_each_service_has_the_enclave_that_the_policy_gives_it() -> None:
    files = texts(install_plan(request(sros2=True), {}))
    policy = (TEMPLATES.parent / "sros2" / "policy.xml").read_text()

    for part, enclave in {"driver": "driver", "velocity": "velocity", "action-server": "action_server"}.items():
        drop_in = files[f"{UNITS}/canbase-{part}@example.service.d/50-sros2.conf"]
        assert f'Environment="CANBASE_ENCLAVE=--enclave /canbase/{enclave}"' in drop_in
        assert "ROS_SECURITY_STRATEGY=Enforce" in drop_in
        assert f'path="/canbase/{enclave}"' in policy
        assert "$CANBASE_ENCLAVE" in files[f"{UNITS}/canbase-{part}@.service"]


def _bus(**changes: str) -> Robot:
    return changed(bus=load_robot(EXAMPLE).robot.bus.model_copy(update=changes))


def _lease(socket: str) -> Robot:
    return changed(lease=load_robot(EXAMPLE).robot.lease.model_copy(update={"socket": socket}))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (request(robot=_bus(interface="udp_multicast")), "socketcan"),
        (request(robot=_bus(channel="can0; reboot")), "can0; reboot"),
        (request(robot=_bus(channel="a-name")), "a-name"),
        (request(robot=_lease("/tmp/lease.sock")), "/run/canbase/example/lease.sock"),
        (request(robot=_lease("/run/canbase/../lease.sock")), "lease.socket"),
        (request(adapter="ID_PATH"), "ID_PATH"),
        (request(adapter="ID_PATH=a\n[Link]"), "--adapter"),
        (request(cpus="2,3\nUser=root"), "--cpus"),
        (request(name="../x"), "--name"),
    ],
)
def test_what_services_cannot_run_is_refused_with_advice(wrong: Request, told: str) -> None:
    with pytest.raises(InstallError, match=r"expected|need") as error:
        install_plan(wrong, {})

    assert told in str(error.value)


# ---- carried out ----------------------------------------------------------------------------------------------------


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
RESTARTED = f"now, with the robot standing: sudo systemctl restart {TARGET}"


def upgraded(root: Path, wanted: Request) -> str:
    """The last words of an installation over the one of `request()`."""
    carried_out(root, install_plan(request(), {}))
    executor = Executor(root, lambda _: None)
    executor.carry_out(install_plan(wanted, manifests(root)))
    return next_step(wanted, executor.changed, upgrade=True)


def test_a_new_bit_rate_comes_into_force_with_the_interface_while_the_robot_is_stopped(tmp_path: Path) -> None:
    robot = changed(bus=load_robot(EXAMPLE).robot.bus.model_copy(update={"bitrate": 250_000}))

    assert upgraded(tmp_path, request(robot=robot)) == (
        f"now, with the robot standing: sudo systemctl stop {TARGET} && "
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
    carried_out(tmp_path, install_plan(request(name="second", robot=_bus(channel="can1")), manifests(tmp_path)))

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


def test_a_robot_that_is_not_installed_is_named_with_those_that_are() -> None:
    with pytest.raises(InstallError, match="installed: example"):
        uninstall_plan("exmple", {"example": ""})


def test_a_dry_run_changes_nothing(tmp_path: Path) -> None:
    said: list[str] = []

    Executor(tmp_path, said.append, dry_run=True).carry_out(install_plan(request(), {}))

    assert files_below(tmp_path) == []
    assert "wrote     /etc/canbase/example.yaml" in said


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "etc").write_text("a file\n")

    with pytest.raises(ExecuteError, match="canbase"):
        carried_out(tmp_path, install_plan(request(), {}))


def test_the_commands(tmp_path: Path) -> None:
    runner = CliRunner()

    installed = runner.invoke(app, ["install", "--config", str(EXAMPLE), "--prefix", str(tmp_path)])
    refused = runner.invoke(app, ["install", "--config", str(sample("bench")), "--prefix", str(tmp_path)])
    unknown = runner.invoke(app, ["uninstall", "nobody", "--prefix", str(tmp_path)])
    removed = runner.invoke(app, ["uninstall", "example", "--prefix", str(tmp_path), "--purge"])

    codes = [result.exit_code for result in (installed, refused, unknown, removed)]
    assert codes == [0, 2, 2, 0]
    assert files_below(tmp_path) == ["/etc/sysusers.d/canbase.conf"]
