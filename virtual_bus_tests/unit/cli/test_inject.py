"""`canbase inject` and `canbase print sample`: what they refuse, and what reaches the simulator."""

from __future__ import annotations

import inspect
import json
import re
import socket
import threading
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_cli.inject import inject
from canbase_cli.main import app
from canbase_config.load import load_robot, sample, samples
from canbase_sim.control import control_path
from canbase_sim.faults import KINDS
from canbase_sim.plant.encoder import EncoderFault


def canbase(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, list(words))
    return done.exit_code, done.output


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """The bench sample with a lease socket, and so a simulator, of its own."""
    text, changes = re.subn(r"(?m)^  socket: .*$", f"  socket: {tmp_path}/lease", sample("bench").read_text())
    assert changes == 1
    file = tmp_path / "robot.yaml"
    file.write_text(text)
    return file


@pytest.fixture
def simulator(robot: Path) -> Iterator[list[str]]:
    """A simulator that takes every fault; the requests that it got."""
    got: list[str] = []
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as server:
        server.bind(str(control_path(load_robot(robot).robot)))
        server.listen()

        def serve() -> None:
            connection, _ = server.accept()
            with connection, connection.makefile("rb") as lines:
                for line in lines:
                    got.append(line.decode().strip())
                    connection.sendall(b'{"done": true}\n')

        thread = threading.Thread(target=serve)
        thread.start()
        yield got
        thread.join(2.0)


def test_a_fault_of_one_wheel_goes_to_its_drive(robot: Path, simulator: list[str]) -> None:
    assert canbase("inject", "right_wheel", "weak", "share=0.3", "-c", str(robot)) == (
        0,
        "canbase: right_wheel: weak\n",
    )
    assert simulator == ['{"fault": {"node": 2, "kind": "weak", "share": 0.3}}']


def test_all_goes_to_each_drive(robot: Path, simulator: list[str]) -> None:
    assert canbase("inject", "all", "heal", "-c", str(robot))[0] == 0
    assert simulator == ['{"fault": {"node": 1, "kind": "heal"}}', '{"fault": {"node": 2, "kind": "heal"}}']


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["left_whel", "cut"], 2, "'left_whel' is no process and no joint of"),
        (["drivre", "hang"], 2, "'drivre' is no process and no joint of"),
        (["left_wheel", "broken"], 2, "there is no fault 'broken' of a drive, expected one of silent, deaf, cut"),
        (["left_wheel", "weak", "0.3"], 2, "'0.3': expected NAME=VALUE"),
        (["left_wheel", "weak", "share=much"], 2, "share = 'much': expected a number"),
        (["driver", "cut"], 2, "driver takes hang, continue, kill, not 'cut'"),
        (["driver", "hang"], 1, "does not run; start it with `canbase up`"),
        (["left_wheel", "cut"], 1, "no simulator at"),
    ],
)
def test_what_it_refuses(robot: Path, words: list[str], code: int, says: str) -> None:
    found, text = canbase("inject", *words, "-c", str(robot))
    assert (found, says in " ".join(text.split())) == (code, True), text


def test_help_lists_each_fault_of_a_drive() -> None:
    listed = re.findall(r"^ +- (\w+): \S", inject.__doc__ or "", re.MULTILINE)
    assert listed == sorted(KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_help_has_the_parameters_of_a_fault_and_their_defaults(kind: str) -> None:
    do, takes = KINDS[kind]
    fixed = inspect.getclosurevars(do).nonlocals.get("fixed", {})
    defaults = {field.name: field.default for field in fields(EncoderFault)} | fixed
    defaults |= {name: given.default for name, given in inspect.signature(do).parameters.items()}
    line = next(line for line in (inject.__doc__ or "").splitlines() if line.strip().startswith(f"- {kind}: "))

    told = dict(re.findall(r"(\w+)=([\w.]+)", line))

    assert set(told) == takes - {"axis"}
    assert {name: json.loads(value) for name, value in told.items() if value != "N"} == {
        name: defaults[name] for name in told if defaults[name] is not None
    }


def test_nothing_is_broken_on_a_real_bus(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(sample("example_can0").read_text())
    code, text = canbase("inject", "driver", "kill", "-c", str(file))
    assert (code, "faults are injected on a simulated bus alone" in text) == (2, True), text


def test_each_sample_is_printed_as_it_is() -> None:
    assert canbase("print", "sample") == (0, "\n".join(samples()) + "\n")
    for name in samples():
        assert canbase("print", "sample", name) == (0, sample(name).read_text())
    code, text = canbase("print", "sample", "bensh")
    assert (code, "there is no sample 'bensh'" in text) == (2, True)
