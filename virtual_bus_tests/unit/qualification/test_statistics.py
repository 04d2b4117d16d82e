"""Order statistics of runs: nearest rank, and a dash where there are too few."""

from __future__ import annotations

import math

import pytest

from canbase_qualification.statistics import (
    SHARES,
    Distribution,
    covered_share,
    quantile,
    runs_covering,
    runs_needed,
    thinned,
)


@pytest.mark.parametrize(("share", "runs"), [(0.5, 2), (0.99, 100), (0.999, 1000)])
def test_a_quantile_needs_one_run_beyond_it(share: float, runs: int) -> None:
    assert runs_needed(share) == runs


def test_quantiles_of_a_thousand_runs() -> None:
    found = Distribution.of([number / 1000.0 for number in range(1000, 0, -1)])
    assert [found.quantile(name) for name in SHARES] == [0.5, 0.99, 0.999]
    assert found.greatest == 1.0


def test_a_hundred_runs_have_no_quantile_beyond_the_hundredth() -> None:
    found = Distribution.of([float(number) for number in range(1, 101)])
    assert found.quantile("p99") == 99.0
    assert found.quantile("p99.9") is None
    assert Distribution.of([float(number) for number in range(99)]).quantile("p99") is None


def test_nearest_rank_is_not_moved_by_rounding() -> None:
    assert quantile([float(number) for number in range(1, 101)], 0.07) == 7.0  # 0.07 * 100 is 7.000000000000001


def test_what_never_ends_is_the_greatest() -> None:
    found = Distribution.of([0.5, math.inf, 0.4, 0.6])
    assert math.isinf(found.greatest)
    assert found.quantile("p50") == 0.5


def test_how_much_the_greatest_value_covers() -> None:
    # Wilks: 299 runs for 99 % with 95 % confidence, and 2,995 for 99.9 %.
    assert covered_share(298) < 0.99 <= covered_share(299)
    assert covered_share(2994) < 0.999 <= covered_share(2995)


def test_runs_for_a_share() -> None:
    assert [runs_covering(share) for share in (0.95, 0.99, 0.999)] == [59, 299, 2995]


def test_nothing_has_no_distribution() -> None:
    with pytest.raises(ValueError, match="at least one"):
        Distribution.of([])


def test_a_drawing_keeps_both_ends_and_the_worst_ten() -> None:
    values = [float(number) for number in range(100_000)]
    kept = thinned(values, 40)
    assert len(kept) <= 50
    assert kept[0] == 0.0
    assert kept[-10:] == tuple(values[-10:])
    assert list(kept) == sorted(set(kept))
    assert thinned(values[:50], 40) == tuple(values[:50])
