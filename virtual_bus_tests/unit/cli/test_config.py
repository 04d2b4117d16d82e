"""The `canbase` command: what the subcommands hand over, and how they end. The processes are stand-ins here."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from canbase_cli import services
from canbase_cli.child import CHILD
from canbase_cli.main import app
from canbase_cli.options import RosCommand, ros_needed
from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.watchdog import WatchdogConfig
from canbase_runtime import version
from canbase_runtime.own_modules import module_command
from canbase_runtime.terminal import CommandError
from support.robot_files import write

Call = tuple[Robot, Any]
ROS_COMMANDS = [
    ("driver", "canbase_driver.runtime.main"),
    ("velocity", "canbase_velocity.main"),
    ("action-server", "canbase_action_server.main"),
]


def stand_in(monkeypatch: pytest.MonkeyPatch, module_name: str, exit_code: int = 0) -> list[Call]:
    """Replaces `run` of a process; returns the list that its calls go to."""
    calls: list[Call] = []

    def run(robot: Robot, argument: Any, *_options: Any, **_named: Any) -> int:
        calls.append((robot, argument))
        return exit_code

    module = ModuleType(module_name)
    module.run = run  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module_name, module)
    monkeypatch.setattr("canbase_cli.services._claim", lambda robot: None)  # no unit test opens a bus
    return calls


@pytest.mark.parametrize(("command", "module"), ROS_COMMANDS)
def test_without_options_a_process_gets_the_robot_that_is_meant_and_no_ros_arguments(
    command: str, module: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = stand_in(monkeypatch, module)

    result = CliRunner().invoke(app, [command])

    assert (result.exit_code, result.stdout) == (0, "")
    assert calls == [(load_robot(sample("bench")).robot, [])]


@pytest.mark.parametrize(("command", "module"), ROS_COMMANDS)
def test_namespace_and_ros_arguments_go_to_rclpy_together(
    command: str, module: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = stand_in(monkeypatch, module)

    CliRunner().invoke(
        app, [command, "--namespace", "robot1", "--ros-args", "-r", "odom:=odometry", "--log-level", "debug"]
    )

    assert [arguments for _, arguments in calls] == [
        ["--ros-args", "-r", "__ns:=/robot1", "-r", "odom:=odometry", "--log-level", "debug"]
    ]


@pytest.mark.parametrize(
    ("given", "arguments"),
    [
        ("robot1", ["--ros-args", "-r", "__ns:=/robot1"]),
        ("/robot1", ["--ros-args", "-r", "__ns:=/robot1"]),
        ("fleet/robot1/", ["--ros-args", "-r", "__ns:=/fleet/robot1"]),
        ("/", []),
        ("", []),
    ],
)
def test_a_namespace_is_written_with_or_without_its_slashes(
    given: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = stand_in(monkeypatch, "canbase_driver.runtime.main")

    CliRunner().invoke(app, ["serve", "driver", "-n", given])

    assert [got for _, got in calls] == [arguments]


@pytest.mark.parametrize("namespace", ["1st", "a b", "a//b", "a-b", "~", "a\n"])
def test_a_namespace_that_ros_would_refuse_is_refused_here(namespace: str, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = stand_in(monkeypatch, "canbase_driver.runtime.main")

    result = CliRunner().invoke(app, ["serve", "driver", "-n", namespace])

    assert (result.exit_code, calls) == (2, [])
    assert "is no ROS namespace" in result.stderr


def test_a_mistyped_option_before_the_ros_arguments_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = stand_in(monkeypatch, "canbase_driver.runtime.main")

    result = CliRunner().invoke(app, ["serve", "driver", "--confg", "x.yaml", "--ros-args", "-r", "a:=b"])

    assert (result.exit_code, calls) == (2, [])
    assert "No such option: --confg" in result.stderr


@pytest.mark.parametrize(("command", "module"), [*ROS_COMMANDS, ("sim", "canbase_sim.main")])
def test_the_exit_code_of_the_process_is_that_of_the_command(
    command: str, module: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(monkeypatch, module, exit_code=7)

    assert CliRunner().invoke(app, [command]).exit_code == 7


@pytest.mark.parametrize("command", ["driver", "velocity", "action-server", "sim", "watchdog"])
def test_a_broken_robot_yaml_starts_no_process(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = [stand_in(monkeypatch, module) for _, module in [*ROS_COMMANDS, ("sim", "canbase_sim.main")]]
    monkeypatch.setattr(os, "execve", lambda *arguments: calls.append([arguments]))
    file = write(tmp_path, {9: "    gear_ratio: 0"})

    result = CliRunner().invoke(app, ["serve", command, "--config", str(file)])

    assert (result.exit_code, calls) == (2, [[], [], [], []])
    assert result.stderr.startswith(f"{file}:9: drives[0].gear_ratio: got 0, expected a number > 0 and <= 10000")
    assert "Traceback" not in result.output


def test_the_simulation_gets_its_control_socket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = stand_in(monkeypatch, "canbase_sim.main")
    file = write(tmp_path, {})

    CliRunner().invoke(
        app, ["serve", "sim", "-c", str(file), "--control", "/tmp/control.sock", "--namespace", "robot1"]
    )
    CliRunner().invoke(app, ["serve", "sim", "-c", str(file), "--ros-args", "-r", "a:=b"])

    assert calls == [(load_robot(file).robot, "/tmp/control.sock"), (load_robot(file).robot, None)]


def test_the_watchdog_replaces_the_process_and_skips_the_start_up_hook(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[str, list[str], dict[str, str]]] = []
    monkeypatch.setattr(os, "execve", lambda *arguments: calls.append(arguments))
    monkeypatch.delenv("_ROS_WHEELS_BOOTSTRAP_COMPLETE", raising=False)
    file = write(tmp_path, {})

    CliRunner().invoke(app, ["serve", "watchdog", "--config", str(file)])

    ((executable, arguments, environment),) = calls
    assert executable == sys.executable
    assert arguments[:-1] == module_command("canbase_watchdog", "--config-json")
    assert WatchdogConfig.from_json(arguments[-1]) == watchdog_config(load_robot(file).robot)
    assert environment["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] == "1"
    assert environment["PATH"] == os.environ["PATH"]


def test_a_good_file_is_printed_and_praised(tmp_path: Path) -> None:
    file = write(tmp_path, {})

    result = CliRunner().invoke(app, ["config", "check", str(file)])

    assert result.exit_code == 0
    assert result.stdout.startswith(
        "name: robot                                 # default\nbus:\n  interface: virtual\n"
    )
    given = 30  # lines of the file with a value, and one line with four
    defaults = result.stdout.count("# default\n")
    assert result.stderr == f"{file} is good: {given} values from the file, {defaults} defaults\n"


def test_without_a_file_the_bench_sample_is_checked() -> None:
    result = CliRunner().invoke(app, ["config", "check"])

    assert (result.exit_code, result.stdout.splitlines()[0]) == (0, "name: bench")


def test_the_file_may_be_named_as_for_other_commands_but_only_once(tmp_path: Path) -> None:
    file = str(write(tmp_path, {}))

    named = CliRunner().invoke(app, ["config", "check", "--config", file])
    twice = CliRunner().invoke(app, ["config", "check", file, "--config", file])

    assert (named.exit_code, named.output) == (0, CliRunner().invoke(app, ["config", "check", file]).output)
    assert twice.exit_code == 2


def test_colours_go_to_a_terminal_alone_and_not_where_the_user_wants_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    check = ["config", "check"]

    assert "\x1b[" not in CliRunner().invoke(app, check).output
    assert "\x1b[" in CliRunner().invoke(app, check, color=True).output
    assert "\x1b[" not in CliRunner().invoke(app, check, color=True, env={"NO_COLOR": "1"}).output


@pytest.mark.parametrize(
    "command",
    [[], ["config"], ["config", "check"], ["driver"], ["velocity"], ["action-server"], ["sim"], ["watchdog"]],
    ids=" ".join,
)
def test_every_command_explains_itself(command: list[str]) -> None:
    result = CliRunner().invoke(app, [*command, "--help"])

    assert result.exit_code == 0
    assert "Usage: " in result.stdout


def test_help_loads_neither_ros_nor_can_nor_the_configuration() -> None:
    code = (
        "import sys; from canbase_cli.main import app; app(['--help'], standalone_mode=False);"
        "print('loaded:', *sorted({'rclpy', 'can', 'canopen', 'pydantic', 'ruamel', 'numpy'} & set(sys.modules)))"
    )

    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=True)

    assert result.stdout.splitlines()[-1] == "loaded:"


@pytest.mark.parametrize("missing", ["rclpy", "rclpy.node", "canbase.msg"])
def test_without_ros_there_is_advice_and_no_traceback(missing: str) -> None:
    with (
        pytest.raises(CommandError, match=r"install canbase\[ros\] from PyPI") as caught,
        ros_needed(),
    ):
        raise ModuleNotFoundError(name=missing)

    assert caught.value.code == 1


def test_a_bug_of_ours_is_not_taken_for_missing_ros() -> None:
    with pytest.raises(ModuleNotFoundError), ros_needed():
        raise ModuleNotFoundError(name="canbase_drive")


def test_the_version_is_that_of_the_installed_package() -> None:
    result = CliRunner().invoke(app, ["--version"])

    assert (result.exit_code, result.stdout) == (0, f"canbase {version.installed_version()}\n")


def test_in_a_colcon_workspace_the_version_comes_from_package_xml(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def not_by_pip(_: str) -> str:
        raise PackageNotFoundError

    share = tmp_path / "second" / "share" / "canbase"
    share.mkdir(parents=True)
    (share / "package.xml").write_text("<package><version>3.2.1</version></package>", encoding="utf-8")
    monkeypatch.setattr(version, "version", not_by_pip)

    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'first'}:{tmp_path / 'second'}")
    assert version.installed_version() == "3.2.1"

    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "first"))
    assert version.installed_version() == "unknown"


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["--bad"], "--bad"),
        (["-r", "foo"], "remap rule: '-r foo'"),
        (["--params-file", "/none.yaml"], "Error opening YAML file"),
        (["--log-level", "nonsense"], "valid severity level"),
        (["words", "--without", "a-rule"], "ROS does not know words, --without, a-rule behind --ros-args"),
    ],
)
def test_what_ros_does_not_take_is_a_wrong_command_line_in_words(given: list[str], told: str) -> None:
    result = CliRunner().invoke(app, ["monitor", "--ros-args", *given], env={"COLUMNS": "300"})
    assert result.exit_code == 2
    assert told in " ".join(result.output.split())
    assert "Traceback" not in result.output


@pytest.mark.parametrize("command", ["driver", "velocity", "action-server", "sim", "watchdog"])
def test_a_word_that_ros_does_not_know_ends_a_process_before_it_opens_the_bus_or_writes_a_file(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = [stand_in(monkeypatch, module) for _, module in [*ROS_COMMANDS, ("sim", "canbase_sim.main")]]
    opened: list[Any] = []
    monkeypatch.setattr("canbase_cli.services._claim", opened.append)
    monkeypatch.setattr(os, "execve", lambda *arguments: opened.append(arguments))
    stop_file = tmp_path / "stop.json"
    takes_one = command in ("driver", "watchdog")

    words = [command, *(["--stop-file", str(stop_file)] if takes_one else []), "--ros-args", "--bogus"]
    result = CliRunner().invoke(app, words, env={"COLUMNS": "300"})

    assert (result.exit_code, opened, calls, stop_file.exists()) == (2, [], [[], [], [], []], False)
    assert "ROS does not know --bogus behind --ros-args" in " ".join(result.output.split())


@pytest.mark.parametrize(
    ("command", "opens"),
    [("up", "up._refuse_twice"), ("web", "web._token")],
)
def test_a_word_that_ros_does_not_know_ends_a_command_before_it_takes_a_name_or_a_port(
    command: str, opens: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[Any] = []
    monkeypatch.setattr(f"canbase_cli.{opens}", lambda *given: opened.append(given))
    words = {"web": ["--token-file", "/none"]}.get(command, [])

    result = CliRunner().invoke(app, [command, *words, "--ros-args", "--bogus"], env={"COLUMNS": "300"})

    assert (result.exit_code, opened) == (2, [])
    assert "ROS does not know --bogus behind --ros-args" in " ".join(result.output.split())


def test_without_ros_the_words_for_it_keep_no_watchdog_from_starting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing can check them there, and they have no effect on a process without a node."""
    started: list[Any] = []
    monkeypatch.setattr(os, "execve", lambda *arguments: started.append(arguments))
    monkeypatch.setattr("canbase_cli.options.find_spec", lambda name: None)

    assert CliRunner().invoke(app, ["serve", "watchdog", "--ros-args", "--bogus"]).exit_code == 0
    assert len(started) == 1


def test_a_ros_that_cannot_be_loaded_keeps_no_watchdog_from_starting(monkeypatch: pytest.MonkeyPatch) -> None:
    """rclpy is found, and a library of it is not: after an update in part, or without its environment."""
    started: list[Any] = []
    monkeypatch.setattr(os, "execve", lambda *arguments: started.append(arguments))

    def broken(name: str) -> None:
        raise ImportError(f"{name}: librcl_action.so: cannot open shared object file")

    monkeypatch.setattr("canbase_cli.options.import_module", broken)

    assert CliRunner().invoke(app, ["serve", "watchdog", "--ros-args", "-r", "__ns:=/robot"]).exit_code == 0
    assert len(started) == 1


def test_a_parameter_of_another_type_than_its_node_declares_is_a_wrong_command_line_too() -> None:
    def begin() -> None:
        from rclpy.exceptions import InvalidParameterTypeException
        from rclpy.parameter import Parameter

        raise InvalidParameterTypeException(Parameter("use_sim_time", value=3), Parameter.Type.BOOL)

    ros_app = typer.Typer()
    ros_app.command(cls=RosCommand)(begin)
    result = CliRunner().invoke(ros_app, ["--ros-args", "-p", "use_sim_time:=3"], env={"COLUMNS": "300"})
    assert result.exit_code == 2
    assert "behind --ros-args: Trying to set parameter 'use_sim_time' to '3'" in " ".join(result.output.split())


def test_any_other_error_of_a_ros_command_is_its_own() -> None:
    def begin() -> None:
        raise ValueError("a defect")

    ros_app = typer.Typer()
    ros_app.command(cls=RosCommand)(begin)
    assert isinstance(CliRunner().invoke(ros_app, []).exception, ValueError)


def test_a_part_of_canbase_up_does_not_repeat_the_warnings_of_robot_yaml(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    warned = []
    for part in ("", "driver"):
        monkeypatch.setenv(CHILD, part) if part else monkeypatch.delenv(CHILD, raising=False)
        services._robot_named(sample("example_can0"))
        warned.append("warning:" in capsys.readouterr().err)

    assert warned == [True, False]
