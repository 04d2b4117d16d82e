"""Tables of metrics: what a metric is called, its unit, its help, and where its value is in a message. Pure.

Names and units are those of OpenMetrics: base units, spelled out at the end of the name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric, StateSetMetricFamily

PREFIX: Final = "canbase_"
Item = tuple[Sequence[str], Any]
"""Values of the labels, and the message that has the value."""


@dataclass(frozen=True, slots=True)
class Column:
    """One metric. `value`: NaN where it is not known; then there is no sample."""

    name: str
    unit: str
    help: str
    value: Callable[[Any], float]
    counter: bool = False
    """Counts events since the start of the process that publishes it; `_total` is added to its name."""


def metrics(columns: Iterable[Column], labels: Sequence[str], items: Sequence[Item]) -> Iterator[Metric]:
    """One family for each column that has a value, one sample for each item."""
    for column in columns:
        kind = CounterMetricFamily if column.counter else GaugeMetricFamily
        family = kind(PREFIX + column.name, column.help, labels=labels, unit=column.unit)
        for values, message in items:
            number = float(column.value(message))
            if not math.isnan(number):
                family.add_metric(values, number)
        if family.samples:
            yield family


def one_of(name: str, text: str, words: Iterable[str], now: str) -> StateSetMetricFamily:
    """A StateSet: 1 for the word that holds now, 0 for the others; all 0 for one that is not among them."""
    family = StateSetMetricFamily(PREFIX + name, text)
    family.add_metric((), {word: word == now for word in words})
    return family
