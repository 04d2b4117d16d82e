"""How often the states of the chain are published, and how old the last one may be before it is lost. One place.

Rule. One message may be lost, and the next one may be late: two periods and JITTER_S. Whoever decides with a state
takes an older one for missing. A joystick keeps the base for its timeout_s (0.3 s by default) after its last command,
so it cannot come and go between two states: it is seen, or the state is lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from canbase_config.robot import Rates

STATE_PERIOD_S: Final = 0.1
"""velocity_mux/state and safety_filter/state are published this often, and on every change."""
JITTER_S: Final = 0.1
"""A message of a loaded computer arrives this late at most: publisher, DDS, executor and control cycle together."""


def state_timeout_s(period_s: float = STATE_PERIOD_S) -> float:
    """How old the last message of a state may be that is published every `period_s` [s]."""
    return 2.0 * period_s + JITTER_S


def status_period_s(rates: Rates) -> float:
    """How often motor_driver/status is published [s]: with an odometry sample, so not more often than those, which are
    whole control cycles apart, whatever rates.status_hz is."""
    return max(1.0 / rates.status_hz, max(1, round(rates.control_hz / rates.odometry_hz)) / rates.control_hz)
