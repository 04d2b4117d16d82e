"""A mux whose base can move and whose sources may drive, for tests of everything but the neutral start."""

from __future__ import annotations

import math
from collections.abc import Mapping

from canbase_config.mux import DEFAULT_SOURCES, MuxLock, MuxSource
from canbase_runtime.driver_state import DriverState
from canbase_velocity.mux import Mux


def rested(
    sources: Mapping[str, MuxSource] = DEFAULT_SOURCES,
    locks: Mapping[str, MuxLock] | None = None,
    *,
    foreign_lock: bool = False,
) -> Mux:
    """A mux whose base is always ready and whose sources are all armed, by absence: there was no message yet."""
    patient = {name: source.model_copy(update={"neutral_after_s": 1.0}) for name, source in sources.items()}
    mux = Mux(patient, locks, foreign_lock=foreign_lock, status_timeout_s=math.inf)
    mux.on_estop(True)
    mux.on_driver(DriverState.ENABLED, 1, -10.0)
    for step in range(12):
        mux.decide(-10.0 + 0.1 * step)
    return mux
