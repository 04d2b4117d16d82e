"""`canbase setup install` and `uninstall`: a robot's services on this computer. What they are: canbase_deploy."""

from __future__ import annotations

import os
import sys
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from canbase_cli.options import NamespaceOption
from canbase_runtime.terminal import FAILED, WRONG_INPUT, CommandError, colour, fail, load_config

if TYPE_CHECKING:
    from canbase_config.load import Loaded


class Network(str, Enum):
    """Who may be on the robot's ROS network."""

    LOCALHOST = "localhost"
    LAN = "lan"


PrefixOption = Annotated[
    Path, typer.Option("--prefix", metavar="DIR", help="Write below DIR, an image's root; run no command.")
]
DryRunOption = Annotated[bool, typer.Option("--dry-run", help="Print the steps and what refuses them; change nothing.")]


def install(
    config: Annotated[
        Path | None,
        typer.Option("--config", "-c", metavar="FILE", help="The robot.yaml.", show_default="the installed one"),
    ] = None,
    name: Annotated[
        str, typer.Option("--name", metavar="NAME", help="Name of the robot.", show_default="name in robot.yaml")
    ] = "",
    prefix: PrefixOption = Path("/"),
    dry_run: DryRunOption = False,
    python: Annotated[
        str,
        typer.Option(metavar="PATH", help="Python that runs the services, for an image.", show_default="this one"),
    ] = sys.executable,
    network: Annotated[Network, typer.Option(help="Which computers can reach the ROS nodes.")] = Network.LOCALHOST,
    can: Annotated[bool, typer.Option("--can/--no-can", help="Bring the CAN interface up.")] = True,
    adapter: Annotated[
        str, typer.Option(metavar="PROPERTY=VALUE", help="udev property of the adapter that gets the channel's name.")
    ] = "",
    namespace: NamespaceOption = "",
    cpus: Annotated[str, typer.Option(metavar="LIST", help="CPUs for the services, such as 2,3.")] = "",
    sros2: Annotated[bool, typer.Option("--sros2", help="Enforce SROS2, with /etc/canbase/keys.")] = False,
    hardware_watchdog: Annotated[
        int, typer.Option(metavar="SECONDS", min=0, max=600, help="Let a hardware watchdog reset a frozen computer.")
    ] = 0,
) -> None:
    """Install the robot's services; they start at boot, without a login.

    Installs the units, the user canbase, robot.yaml and the files it names (mode 0640), and the CAN interface. Can be
    repeated at any time: changes of the owner in /etc/canbase are kept, and a replaced file is kept as .old.

    Exit codes: 0 done, 1 a step failed, 2 wrong command line or robot.yaml, or a robot that services cannot run.
    """
    from canbase_deploy.execute import ExecuteError, Executor
    from canbase_deploy.host import (
        chosen,
        environment,
        folders,
        manifests,
        named_texts,
        neighbours,
        refuse_keystore,
        refuse_others,
        refuse_running,
        rehearse,
        sourced,
        templates,
    )
    from canbase_deploy.owner import owner_paths
    from canbase_deploy.plan import (
        InstallError,
        Request,
        install_plan,
        left_interfaces,
        network_warning,
        next_step,
    )

    loaded = load_config(config) if config else _installed(prefix / owner_paths(name or "robot")[0].relative_to("/"))
    executor = Executor(prefix, typer.echo, dry_run=dry_run)
    try:
        request = Request(
            name=name or loaded.robot.name,
            robot=loaded.robot,
            yaml=None if config is None else config.read_text(encoding="utf-8"),
            python=python,
            templates=templates(),
            environment=chosen(os.environ),
            sourced=sourced(os.environ),
            network=network.value,
            bring_up_can=can,
            adapter=adapter,
            cpus=cpus,
            hardware_watchdog_s=hardware_watchdog,
            sros2=sros2,
            files={} if config is None else named_texts(loaded.files),
            namespace=namespace,
            kept=environment(prefix, name or loaded.robot.name),
        )
        installed = manifests(prefix)
        others = neighbours(prefix, request.name, installed)
        plan = install_plan(request, installed, others)
        if dry_run:
            executor.carry_out(plan)  # shows the steps, also where a check below refuses them
        if prefix == Path("/"):
            refuse_running(request.name, left_interfaces(request, installed, others))
            if sros2:
                refuse_keystore()
            outside = [name for name in loaded.files if Path(name).is_absolute()]
            refuse_others([python, *folders(request.sourced), *outside])  # before anything of it runs
            refuse_others(rehearse(python, request.sourced, relay=loaded.robot.watchdog.relay is not None))
        if not dry_run:
            executor.carry_out(plan)
    except (InstallError, ExecuteError) as error:
        fail(str(error), WRONG_INPUT if isinstance(error, InstallError) else FAILED)
    if warning := network_warning(request, environment(prefix, request.name)):
        typer.secho(warning, err=True, fg=typer.colors.YELLOW, color=colour())
    if not dry_run and prefix == Path("/"):
        typer.echo(next_step(request, executor.changed, upgrade=request.name in installed))


def _installed(path: Path) -> Loaded:
    """The robot that is installed. Ends the command where this version cannot use it, such as for want of a key."""
    from canbase_deploy.host import UNCHANGED

    try:
        return load_config(path)
    except CommandError:
        if path.is_file():
            advice = f"Write into a copy of {path} what is missing, then: sudo canbase setup install --config COPY."
            typer.echo(f"{UNCHANGED} {advice}", err=True)
        raise


def uninstall(
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="Name of the robot.")] = "robot",
    prefix: PrefixOption = Path("/"),
    dry_run: DryRunOption = False,
    purge: Annotated[
        bool, typer.Option("--purge", help="Remove its robot.yaml, the files this names, and its environment too.")
    ] = False,
) -> None:
    """Stop and remove a robot's services. robot.yaml is kept, except with --purge.

    Exit codes: 0 done, 1 a step failed, 2 no such robot.
    """
    from canbase_deploy.execute import ExecuteError, Executor
    from canbase_deploy.host import manifests
    from canbase_deploy.plan import InstallError, uninstall_plan

    try:
        Executor(prefix, typer.echo, dry_run=dry_run).carry_out(uninstall_plan(name, manifests(prefix), purge=purge))
    except (InstallError, ExecuteError) as error:
        fail(str(error), WRONG_INPUT if isinstance(error, InstallError) else FAILED)
