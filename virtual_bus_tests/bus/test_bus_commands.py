"""`canbase bus` as a process on a bus that gives each frame back to its sender: each command that is at work there.

What they decide and say is held in virtual time: unit/commissioning/test_*_command.py.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import pytest

from support.bus_tool import canbase, drives, write_robot
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus
EDS = str(files("canbase_config").joinpath("eds/canbase_cia402.eds"))


def test_each_command_has_its_answer_from_the_drive(tmp_path: Path) -> None:
    config, saved = str(write_robot(tmp_path, free_udp_port())), str(tmp_path / "left.dcf")
    with drives(Path(config)):
        for words, told in (
            (("sdo", "write", "1", "1017", "100"), "node 1, 1017h:0 "),
            (("params", "save", "1", saved, "--eds", EDS), "31 without a value"),
            (("params", "restore", saved, "--yes"), "nothing to write"),
            (("nmt", "1", "start"), "node 1: operational\n"),
            (("emcy", "1"), "node 1: 0 errors in the history 1003h"),
        ):
            done = canbase("bus", *words, "--config", config)
            assert (done.returncode, done.stderr) == (0, "")
            assert told in done.stdout
