"""`canbase setup install` and `uninstall` as data: which files, links and commands they consist of."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_config.load import load_robot
from canbase_config.robot import Robot
from canbase_config.watchdog import RelayLine
from canbase_deploy.actions import Existing, Link, Remove, Run, WriteFile
from canbase_deploy.host import manifests
from canbase_deploy.keystore import SERVICES
from canbase_deploy.neighbours import Neighbour
from canbase_deploy.plan import COMMON, HARDENING, METRICS, PARTS, InstallError, Request, install_plan, left_interfaces
from support.install_plans import EXAMPLE, TEMPLATES, UNITS, carried_out, changed, on_bus, request, texts


def test_no_placeholder_is_left_in_a_unit() -> None:
    units = {path: text for path, text in texts(install_plan(request(), {})).items() if path.startswith(UNITS)}

    assert [path for path, text in units.items() if "@PYTHON@" in text] == []
    assert "ExecStart=/opt/canbase/bin/python -m canbase_cli serve driver" in units[f"{UNITS}/canbase-driver@.service"]


def test_a_robot_starts_at_boot_and_its_interface_with_the_adapter() -> None:
    links = {str(action.path) for action in install_plan(request(), {}) if isinstance(action, Link)}

    assert links - shared_links() == {
        f"{UNITS}/multi-user.target.wants/canbase@example.target",
        f"{UNITS}/sys-subsystem-net-devices-can0.device.wants/canbase-can@can0.service",
    }


def shared_links() -> set[str]:
    hardening = {f"{UNITS}/canbase-{part}@.service.d/00-hardening.conf" for part in (*PARTS, METRICS)}
    return hardening | {f"{UNITS}/canbase-{part}@.service.d/00-common.conf" for part in PARTS}


def test_every_part_has_the_one_sandbox_and_what_is_common_before_it_has_a_unit(tmp_path: Path) -> None:
    plan = install_plan(request(), {})
    paths = [str(action.path) for action in plan if isinstance(action, WriteFile | Link)]
    links = [place for place, path in enumerate(paths) if path in shared_links()]
    units = [place for place, path in enumerate(paths) if path.startswith(UNITS) and path.endswith("@.service")]

    assert len(links) == 2 * len(PARTS) + 1
    assert max(*links, *(paths.index(f"{UNITS}/{name}") for name in (HARDENING, COMMON))) < min(units)
    carried_out(tmp_path, plan)
    for part in (*PARTS, METRICS):
        drop_in = tmp_path / f"etc/systemd/system/canbase-{part}@.service.d/00-hardening.conf"
        assert drop_in.read_text() == TEMPLATES.joinpath(HARDENING).read_text()
    for part in PARTS:
        drop_in = tmp_path / f"etc/systemd/system/canbase-{part}@.service.d/00-common.conf"
        assert drop_in.read_text() == TEMPLATES.joinpath(COMMON).read_text()


def test_no_unit_of_the_integrators_own_gets_the_sandbox() -> None:
    paths = {str(action.path) for action in install_plan(request(), {}) if isinstance(action, WriteFile | Link)}

    assert [path for path in paths if f"{UNITS}/canbase-.service.d" in path or f"{UNITS}/service.d" in path] == []


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
        assert "\nIPAddressAllow=localhost\n" in unit
    assert "\nIPAddressDeny=any\n" in files[f"{UNITS}/{HARDENING}"]
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
        f"{UNITS}/canbase-{part}@example.service.d/20-lan.conf"
        for part in ("driver", "velocity", "action-server", "metrics")
    ]


def test_only_an_open_network_is_waited_for() -> None:
    assert [path for path, text in texts(install_plan(request(), {})).items() if "network-online" in text] == []
    files = texts(install_plan(request(network="lan"), {}))

    opened = {path: text for path, text in files.items() if path.endswith("/20-lan.conf")}
    waits = "[Unit]\nWants=network-online.target\nAfter=network-online.target\n"
    assert [text.startswith(waits) for text in opened.values()] == [True] * 4


# installed on can0 ── robot.yaml has can7 now ── can0 is brought down while its environment is still there
def test_an_interface_that_no_robot_uses_any_more_is_stopped(tmp_path: Path) -> None:
    carried_out(tmp_path, install_plan(request(), {}))

    plan = install_plan(request(robot=on_bus(channel="can7")), manifests(tmp_path))

    stop = Run(("systemctl", "stop", "canbase-can@can0.service"), True)
    gone = [action for action in plan if isinstance(action, Remove)]
    assert {str(action.path) for action in gone} >= {
        "/etc/canbase/can/can0.env",
        f"{UNITS}/sys-subsystem-net-devices-can0.device.wants/canbase-can@can0.service",
    }
    assert plan.index(stop) < min(plan.index(action) for action in gone)


def test_an_interface_that_is_still_used_is_not_stopped(tmp_path: Path) -> None:
    carried_out(tmp_path, install_plan(request(), {}))
    installed = manifests(tmp_path)
    other = Neighbour("other", on_bus(channel="can0"), {})

    assert left_interfaces(request(), installed) == []
    assert left_interfaces(request(bring_up_can=False), installed) == []  # somebody else brings the same one up
    moved = request(robot=on_bus(channel="can7"))
    assert left_interfaces(moved, installed) == ["canbase-can@can0.service"]
    assert left_interfaces(moved, installed, [other]) == []
    assert left_interfaces(moved, {"somebody": "/etc/canbase/can/can0.env\n"}) == []


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

    for part, enclave in SERVICES.items():
        drop_in = files[f"{UNITS}/canbase-{part}@example.service.d/50-sros2.conf"]
        assert f'Environment="CANBASE_ENCLAVE=--enclave /canbase/{enclave}"' in drop_in
        assert "ROS_SECURITY_STRATEGY=Enforce" in drop_in
        assert f'path="/canbase/{enclave}"' in policy
        assert "$CANBASE_ENCLAVE" in files[f"{UNITS}/canbase-{part}@.service"]


def _lease(socket: str) -> Robot:
    return changed(lease=load_robot(EXAMPLE).robot.lease.model_copy(update={"socket": socket}))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (request(robot=on_bus(interface="udp_multicast")), "socketcan"),
        (request(robot=on_bus(channel="can0; reboot")), "can0; reboot"),
        (request(robot=on_bus(channel="a-name")), "a-name"),
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
