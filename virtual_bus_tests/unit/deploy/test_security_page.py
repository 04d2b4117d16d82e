"""docs/security.md against what is there: enclaves, ports."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from xml.etree import ElementTree

from canbase_cli.metrics import metrics
from canbase_cli.web import web

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "security.md").read_text("utf-8")


def test_the_table_has_every_enclave_of_the_policy_and_no_other() -> None:
    policy = ElementTree.parse(ROOT / "deploy" / "sros2" / "policy.xml").getroot()
    rows = "\n".join(line for line in PAGE.splitlines() if line.startswith("| `/canbase/"))

    assert set(re.findall(r"`(/canbase/\w+)`", rows)) == {one.attrib["path"] for one in policy.iter("enclave")}


def test_the_list_of_what_listens_has_the_port_of_each_server() -> None:
    listens = PAGE.partition("## What listens")[2].partition("\n## ")[0]
    ports = {name: inspect.signature(command).parameters["port"].default for name, command in
             (("canbase web", web), ("canbase metrics", metrics))}  # fmt: skip

    for name, port in ports.items():
        (row,) = [line for line in listens.splitlines() if line.startswith("|") and f"`{name}`" in line]
        assert f"TCP port {port}" in row
