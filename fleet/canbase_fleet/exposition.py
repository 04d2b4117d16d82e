"""All metrics of one robot, and their text: OpenMetrics, or the older Prometheus format for who asks for that. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from prometheus_client import exposition as prometheus
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, InfoMetricFamily, Metric
from prometheus_client.openmetrics import exposition as openmetrics

from canbase_config.robot import Robot
from canbase_fleet.columns import PREFIX
from canbase_fleet.driver_metrics import driver_metrics
from canbase_fleet.robot_view import RobotView
from canbase_fleet.velocity_metrics import filter_metrics, mux_metrics

PLAIN: Final = "text/plain; version=0.0.4; charset=utf-8"


class Exposition:
    """What is exposed of one robot: a Collector of prometheus_client for one `RobotView`."""

    def __init__(self, view: RobotView, robot: Robot, version: str) -> None:
        self._view, self._robot, self._version = view, robot, version

    def collect(self) -> Iterator[Metric]:
        """What is not known has no sample; `canbase_data_age_seconds` says of each topic how old the rest is.

        A topic without a message for 1.5 s: all its metrics go. An alert that looks at them alone would never fire.
        """
        yield InfoMetricFamily("canbase", "This robot.", {"robot": self._robot.name, "version": self._version})
        yield from self._own()
        view = self._view
        if view.driver.fresh:
            yield from driver_metrics(view.driver.message, self._robot)
        if view.safety.fresh:
            yield from filter_metrics(view.safety.message, self._robot)
        if view.mux.fresh:
            yield from mux_metrics(view.mux.message, self._robot)

    def _own(self) -> Iterator[Metric]:
        ages = GaugeMetricFamily(
            f"{PREFIX}data_age",
            "Age of the last message of a topic; +Inf: none came.",
            labels=("topic",),
            unit="seconds",
        )
        for topic, last in self._view.topics.items():
            ages.add_metric((topic,), math.inf if last.age_s is None else last.age_s)
        yield ages
        stops = CounterMetricFamily(
            f"{PREFIX}stops", "Stops since canbase serve metrics was started.", labels=("stopped_by", "cause")
        )
        for kind, count in self._view.stops.items():
            stops.add_metric(kind, count)
        yield stops
        yield CounterMetricFamily(
            f"{PREFIX}messages_dropped", "Messages too large to be real, or unreadable.", self._view.dropped
        )

    def text(self, plain: bool) -> tuple[bytes, str]:
        """The text and its content type: OpenMetrics; `plain`: the older format of Prometheus."""
        if plain:
            return prometheus.generate_latest(self), PLAIN
        return openmetrics.generate_latest(self), openmetrics.CONTENT_TYPE_LATEST
