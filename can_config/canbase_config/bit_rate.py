"""The bit rates of CANopen (CiA 301), and one cable at several of them.

A simulated bus has no bit rate. So there is one channel for each: what is sent on it can be read at its rate alone. The
channel of robot.yaml is that of `bus.bitrate`; docs/drive_types.md describes the others.
"""

from __future__ import annotations

from typing import Final

from canbase_config.robot import Bus

BIT_RATES: Final = (1_000_000, 800_000, 500_000, 250_000, 125_000, 50_000, 20_000, 10_000)
"""[bit/s], the fastest first."""
_DEFAULT_PORT: Final = 43113
"""That of python-can for `udp_multicast`."""
_HIGHEST_PORT: Final = 65535


def bus_at(bus: Bus, bitrate: int) -> Bus:
    """The same cable at another bit rate, one of BIT_RATES."""
    if bitrate == bus.bitrate:
        return bus
    changed: dict[str, object] = {"bitrate": bitrate}
    if bus.interface == "udp_multicast":
        changed["extra"] = bus.extra | {"port": _port(int(bus.extra.get("port", _DEFAULT_PORT)), bitrate)}
    elif bus.interface == "virtual":
        changed["channel"] = f"{bus.channel} at {bitrate}"
    return bus.model_copy(update=changed)


def _port(port: int, bitrate: int) -> int:
    step = BIT_RATES.index(bitrate) + 1
    return port + step if port + len(BIT_RATES) <= _HIGHEST_PORT else port - step
