"""How fast the base may be for one property: strictly, and by each excuse that is active at this moment."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from canbase_campaign.envelope import Envelope
from canbase_campaign.excuses import Ledger
from canbase_hazards.stated_times import DISABLE_VOLTAGE_S, PRE_OPERATIONAL_S, QUICK_STOP_S

LADDER_S = QUICK_STOP_S + PRE_OPERATIONAL_S + DISABLE_VOLTAGE_S
"""The first three rungs of the watchdog's ladder (docs/bus.md), of which a second master may undo each."""


@dataclass(slots=True)
class Active:
    """What is so now. Seconds are added to the reaction time of one layer."""

    coasting: bool = False
    lost: bool = False
    second_fault_s: float = 0.0
    late_s: float = 0.0
    ladder_s: float = 0.0

    def gives_s(self) -> tuple[tuple[str, float], ...]:
        """Row and seconds of each excuse that makes the reaction longer."""
        return (
            ("second fault", self.second_fault_s),
            ("late frames", self.late_s),
            ("second master", self.ladder_s),
        )

    @property
    def more_s(self) -> float:
        """All of them together."""
        return self.second_fault_s + self.late_s + self.ladder_s


class Allowance:
    """One Envelope without any excuse, and one more for each row, which has all rows before it too."""

    ROWS = ("rolls out", "unreachable", "second fault", "late frames", "second master")

    def __init__(
        self, name: str, ledger: Ledger, react_s: float, now_s: float, coasting: float, pivot: float = 1.0
    ) -> None:
        """`react_s`: of one layer. `coasting`: of `envelope.coasting_share`. `pivot`: of `envelope.pivot_share`."""
        self._name, self._ledger, self._react_s = name, ledger, react_s
        self._pivot, self._coasts = pivot, False
        self._envelopes = [Envelope(react_s, now_s, coasting) for _ in range(len(self.ROWS) + 1)]

    def order(self, tau_s: float, now_s: float) -> None:
        """An order with this τ is given."""
        for at, envelope in enumerate(self._envelopes):
            envelope.order(tau_s * self._pivot if at and self._coasts else tau_s, now_s)

    def bound_s(self, tau_s: float, now_s: float, active: Active) -> float:
        """The greatest τ allowed now, when the base has `tau_s` [s]. To be called every step."""
        self._coasts = active.coasting
        react_s, gives = self._react_s, (0.0, 0.0, 0.0, *(seconds for _, seconds in active.gives_s()))
        row, strict_s, bound_s = "", 0.0, 0.0
        for at, (envelope, more_s) in enumerate(zip(self._envelopes, gives, strict=True)):
            react_s += more_s
            envelope.react_s = react_s
            before_s = bound_s
            bound_s = envelope.bound_s(tau_s, now_s, at > 0 and active.coasting, at > 1 and active.lost)
            if at == 0:
                strict_s = bound_s
            elif before_s < tau_s <= bound_s and not row:
                row = self.ROWS[at - 1]
        if tau_s <= strict_s or not row:
            return max(strict_s, bound_s)
        return bound_s if self._ledger.excuse(self._name, row) else strict_s


def is_late(name: str, ledger: Ledger, over_s: float, rows: Iterable[tuple[str, float]]) -> bool:
    """`over_s` beyond the strict time of a property is more than these rows give; those that are needed are counted."""
    if over_s <= 0.0:
        return False
    for row, seconds in rows:
        over_s -= seconds
        if seconds > 0.0 and over_s <= 0.0:
            return not ledger.excuse(name, row)
    return True
