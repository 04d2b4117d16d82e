"""The page of a qualification in a real browser, from a file and without a network; and its picture for the docs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

import pytest

from canbase_config.load import sample
from canbase_qualification.report_page import page
from canbase_qualification.report_sections import sections
from support.browser import NEEDS_CHROMIUM, browser, offline_page
from support.made_results import made, passed

pytestmark = [pytest.mark.bus, pytest.mark.timeout(120), NEEDS_CHROMIUM]
DRAWN: Final = "#curve .scatterlayer .trace"
PICTURES: Final = os.environ.get("CANBASE_PICTURES")


def ticks(shown: Any) -> str:
    """The last number of the axis of the overview, with its unit."""
    return str(shown.locator("#overview .xtick").last.text_content())


def test_plots_choices_and_tables_on_a_screen_and_on_a_dark_phone(tmp_path: Path) -> None:
    report = made(passed())
    file = tmp_path / "report.html"
    file.write_text(page("canbase prove qualify: bench", report, sections(report)), encoding="utf-8")
    with browser() as player:
        shown, complaints = offline_page(player, file, DRAWN, width=1100, height=1000, dark=False)
        assert shown.evaluate("document.documentElement.scrollWidth") <= 1100
        assert shown.locator(".verdict").inner_text().startswith("No violation in 1,135 stops")
        assert shown.locator("#overview .scatterlayer .trace").count() == 5
        assert "estop pressed" in shown.locator("#overview").text_content()
        assert ticks(shown).endswith("m")
        shown.keyboard.press("Tab")  # the first link of the contents
        assert shown.evaluate("document.activeElement.getAttribute('href')") == "#distance"
        shown.get_by_label("distance", exact=True).focus()
        shown.keyboard.press("ArrowRight")
        assert ticks(shown).endswith("s")
        shown.locator("#which").select_option("estop pressed")
        assert "estop pressed, 100 runs" in shown.locator("#curve").text_content()
        rows = shown.locator("#stops tbody tr")
        assert rows.count() == 5
        shown.emulate_media(color_scheme="dark")
        shown.set_viewport_size({"width": 420, "height": 900})
        shown.reload()
        shown.wait_for_selector(DRAWN)
        assert shown.evaluate("document.documentElement.scrollWidth") <= 420
        assert [text for text in complaints if not text.startswith(("data:", "blob:"))] == []


@pytest.mark.skipif(PICTURES is None, reason="make pictures alone: it takes two minutes")
@pytest.mark.timeout(600)
def test_the_picture_of_the_docs_is_of_a_real_run(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_bytes(sample("example_can0").read_bytes())
    words = ["qualify", "robot.yaml", "--scenarios", "100", "--stops", "5", "--drives", "2", "--out", "out"]
    run = subprocess.run([sys.executable, "-P", "-m", "canbase_cli", *words], cwd=tmp_path, check=False, timeout=500)
    assert run.returncode == 0
    with browser() as player:
        shown, complaints = offline_page(
            player, tmp_path / "out" / "report.html", DRAWN, width=1100, height=900, dark=False
        )
        shown.screenshot(path=str(Path(str(PICTURES)) / "qualify_report.png"))
        shown.locator("#stops").scroll_into_view_if_needed()
        shown.locator("#overview").screenshot(path=str(Path(str(PICTURES)) / "qualify_hazards.png"))
    assert [text for text in complaints if not text.startswith(("data:", "blob:"))] == []
