"""A service imports its own command alone: it has that in memory for as long as the robot runs."""

from __future__ import annotations

import subprocess
import sys

import pytest

from canbase_cli.main import app
from canbase_cli.services import SERVICES

PROGRAM = """
import atexit, sys
from canbase_cli.entry import main
sys.argv = ["canbase", *{words}]
atexit.register(lambda: print("canbase_cli.demo" in sys.modules, "canbase_config" in sys.modules))
main()
"""


def _end_of(*words: str) -> tuple[int, str, str]:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(words=list(words))],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    return done.returncode, done.stdout, done.stdout.splitlines()[-1]


@pytest.mark.parametrize("service", SERVICES)
def test_a_service_brings_no_other_command(service: str) -> None:
    code, told, imported = _end_of("serve", service, "--help")
    assert (code, imported) == (0, "False False")
    assert f"Usage: canbase serve {service} [OPTIONS]" in told


def test_any_other_command_is_there_as_before() -> None:
    code, told, imported = _end_of("print", "sample", "--help")
    assert (code, imported.split()[0]) == (0, "True")
    assert "Usage: canbase print sample [OPTIONS]" in told


def test_the_help_of_canbase_names_the_services_too() -> None:
    (serve,) = (group for group in app.registered_groups if group.name == "serve")
    assert serve.typer_instance is not None
    assert {command.name for command in serve.typer_instance.registered_commands} > set(SERVICES)


PLUGINS = """
import atexit, importlib.metadata, sys
looked_for = []
importlib.metadata.entry_points = lambda **which: looked_for.append(which["group"]) or ()
from canbase_cli.entry import main
sys.argv = ["canbase", "serve", "velocity", "--config", "missing.yaml"]
atexit.register(lambda: print("pydantic.plugin._loader" in sys.modules, looked_for))
main()
"""


def test_a_service_loads_no_plugins_of_pydantic_and_looks_for_none() -> None:
    done = subprocess.run([sys.executable, "-c", PLUGINS], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2  # there is no such file
    assert done.stdout.split() == ["True", "[]"]


MESSAGES = """
import sys
from canbase_cli.options import ros_needed
with ros_needed():
    import canbase_driver.runtime.main
    from nav_msgs.msg import Odometry
Odometry.__class__.__import_type_support__()
print(Odometry.__class__._TYPE_SUPPORT is not None, "rosidl_parser.parser" in sys.modules, "lark" in sys.modules)
"""


def test_messages_come_without_the_generator_of_their_python_code() -> None:
    done = subprocess.run([sys.executable, "-c", MESSAGES], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.split() == ["True", "False", "False"]
