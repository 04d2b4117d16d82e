"""The `canbase` command. Each subcommand lives in a file of its own and imports what it runs only when it runs."""

from __future__ import annotations

from typing import Annotated, Final

import typer

from canbase_cli import (
    adopt,
    aggregator,
    benchmark,
    calibrate,
    cancel,
    commission,
    config,
    demo,
    doctor,
    drive,
    dump,
    ekf,
    emcy,
    evidence,
    explain,
    export,
    fibonacci,
    init,
    inject,
    install,
    jog,
    metrics,
    monitor,
    nav2,
    nmt,
    params,
    qualify,
    record,
    replay,
    rotate,
    sample,
    scan,
    sdo,
    services,
    trigger,
    up,
    urdf,
    vda5050,
    web,
)
from canbase_cli.goal import GoalCommand
from canbase_cli.options import ROS_USAGE, RosCommand, new_app
from canbase_doctor import support_bundle

app = new_app()


def _version(wanted: bool) -> None:
    if wanted:
        from canbase_runtime.version import installed_version, is_compiled

        typer.echo(f"canbase {installed_version()}{', compiled' if is_compiled() else ''}")
        raise typer.Exit


@app.callback()
def canbase(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """A CANopen motor driver stack for ROS 2 mobile bases.

    Exit codes: 0 success, 1 failure, 2 wrong command line or robot.yaml. Goals also: 3 canceled, 4 aborted, 5 rejected,
    6 no server, 7 no feedback. Each command's --help lists its own.
    """


_DRIVE: Final = "Drive"
_LOOK: Final = "Monitor and diagnose"
_SET_UP: Final = "Set up"
_LEARN: Final = "Learn and measure"

app.command("demo", rich_help_panel=_DRIVE)(demo.demo)
app.command("up", cls=RosCommand, options_metavar=ROS_USAGE, rich_help_panel=_DRIVE)(up.up)
app.command("drive", cls=GoalCommand, options_metavar=ROS_USAGE, rich_help_panel=_DRIVE)(drive.drive)
app.command("rotate", cls=GoalCommand, options_metavar=ROS_USAGE, rich_help_panel=_DRIVE)(rotate.rotate)
app.command("cancel", cls=RosCommand, options_metavar=ROS_USAGE, rich_help_panel=_DRIVE)(cancel.cancel)
app.command("stop", cls=RosCommand, options_metavar=ROS_USAGE, rich_help_panel=_DRIVE)(trigger.stop)
app.command("reset", cls=RosCommand, options_metavar=ROS_USAGE, rich_help_panel=_DRIVE)(trigger.reset)

app.command("monitor", cls=RosCommand, options_metavar=ROS_USAGE, rich_help_panel=_LOOK)(monitor.monitor)
app.command("web", cls=RosCommand, options_metavar=ROS_USAGE, rich_help_panel=_LOOK)(web.web)
app.command("metrics", cls=RosCommand, options_metavar=ROS_USAGE, rich_help_panel=_LOOK)(metrics.metrics)
app.command("vda5050", cls=RosCommand, options_metavar=ROS_USAGE, rich_help_panel=_LOOK)(vda5050.vda5050)
app.command("record", cls=RosCommand, options_metavar=ROS_USAGE, epilog=record.EPILOG, rich_help_panel=_LOOK)(
    record.record
)
app.command("doctor", cls=RosCommand, options_metavar=ROS_USAGE, epilog=doctor.EPILOG, rich_help_panel=_LOOK)(
    doctor.doctor
)
app.command("explain", epilog=explain.EPILOG, rich_help_panel=_LOOK)(explain.explain)
app.command("dump", epilog=dump.EPILOG, rich_help_panel=_LOOK)(dump.dump)
app.command("export", epilog=export.EPILOG, rich_help_panel=_LOOK)(export.export)
app.command("replay", epilog=replay.EPILOG, rich_help_panel=_LOOK)(replay.replay)
app.command("evidence", epilog=evidence.EPILOG, rich_help_panel=_LOOK)(evidence.evidence)
app.command("support-bundle", rich_help_panel=_LOOK)(support_bundle.support_bundle)

app.command("adopt", epilog=adopt.EPILOG, rich_help_panel=_SET_UP)(adopt.adopt)
app.command("init", epilog=init.EPILOG, rich_help_panel=_SET_UP)(init.init)
app.command("sample", rich_help_panel=_SET_UP)(sample.sample)
app.add_typer(config.app, name="config", rich_help_panel=_SET_UP)
app.command("urdf", rich_help_panel=_SET_UP)(urdf.urdf)
app.command("nav2", rich_help_panel=_SET_UP)(nav2.nav2)
app.command("aggregator", rich_help_panel=_SET_UP)(aggregator.aggregator)
app.command("ekf", rich_help_panel=_SET_UP)(ekf.ekf)
app.command("qualify", epilog=qualify.EPILOG, rich_help_panel=_SET_UP)(qualify.qualify)
app.command("scan", epilog=scan.EPILOG, rich_help_panel=_SET_UP)(scan.scan)
app.add_typer(sdo.app, name="sdo", rich_help_panel=_SET_UP)
app.add_typer(params.app, name="params", rich_help_panel=_SET_UP)
app.command("emcy", epilog=emcy.EPILOG, rich_help_panel=_SET_UP)(emcy.emcy)
app.command("nmt", epilog=nmt.EPILOG, rich_help_panel=_SET_UP)(nmt.nmt)
app.command("jog", epilog=jog.EPILOG, rich_help_panel=_SET_UP)(jog.jog)
app.command("commission", epilog=commission.EPILOG, rich_help_panel=_SET_UP)(commission.commission)
app.command("calibrate", cls=RosCommand, options_metavar=ROS_USAGE, epilog=calibrate.EPILOG, rich_help_panel=_SET_UP)(
    calibrate.calibrate
)
app.command("install", rich_help_panel=_SET_UP)(install.install)
app.command("uninstall", rich_help_panel=_SET_UP)(install.uninstall)

app.add_typer(fibonacci.app, name="fibonacci", rich_help_panel=_LEARN)
app.command("inject", epilog=inject.EPILOG, rich_help_panel=_LEARN)(inject.inject)
app.command("benchmark", rich_help_panel=_LEARN)(benchmark.benchmark)

services.add_services(app)
