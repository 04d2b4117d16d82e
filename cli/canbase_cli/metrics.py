"""`canbase serve metrics`: what a running robot does, for Prometheus and everything that reads OpenMetrics."""

from __future__ import annotations

from typing import Annotated

import typer

from canbase_cli.options import ConfigOption, NamespaceOption, ros_arguments, ros_needed
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, load_config

EXTRA = "pip install 'prometheus-client>=0.22,<1'"


def metrics(
    ctx: typer.Context,
    config: ConfigOption = None,
    port: Annotated[int, typer.Option("--port", min=1, max=65_535, help="TCP port.")] = 9464,
    host: Annotated[
        str, typer.Option("--host", metavar="ADDRESS", help="Address to listen on; others than 127.0.0.1 open it.")
    ] = "127.0.0.1",
    name: Annotated[
        list[str] | None,
        typer.Option("--name", metavar="HOST", help="Host name by which it is scraped, beside ADDRESS; repeatable."),
    ] = None,
    namespace: NamespaceOption = "",
) -> None:
    """Serve metrics of a running robot over HTTP: OpenMetrics, at /metrics.

    It only reads topics of the robot: nothing depends on it, and it runs with low priority. What is older than 1.5 s
    is left out; canbase_data_age_seconds tells how old each topic is. There is no password: on another address than
    127.0.0.1 everybody who reaches it can read.

    Exit codes: 0 ended by Ctrl-C or SIGTERM, 1 the port cannot be had, 2 wrong command line or robot.yaml.
    """
    robot, arguments = load_config(config).robot, ros_arguments(ctx, namespace)
    with ros_needed():
        import rclpy  # noqa: F401 - without ROS 2 this ends in advice
    try:
        from canbase_fleet.main import run
    except ModuleNotFoundError as error:
        if str(error.name).partition(".")[0] != "prometheus_client":
            raise
        fail(f"canbase serve metrics needs the Python package prometheus-client: {EXTRA}", WRONG_INPUT)
    try:
        problem = run(robot, (host, port), arguments, lambda where: typer.echo(f"serving {where}"), name or ())
    except OSError as error:
        fail(f"{host}:{port} cannot be had: {error.strerror}; give another --port or --host", FAILED)
    if problem:
        fail(f"canbase serve metrics ends: {problem}", FAILED)
