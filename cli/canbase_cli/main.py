"""The `canbase` command. Each subcommand lives in a file of its own and imports what it runs only when it runs."""

from __future__ import annotations

from typing import Annotated, Final

import typer

from canbase_cli import (
    benchmark,
    commission,
    config,
    demo,
    doctor,
    drive,
    fibonacci,
    inject,
    install,
    jog,
    monitor,
    rotate,
    sample,
    scan,
    sdo,
    services,
    trigger,
    up,
)
from canbase_cli.goal import GoalCommand
from canbase_cli.options import RosCommand
from canbase_doctor import support_bundle

app = typer.Typer(
    name="canbase",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from canbase_runtime.version import installed_version

        typer.echo(f"canbase {installed_version()}")
        raise typer.Exit


@app.callback()
def canbase(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """A CANopen motor driver stack for ROS 2 mobile bases.

    Exit codes: 0 success, 1 it did not work out, 2 a wrong command line or a wrong robot.yaml.
    """


_ROS_USAGE: Final = "[OPTIONS] [--ros-args …]"

app.command("demo")(demo.demo)
app.command("up", cls=RosCommand, options_metavar=_ROS_USAGE)(up.up)
app.command("drive", cls=GoalCommand, options_metavar=_ROS_USAGE)(drive.drive)
app.command("rotate", cls=GoalCommand, options_metavar=_ROS_USAGE)(rotate.rotate)
app.command("monitor", cls=RosCommand, options_metavar=_ROS_USAGE)(monitor.monitor)
app.command("stop", cls=RosCommand, options_metavar=_ROS_USAGE)(trigger.stop)
app.command("reset", cls=RosCommand, options_metavar=_ROS_USAGE)(trigger.reset)
app.command("doctor", cls=RosCommand, options_metavar=_ROS_USAGE, epilog=doctor.EPILOG)(doctor.doctor)
app.command("scan", epilog=scan.EPILOG)(scan.scan)
app.add_typer(sdo.app, name="sdo")
app.command("commission", epilog=commission.EPILOG)(commission.commission)
app.command("jog", epilog=jog.EPILOG)(jog.jog)
app.command("inject", epilog=inject.EPILOG)(inject.inject)
app.command("sample")(sample.sample)
app.command("benchmark")(benchmark.benchmark)
app.add_typer(config.app, name="config")
app.add_typer(fibonacci.app, name="fibonacci")
app.command("install")(install.install)
app.command("uninstall")(install.uninstall)
app.command("support-bundle")(support_bundle.support_bundle)
app.command("driver", cls=RosCommand, options_metavar=_ROS_USAGE)(services.driver)
app.command("velocity", cls=RosCommand, options_metavar=_ROS_USAGE)(services.velocity)
app.command("action-server", cls=RosCommand, options_metavar=_ROS_USAGE)(services.action_server)
app.command("watchdog", cls=RosCommand)(services.watchdog)
app.command("sim", cls=RosCommand)(services.sim)
