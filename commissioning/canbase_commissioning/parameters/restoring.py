"""Carries out a plan: each write only while no motor has power, each value read back. CiA 301."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.parameters.guard import why_not_now
from canbase_commissioning.parameters.parameter_kinds import is_pdo
from canbase_commissioning.parameters.restore_plan import Change, Order, Plan, pdo_of
from canbase_commissioning.parameters.value_text import to_text
from canbase_driver.boot.steps import Steps
from canbase_driver.cia301.sdo_block import BlockRead, BlockWrite
from canbase_driver.cia301.sdo_client import Read, SdoAborted, SdoTimeout, Write, abort_text

EXPEDITED_BYTES: Final = 4
STAYS_OFF: Final = "the PDO stays off, because a part of it was refused"


@dataclass(slots=True)
class Restored:
    """What has been done so far. `stopped`: why not everything was tried; empty: it was."""

    total: int
    orders: int = 0
    """Carried out."""
    written: list[Change] = field(default_factory=list)
    failed: list[tuple[Change, str]] = field(default_factory=list)
    stopped: str = ""


def restore(
    plan: Plan, status_at: Sequence[Address], so_far: Restored, *, without_statusword: bool = False
) -> Steps[Restored]:
    """Writes what the plan orders. A refused setting is tried once more at the end: another may have kept it out.

    A PDO of which a part is refused stays off.
    """
    restoring = _Restoring(status_at, so_far, without_statusword)
    try:
        yield from restoring.run(plan.orders)
        again, restoring.again = restoring.again, []
        changes = [order.change for order in again]
        so_far.failed = [each for each in so_far.failed if each[0] not in changes]
        yield from restoring.run(again)
    except SdoTimeout as error:
        so_far.stopped = str(error)
    return so_far


class _Restoring:
    def __init__(self, status_at: Sequence[Address], so_far: Restored, without_statusword: bool) -> None:
        self.again: list[Order] = []
        self._status_at, self._so_far, self._without_statusword = status_at, so_far, without_statusword
        self._off: set[int] = set()
        """PDOs of which a part was refused, by 1400h… and 1800h…."""

    def run(self, orders: Sequence[Order]) -> Steps[None]:
        for order in orders:
            if is_pdo(order.at) and pdo_of(order.at) in self._off:
                if order.change is not None:
                    self._so_far.failed.append((order.change, STAYS_OFF))
                continue
            self._so_far.stopped = yield from why_not_now(
                self._status_at, without_statusword=self._without_statusword, motion=self._so_far.orders == 0
            )
            if self._so_far.stopped:
                return
            why = yield from _carry_out(order)
            self._so_far.orders += 1
            self._note(order, why)

    def _note(self, order: Order, why: str) -> None:
        if why:
            change = order.change or Change(order.at, "", order.data, b"")
            self._so_far.failed.append((change, why))
            if is_pdo(order.at):
                self._off.add(pdo_of(order.at))
            elif order.change is not None:
                self.again.append(order)
        elif order.change is not None:
            self._so_far.written.append(order.change)


def _carry_out(order: Order) -> Steps[str]:
    """Why it was not written; empty: it was, and has been read back."""
    at, is_long = order.at, len(order.data) > EXPEDITED_BYTES
    try:
        yield (BlockWrite if is_long else Write)(at.index, at.sub, order.data)
    except SdoAborted as refused:
        return abort_text(refused.code)
    if order.change is None:
        return ""
    try:
        found: bytes = yield (BlockRead if is_long else Read)(at.index, at.sub)
    except SdoAborted as refused:
        return f"written, but it cannot be read back: {abort_text(refused.code)}"
    return "" if found == order.data else f"it reads back {to_text(found, order.change.data_type)}"
