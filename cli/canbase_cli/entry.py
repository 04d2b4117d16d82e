"""Where `canbase` begins. A service runs for as long as the robot does: it imports its own command and no other."""

from __future__ import annotations

import os
import sys

from canbase_cli.options import new_app
from canbase_cli.services import SERVICES, add_services
from canbase_runtime.terminal import filter_output


def main() -> None:
    """The command line of this process, to its end."""
    filter_output()
    # Plugins of pydantic would be code of others in each service, and are looked for in all that is installed.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    if sys.argv[1:2] == ["serve"] and sys.argv[2:3] and sys.argv[2] in SERVICES:
        app, serve = new_app(), new_app()
        add_services(serve)
        app.add_typer(serve, name="serve")
    else:
        from canbase_cli.main import app
    app(prog_name="canbase")
