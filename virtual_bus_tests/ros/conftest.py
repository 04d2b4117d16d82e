"""Fixtures of the tests over DDS. Each test has a ROS domain, a UDP port and a lease socket of its own."""

from __future__ import annotations

import itertools
import os
import socket
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from canbase_cli.middleware import prefer_udp
from canbase_config.load import load_robot
from canbase_config.robot import Robot
from support.ros_harness import Process, TestNode, clear_records, merged, python_argv, reserve_domain, robot_values
from support.velocity_chain import RUN, Chain, chain_with

Spawn = Callable[..., Process]
MakeRobot = Callable[[Mapping[str, Any]], Path]

_starts = itertools.count(os.getpid())


@pytest.fixture(scope="session", autouse=True)
def this_machine_alone(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test talks to another machine, whatever its domain, and none leaves anything behind.

    DDS as the commands of canbase set it: over shared memory a process under test would wait for a node of the test
    that does not get the processor, for seconds.
    """
    dds = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    prefer_udp(dds)
    with pytest.MonkeyPatch.context() as patch:
        for name, value in dds.items():
            patch.setenv(name, value)
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        patch.delenv("STATE_DIRECTORY", raising=False)
        yield


@pytest.fixture(autouse=True)
def no_stop_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each test begins with clear records of stops, as a robot does that has just been installed."""
    for name, value in clear_records(tmp_path, "robot", "bench").items():
        monkeypatch.setenv(name, value)


@pytest.fixture(autouse=True)
def domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """ROS_DOMAIN_ID of this test, in its environment and in that of every process that it starts."""
    domain, holder = reserve_domain(next(_starts))
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    yield domain
    holder.close()


@pytest.fixture
def short_folder() -> Iterator[Path]:
    """A new folder with a path short enough for Unix sockets (108 bytes)."""
    with tempfile.TemporaryDirectory(prefix="canbase-", dir="/tmp") as name:
        yield Path(name)


@pytest.fixture
def make_robot(short_folder: Path) -> MakeRobot:
    """make_robot({"limits": {"linear_mps": 0.5}}): path of a robot.yaml with these changes to `robot_values`.

    All files of one test share its UDP port and lease socket, unless the changes say otherwise.
    """
    base = robot_values(short_folder)
    numbers = itertools.count()

    def make(changes: Mapping[str, Any]) -> Path:
        path = short_folder / f"robot{next(numbers)}.yaml"
        YAML(typ="safe").dump(merged(base, changes), path)
        return path

    return make


@pytest.fixture
def robot_yaml(make_robot: MakeRobot) -> Path:
    """A robot.yaml as `robot_values` gives it."""
    return make_robot({})


@pytest.fixture
def robot(robot_yaml: Path) -> Robot:
    """What `robot_yaml` describes."""
    return load_robot(robot_yaml).robot


@pytest.fixture
def spawn(tmp_path: Path) -> Iterator[Spawn]:
    """spawn("python code" or [argv], env={…}): a `Process` that ends with the test at the latest."""
    processes: list[Process] = []
    numbers = itertools.count()  # several threads of a test may start processes

    def start(command: str | Sequence[str], env: Mapping[str, str] | None = None) -> Process:
        argv = python_argv(command) if isinstance(command, str) else command
        process = Process(argv, tmp_path / f"process{next(numbers)}.log", env)
        processes.append(process)
        return process

    yield start
    for process in processes:
        process.close()
        print(f"--- {process.log_path.name}, exit code {process.exit_code} ---\n{process.log()}")


@pytest.fixture
def test_node() -> Iterator[TestNode]:
    """A `TestNode` in the test's domain."""
    with TestNode() as node:
        yield node


@pytest.fixture
def watchdog(robot: Robot) -> Iterator[socket.socket]:
    """The socket at which leases arrive."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(robot.lease.socket)
        receiver.setblocking(False)
        yield receiver


@pytest.fixture
def start(
    spawn: Spawn,
    make_robot: MakeRobot,
    test_node: TestNode,
    watchdog: socket.socket,
) -> Callable[[Mapping[str, Any]], Chain]:
    """start({changes of robot.yaml}): the chain, ready to drive."""

    def start_chain(changes: Mapping[str, Any]) -> Chain:
        process = spawn(RUN.format(path=str(make_robot(changes)), ros_args=[]))
        return Chain(test_node, process, watchdog)

    return start_chain


@pytest.fixture
def chain(start: Callable[[Mapping[str, Any]], Chain]) -> Chain:
    return start({})


@pytest.fixture(scope="module")
def module_chain(request: pytest.FixtureRequest) -> Iterator[Chain]:
    """One chain for all tests of a module, with its CHANGES of robot.yaml; each test begins with `rest`."""
    with chain_with(getattr(request.module, "CHANGES", {})) as chain:
        yield chain
