"""The share of its time that a bus is busy, from counters of frames."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from canbase_config.bus_load import frame_bits, traffic_bits
from canbase_driver.runtime.bus_traffic import MeasuredLoad, Traffic, interface_traffic

LENGTHS = (8, 0, 1, 5, 8)


def counters(folder: Path, **values: object) -> Path:
    statistics = folder / "can0" / "statistics"
    statistics.mkdir(parents=True)
    for name, value in values.items():
        (statistics / name).write_text(f"{value}\n", encoding="ascii")
    return folder


def test_bits_of_counters_are_those_of_the_frames_one_by_one() -> None:
    assert traffic_bits(len(LENGTHS), sum(LENGTHS)) == sum(map(frame_bits, LENGTHS))


def test_the_load_is_that_of_the_time_between_two_looks() -> None:
    """1,000 frames of 8 bytes in 1 s on 500 kbit/s: 135 bits each, 27 %; then half a second without any."""
    load = MeasuredLoad(500_000)
    assert math.isnan(load.measure(Traffic(50, 400), 10.0))
    assert load.measure(Traffic(1050, 8400), 11.0) == pytest.approx(0.27)
    assert load.measure(Traffic(1050, 8400), 11.5) == 0.0


def test_a_look_too_soon_keeps_what_is_known() -> None:
    load = MeasuredLoad(500_000)
    load.measure(Traffic(0, 0), 10.0)
    known = load.measure(Traffic(1000, 8000), 11.0)
    assert load.measure(Traffic(1009, 8072), 11.01) == known == load.share


def test_after_an_interface_was_made_anew_the_load_is_unknown_once() -> None:
    load = MeasuredLoad(500_000)
    load.measure(Traffic(5000, 40_000), 10.0)
    assert math.isnan(load.measure(Traffic(3, 24), 11.0))
    assert load.measure(Traffic(3, 24), 12.0) == 0.0


def test_the_kernel_counts_both_ways(tmp_path: Path) -> None:
    folder = counters(tmp_path, rx_packets=700, tx_packets=300, rx_bytes=5000, tx_bytes=2400)
    assert interface_traffic({"channel": "can0"}, folder) == Traffic(1000, 7400)


@pytest.mark.parametrize("content", ["", "many"])
def test_counters_that_cannot_be_read_are_none(tmp_path: Path, content: str) -> None:
    assert interface_traffic({"channel": "can0"}, tmp_path) is None
    folder = counters(tmp_path, rx_packets=content, tx_packets=1, rx_bytes=1, tx_bytes=1)
    assert interface_traffic({"channel": "can0"}, folder) is None
