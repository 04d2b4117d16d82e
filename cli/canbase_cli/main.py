"""The `canbase` command. Each subcommand lives in a file of its own and imports what it runs only when it runs."""

from __future__ import annotations

from typing import Annotated, Any, Final

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
from canbase_cli.old_names import OldNames
from canbase_cli.options import ROS_USAGE, RosCommand, new_app
from canbase_doctor import support_bundle

app = new_app(OldNames)


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
_GROUPS: Final = "More, by subject"
_ROS: Final[dict[str, Any]] = {"cls": RosCommand, "options_metavar": ROS_USAGE}
_GOAL: Final[dict[str, Any]] = {"cls": GoalCommand, "options_metavar": ROS_USAGE}

app.command("demo", rich_help_panel=_DRIVE)(demo.demo)
app.command("up", **_ROS, rich_help_panel=_DRIVE)(up.up)
app.command("drive", **_GOAL, rich_help_panel=_DRIVE)(drive.drive)
app.command("rotate", **_GOAL, rich_help_panel=_DRIVE)(rotate.rotate)
app.command("cancel", **_ROS, rich_help_panel=_DRIVE)(cancel.cancel)
app.command("stop", **_ROS, rich_help_panel=_DRIVE)(trigger.stop)
app.command("reset", **_ROS, rich_help_panel=_DRIVE)(trigger.reset)

app.command("monitor", **_ROS, rich_help_panel=_LOOK)(monitor.monitor)
app.command("web", **_ROS, rich_help_panel=_LOOK)(web.web)
app.command("doctor", **_ROS, epilog=doctor.EPILOG, rich_help_panel=_LOOK)(doctor.doctor)
app.command("explain", epilog=explain.EPILOG, rich_help_panel=_LOOK)(explain.explain)
app.command("inject", epilog=inject.EPILOG, rich_help_panel=_LOOK)(inject.inject)


def _group(name: str, about: str) -> typer.Typer:
    group = typer.Typer(help=about, no_args_is_help=True)
    app.add_typer(group, name=name, rich_help_panel=_GROUPS)
    return group


_setup = _group(
    "setup", "From new drives to services: init (writes robot.yaml), commission, calibrate, install, uninstall."
)
_setup.command("init", epilog=init.EPILOG)(init.init)
_setup.command("commission", epilog=commission.EPILOG)(commission.commission)
_setup.command("calibrate", **_ROS, epilog=calibrate.EPILOG)(calibrate.calibrate)
_setup.command("install")(install.install)
_setup.command("uninstall")(install.uninstall)

app.add_typer(config.app, name="config", rich_help_panel=_GROUPS)

_bus = _group("bus", "The CAN bus and its drives: scan, dump, sdo, params, nmt, emcy, jog, adopt (node ids by LSS).")
_bus.command("scan", epilog=scan.EPILOG)(scan.scan)
_bus.command("dump", epilog=dump.EPILOG)(dump.dump)
_bus.add_typer(sdo.app, name="sdo")
_bus.add_typer(params.app, name="params")
_bus.command("nmt", epilog=nmt.EPILOG)(nmt.nmt)
_bus.command("emcy", epilog=emcy.EPILOG)(emcy.emcy)
_bus.command("jog", epilog=jog.EPILOG)(jog.jog)
_bus.command("adopt", epilog=adopt.EPILOG)(adopt.adopt)

_print = _group(
    "print", "Files, printed: sample (a robot.yaml), urdf (and ros2_control), nav2, ekf, aggregator (of diagnostics)."
)
_print.command("sample")(sample.sample)
_print.command("urdf")(urdf.urdf)
_print.command("nav2")(nav2.nav2)
_print.command("ekf")(ekf.ekf)
_print.command("aggregator")(aggregator.aggregator)

_record = _group(
    "record", "Recordings: start (or keep the last seconds), replay, export (to MCAP), bundle (for remote help)."
)
_record.command("start", **_ROS, epilog=record.EPILOG)(record.record)
_record.command("replay", epilog=replay.EPILOG)(replay.replay)
_record.command("export", epilog=export.EPILOG)(export.export)
_record.command("bundle")(support_bundle.support_bundle)

_prove = _group("prove", "qualify a robot in simulation, gather evidence, benchmark this computer.")
_prove.command("qualify", epilog=qualify.EPILOG)(qualify.qualify)
_prove.command("evidence", epilog=evidence.EPILOG)(evidence.evidence)
_prove.command("benchmark")(benchmark.benchmark)

_serve = _group("serve", "One process each: driver, velocity, action-server, watchdog, sim, metrics, vda5050.")
services.add_services(_serve)
_serve.command("metrics", **_ROS)(metrics.metrics)
_serve.command("vda5050", **_ROS)(vda5050.vda5050)

app.add_typer(fibonacci.app, name="fibonacci", rich_help_panel=_GROUPS)
