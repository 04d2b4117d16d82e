"""What the watchdog needs to toggle a safety relay's line: its unit sees the chip, and its group may open it. Pure.

The chip belongs to the group canbase from then on; of the services the watchdog alone sees it.
"""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import Final

from canbase_deploy.actions import Run, WriteFile

APPLY: Final = Run(("udevadm", "trigger", "--subsystem-match=gpio", "--action=change"))
"""Chips that are there already; after `udevadm control --reload`."""
_CHIP: Final = re.compile(r"/dev/(gpiochip\d+|[A-Za-z0-9_.-]+(?:/[A-Za-z0-9_.-]+)*)")


def wrong_chip(chip: str) -> str:
    """What is wrong with `watchdog.relay.chip` for a service; empty: nothing."""
    if _CHIP.fullmatch(chip) and ".." not in chip:
        return ""
    return f"watchdog.relay.chip is {chip!r}: expected a device such as /dev/gpiochip0 (gpiodetect lists them)"


def drop_in_text(chip: str) -> str:
    """For the watchdog's unit: this device and no other."""
    return f"[Service]\nPrivateDevices=no\nDevicePolicy=closed\nDeviceAllow={chip} rw\n"


def udev_rule(name: str, chip: str, group: str) -> WriteFile:
    """The chip for the group, now (with `APPLY`) and whenever it appears; `chip` may be a link of another rule."""
    device = chip.removeprefix("/dev/")
    key = "KERNEL" if re.fullmatch(r"gpiochip\d+", device) else "SYMLINK"
    rule = f'SUBSYSTEM=="gpio", {key}=="{device}", GROUP="{group}", MODE="0660"\n'
    return WriteFile(PurePosixPath(f"/etc/udev/rules.d/80-canbase-{name}-relay.rules"), rule)
