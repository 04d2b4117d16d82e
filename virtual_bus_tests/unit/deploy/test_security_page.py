"""docs/security.md against what is there: enclaves, ports, sockets, services, units."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from xml.etree import ElementTree

from canbase_cli.metrics import metrics
from canbase_cli.web import web
from unit.deploy.test_systemd_units import EXPOSURE

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "security.md").read_text("utf-8")


def test_the_table_has_every_enclave_of_the_policy_and_no_other() -> None:
    policy = ElementTree.parse(ROOT / "deploy" / "sros2" / "policy.xml").getroot()
    rows = "\n".join(line for line in PAGE.splitlines() if line.startswith("| `/canbase/"))

    assert set(re.findall(r"`(/canbase/\w+)`", rows)) == {one.attrib["path"] for one in policy.iter("enclave")}


def test_the_list_of_what_listens_has_the_port_of_each_server() -> None:
    listens = PAGE.partition("## What listens")[2].partition("\n## ")[0]
    ports = {name: inspect.signature(command).parameters["port"].default for name, command in
             (("canbase web", web), ("canbase serve metrics", metrics))}  # fmt: skip

    for name, port in ports.items():
        (row,) = [line for line in listens.splitlines() if line.startswith("|") and f"`{name}`" in line]
        assert f"TCP port {port}" in row


UNIX_SOCKETS = {
    "watchdog/canbase_watchdog/lease_socket.py": "lease socket (Unix)",
    "runtime/canbase_base/single_instance.py": "abstract Unix sockets",
    "cli/canbase_cli/demo.py": "abstract Unix sockets",
    "virtual_bus_tests/canbase_sim/control_server.py": "control socket of the simulator (Unix)",
}
"""Files that bind one, and its row."""


def test_the_list_of_what_listens_has_each_unix_socket() -> None:
    folders = [path for path in ROOT.iterdir() if list(path.glob("canbase_*"))]
    sources = [path for folder in folders for path in folder.rglob("canbase_*/**/*.py")]
    binds = {
        str(path.relative_to(ROOT))
        for path in sources
        if "AF_UNIX" in (text := path.read_text("utf-8")) and ".bind(" in text
    }
    listens = PAGE.partition("## What listens")[2].partition("\n## ")[0]

    assert len(sources) > 300
    assert binds == set(UNIX_SOCKETS)
    assert all(f"| {row}" in listens for row in UNIX_SOCKETS.values())


def test_what_dds_can_do_has_each_service_of_the_api() -> None:
    api = (ROOT / "docs" / "ros_api.md").read_text("utf-8")
    services = re.findall(r"^\| service \| `([\w/]+)`", api, re.MULTILINE)
    on_dds = PAGE.partition("### On DDS")[2].partition("\n### ")[0]

    assert len(services) >= 6
    assert [name for name in services if f"`{name}`" not in on_dds] == []


def test_the_table_has_the_exposure_of_every_unit() -> None:
    rows = re.findall(r"^\| (canbase-[^|]+) \| ([\d.]+) \|$", PAGE, re.MULTILINE)
    stated = {unit: float(most) for units, most in rows for unit in re.findall(r"canbase-([\w-]+)@", units)}

    assert stated == EXPOSURE
    assert set(EXPOSURE) == {
        re.sub(r"canbase-|@", "", path.stem) for path in (ROOT / "deploy/systemd").glob("*@.service")
    }
