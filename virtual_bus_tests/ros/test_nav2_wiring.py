"""Stand-ins wired as Nav2's launch file wires Nav2: with what `canbase print nav2` prints they drive the base, and
`canbase doctor` names mistakes with their cure. Each mistake alone: unit/doctor/test_nav2_checks.py.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from canbase.msg import DriverStatus, MuxState
from geometry_msgs.msg import TwistStamped
from ruamel.yaml import YAML

from canbase_config.load import load_robot
from canbase_config.nav2_chain import NODES, chain
from support import nav2_stand_ins
from support.ros_harness import Process, TestNode
from support.velocity_chain import RUN

pytestmark = [pytest.mark.ros, pytest.mark.timeout(240)]
START_S = 20.0
CANBASE = (sys.executable, "-m", "canbase_cli")
CHANGES = {"safety": {"scan": {"required": False}}, "limits": {"linear_mps": 0.6}}
Row = dict[str, Any]


class Site:
    """A robot of which mux and filter run, Nav2 beside it, and a doctor."""

    def __init__(self, spawn: Callable[..., Process], node: TestNode, config: Path, folder: Path) -> None:
        self.spawn, self.node, self.config, self.folder = spawn, node, config, folder
        self.orders, self.mux = node.record(TwistStamped, "cmd_vel"), node.record(MuxState, "velocity_mux/state")
        spawn(RUN.format(path=str(config), ros_args=[]))
        driver = node.repeat(DriverStatus, "motor_driver/status", 20.0, owner="motor_driver")
        driver.message = DriverStatus(state=DriverStatus.ENABLED)
        node.wait_for(lambda: self.orders.messages, START_S, "mux and filter")

    @property
    def printed(self) -> dict[str, Any]:
        """What `canbase print nav2` prints for this robot, as stand-ins take it."""
        self.params_file.write_text(self.out("print", "nav2"), encoding="utf-8")
        return {"params_file": str(self.params_file), "remappings": chain(load_robot(self.config).robot).remappings}

    @property
    def params_file(self) -> Path:
        return self.folder / "nav2.yaml"

    def wait_until_armed(self) -> None:
        """2 s without a velocity: the mux follows Nav2 from its first one."""
        armed = lambda: any(each.name == "navigation" and each.armed for each in self.mux.messages[-1].sources)  # noqa: E731
        self.node.spin_for(0.5)
        self.node.wait_for(armed, START_S, "2 s of silence")

    def change(self, node: str, **values: Any) -> None:
        """Somebody edits the parameter file."""
        yaml = YAML()
        tree = yaml.load(self.params_file)
        tree[node]["ros__parameters"].update(values)
        yaml.dump(tree, self.params_file)

    @contextmanager
    def nav2(self, wired: Mapping[str, Any]) -> Iterator[Process]:
        """Nav2 for a while."""
        log = self.folder / "nav2.log"
        process = Process([sys.executable, nav2_stand_ins.__file__, json.dumps(wired)], log)
        try:
            self.node.wait_for(lambda: self._sees_nav2(process), START_S, f"Nav2 in the ROS graph: {process.log()}")
            yield process
        finally:
            process.terminate()
            process.wait(10.0)
            process.close()

    def _sees_nav2(self, process: Process) -> bool:
        assert process.exit_code is None, process.log()
        return {node.name for node in NODES} <= set(self.node.node.get_node_names())

    def out(self, *words: str) -> str:
        """What a command prints on stdout."""
        done = subprocess.run(
            [*CANBASE, *words, "--config", str(self.config)], capture_output=True, text=True, timeout=60
        )
        assert done.stdout, done.stderr
        return done.stdout

    def doctor(self) -> list[Row]:
        """Its rows about Nav2."""
        rows = json.loads(self.out("doctor", "--no-bus", "--json", "--seconds", "1"))
        return [row for row in rows if row["name"].startswith("Nav2")]


@pytest.fixture
def site(spawn: Callable[..., Process], make_robot: Any, test_node: TestNode, tmp_path: Path) -> Site:
    return Site(spawn, test_node, make_robot(CHANGES), tmp_path)


def one(rows: list[Row], found: str) -> Row:
    """The row that says so."""
    told = [row for row in rows if found in row["found"]]
    assert len(told) == 1, rows
    return told[0]


def test_what_canbase_nav2_prints_drives_the_base_within_its_limits(site: Site) -> None:
    printed = site.printed
    site.wait_until_armed()
    with site.nav2({**printed, "stamped": False}):  # the default of Jazzy, which the printed parameters change
        speeds = lambda: {order.twist.linear.x for order in site.orders.messages}  # noqa: E731
        site.node.wait_for(lambda: 0.6 in speeds(), START_S, "Nav2 to drive")
        rows = site.doctor()
    assert speeds() == {0.0, 0.6}, "the controller orders 0.9, and velocity_smoother has max_velocity 0.6"
    path = "controller_server → cmd_vel_controller → velocity_smoother → cmd_vel_smoothed → collision_monitor"
    assert one(rows, "→")["found"] == f"{path} → cmd_vel_nav → velocity_mux"
    assert {row["verdict"] for row in rows if "nobody reads" not in row["found"]} == {"ok"}
    docking = one(rows, "cmd_vel_docking")
    assert (docking["verdict"], "docking" in docking["advice"]) == ("warn", True)


def test_mistakes_are_named_with_their_cure(site: Site) -> None:
    printed = site.printed
    with site.nav2({}):  # Nav2's own launch file and parameters, canbase print nav2 never called
        rows = site.doctor()
    row = one(rows, "the input of motor_driver")
    assert {"docking_server", "following_server", "collision_monitor"} <= set(row["found"].replace(";", "").split())
    assert "docking_server:cmd_vel:=cmd_vel_docking" in row["advice"]
    assert "cmd_vel_out_topic: cmd_vel_nav" in row["advice"]

    site.change("collision_monitor", enable_stamped_cmd_vel=False)  # Twist where others have TwistStamped
    site.change("velocity_smoother", max_velocity=[1.0, 0.0, 2.0])  # faster than the base
    with site.nav2(printed):
        rows = site.doctor()
    row = one(rows, "collision_monitor publishes Twist on /cmd_vel_nav, velocity_mux reads TwistStamped")
    assert "collision_monitor: enable_stamped_cmd_vel: true" in row["advice"]
    assert one(rows, "velocity_smoother publishes TwistStamped on /cmd_vel_smoothed")["verdict"] == "fail"
    row = one(rows, "velocity_smoother max_velocity is 1 m/s, robot.yaml permits 0.6")
    assert (row["verdict"], "canbase print nav2" in row["advice"]) == ("warn", True)
