"""A CAN interface whose controller was bus-off before this process began, as the kernel shows it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from canbase_base.carrier import is_without_carrier

CAN0 = {"interface": "socketcan", "channel": "can0"}


def interfaces(folder: Path, carrier: str) -> Path:
    (folder / "can0").mkdir()
    (folder / "can0" / "carrier").write_text(f"{carrier}\n", encoding="ascii")
    return folder


@pytest.mark.parametrize(("carrier", "without"), [("0", True), ("1", False)])
def test_a_controller_that_is_bus_off_has_no_carrier(carrier: str, without: bool, tmp_path: Path) -> None:
    assert is_without_carrier(CAN0, interfaces(tmp_path, carrier)) is without


@pytest.mark.parametrize(
    "arguments",
    [
        {"interface": "virtual", "channel": "can0"},
        {"interface": "udp_multicast", "channel": "239.0.0.1", "port": 1},
        {"interface": "socketcan", "channel": "can1"},  # there is no such one; one that is down cannot be read either
        {"interface": "socketcan"},
    ],
    ids=["virtual", "udp", "unknown", "no channel"],
)
def test_where_the_kernel_does_not_tell_nothing_is_claimed(arguments: dict[str, Any], tmp_path: Path) -> None:
    assert not is_without_carrier(arguments, interfaces(tmp_path, "0"))
