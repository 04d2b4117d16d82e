"""How benchmarks tell what they measured, and that one which misses its budget fails."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

import kept
import run
from figures import Figure, quantile, spread

KEPT = Figure("a loop", "p99 1.00 ms", "C: p99 0.80 ms", 1.25, "≤ 1.5 × C", True)
MISSED = Figure("a node", "30 %", "bare: 10 %", 3.0, "≤ 2 × bare", False)


def test_a_quantile_is_one_of_the_values() -> None:
    values = [float(number) for number in range(1000, 0, -1)]
    assert (quantile(values, 0.5), quantile(values, 0.99), quantile(values, 1.0)) == (501.0, 991.0, 1000.0)


def test_durations_are_told_in_milliseconds() -> None:
    assert spread([0.001, 0.002, 0.003]) == "p50 2.00, p99 3.00, max 3.00 ms"


def test_the_page_says_which_budget_is_missed() -> None:
    lines = run.rewritten(f"# Title\n{run.BEGIN}\nold\n{run.END}\nend\n", "two", [KEPT, MISSED]).splitlines()
    assert "| a loop | p99 1.00 ms | C: p99 0.80 ms | 1.25 | ≤ 1.5 × C | yes |" in lines
    assert "old" not in lines
    assert (lines[0], lines[-1]) == ("# Title", "end")
    assert "| a node | 30 % | bare: 10 % | 3.00 | ≤ 2 × bare | **no** |" in lines


def test_the_page_has_the_figures_that_are_kept() -> None:
    root = Path(run.__file__).parents[1]
    page = (root / "docs" / "performance.md").read_text(encoding="utf-8")
    assert run.rewritten(page, *kept.read(root / "benchmarks" / "kept.json")) == page, "run `make bench`"


def test_a_page_without_a_place_for_the_table_is_left_alone() -> None:
    with pytest.raises(ValueError, match="the file has no lines"):
        run.rewritten("# Title\n", "two", [KEPT])


@pytest.mark.parametrize(("figure", "code"), [(KEPT, 0), (MISSED, 1)])
def test_a_missed_budget_is_a_failure(monkeypatch: pytest.MonkeyPatch, figure: Figure, code: int) -> None:
    monkeypatch.setattr(run, "BENCHMARKS", {"it": lambda: [figure]})
    monkeypatch.setattr("sys.argv", ["run.py"])
    assert run.main() == code


def test_an_unknown_name_is_refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.argv", ["run.py", "reactoin"])
    with pytest.raises(SystemExit) as end:
        run.main()
    assert end.value.code == 2
    assert "there is no benchmark reactoin; expected some of latency," in capsys.readouterr().err


def test_the_list_has_a_line_for_each_and_runs_none(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["run.py", "--list"])
    assert run.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(run.BENCHMARKS)
    assert all(len(line.split()) > 3 for line in lines)


def test_progress_tells_which_of_how_many_runs_and_how_long_it_took(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now_s = iter((0.0, 12.0, 100.0, 100.4))
    monkeypatch.setattr(run, "time", SimpleNamespace(monotonic=lambda: next(now_s)))
    monkeypatch.setattr(run, "BENCHMARKS", {"first": lambda: [KEPT], "second": lambda: [KEPT]})
    monkeypatch.setattr("sys.argv", ["run.py"])
    assert run.main() == 0
    assert capsys.readouterr().err.splitlines() == ["[1/2] first … 12 s", "[2/2] second … 0 s"]


# compared with a run before


@pytest.mark.parametrize(("ratio", "worse"), [(1.25, False), (1.56, False), (1.57, True), (0.5, False)])
def test_a_ratio_that_grows_beyond_its_noise_is_worse(tmp_path: Path, ratio: float, worse: bool) -> None:
    kept.write(tmp_path / "before.json", [KEPT])
    found = kept.losses([replace(KEPT, ratio=ratio)], kept.ratios(tmp_path / "before.json"))
    assert bool(found) is worse
    assert not worse or "a loop: ratio 1.57, it was 1.25: worse by 26%, of which 25% may be noise" in found


@pytest.mark.parametrize(("ratio", "worse"), [(1.0, False), (0.99, True), (3.0, False)])
def test_where_more_is_better_less_is_worse(ratio: float, worse: bool) -> None:
    figure = replace(KEPT, ratio=ratio, more_is_better=True)
    assert bool(kept.losses([figure], {"a loop": 1.25})) is worse


def test_a_figure_that_was_not_measured_before_or_has_no_ratio_is_not_compared() -> None:
    assert kept.losses([MISSED, replace(KEPT, ratio=None)], {"a loop": 1.25}) == []


def test_a_run_of_some_keeps_the_ratios_of_the_others(tmp_path: Path) -> None:
    path = tmp_path / "kept.json"
    kept.write(path, [KEPT, MISSED])
    kept.write(path, [replace(MISSED, ratio=2.5), replace(KEPT, what="no ratio", ratio=None)])
    assert kept.ratios(path) == {"a loop": 1.25, "a node": 2.5}
    assert [figure.what for figure in kept.read(path)[1]] == ["a loop", "a node", "no ratio"]


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"machine": "", "figures": 5}', '{"machine": "", "figures": [{"what": 1}]}']
)
def test_a_file_that_is_none_of_these_is_refused_before_anything_runs(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(ValueError, match="was not written by `canbase prove benchmark --json`"):
        kept.read(path)


def test_a_loss_is_told_and_is_no_failure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Another computer, or a busy one: whoever reads it judges."""
    path = tmp_path / "before.json"
    kept.write(path, [replace(MISSED, ratio=1.0)])
    monkeypatch.setattr(run, "QUICK", {"it": lambda: [MISSED]})
    monkeypatch.setattr("sys.argv", ["run.py", "--quick", "--compare", str(path)])
    assert run.main() == 0
    assert "warning: a node: ratio 3, it was 1: worse by 200%" in capsys.readouterr().out
