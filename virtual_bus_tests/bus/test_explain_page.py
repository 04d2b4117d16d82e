"""The page of `canbase explain` in a real browser, from a file and without a network; and its pictures for the docs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.load import sample
from support.browser import NEEDS_CHROMIUM, browser, offline_page

pytestmark = [pytest.mark.bus, pytest.mark.timeout(120), NEEDS_CHROMIUM]
DATA: Final = Path(__file__).parent.parent / "unit" / "recording" / "data"
DRAWN: Final = "#plot1 .bars .point"
PICTURES: Final = os.environ.get("CANBASE_PICTURES")


def page_of(recording: str, folder: Path) -> Path:
    target = folder / "stop.html"
    words = ["explain", str(DATA / recording), "--config", str(sample("bench")), "--html", str(target)]
    assert CliRunner().invoke(app, words, catch_exceptions=False).exit_code == 0
    return target


def test_plots_tables_and_filter_on_a_screen_and_on_a_dark_phone(tmp_path: Path) -> None:
    page = page_of("cable_of_left_wheel_cut.asc", tmp_path)
    with browser() as player:
        shown, complaints = offline_page(player, page, DRAWN, width=1100, height=1250, dark=False)
        assert shown.evaluate("document.documentElement.scrollWidth") <= 1100
        assert shown.locator("#plot1 .scatterlayer .trace").count() >= 6
        assert shown.locator("#load .scatterlayer .trace").count() == 1
        rows = shown.locator("#frames1 tbody tr")
        assert rows.count() > 100
        shown.locator("#frames1 input").fill("1fe tripped")
        assert 0 < rows.count() < 60
        assert all("tripped" in text for text in rows.all_inner_texts())
        shown.locator("#frames1 input").fill("")
        shown.locator("#frames1 select").select_option("nmt")
        assert all("NMT" in text for text in rows.all_inner_texts())
        shown.emulate_media(color_scheme="dark")
        shown.set_viewport_size({"width": 420, "height": 900})
        shown.reload()
        shown.wait_for_selector(DRAWN)
        assert shown.evaluate("document.documentElement.scrollWidth") <= 420
        assert complaints == []


@pytest.mark.skipif(PICTURES is None, reason="make pictures alone")
@pytest.mark.parametrize(
    ("recording", "picture", "width", "height", "dark"),
    [
        ("cable_of_left_wheel_cut.asc", "explain_cable", 1100, 1250, False),
        ("encoder_of_left_wheel_lost.asc", "explain_encoder_dark_phone", 420, 1400, True),
    ],
)
def test_the_pictures_of_the_docs(
    recording: str, picture: str, width: int, height: int, dark: bool, tmp_path: Path
) -> None:
    with browser() as player:
        shown, complaints = offline_page(
            player, page_of(recording, tmp_path), DRAWN, width=width, height=height, dark=dark
        )
        shown.wait_for_timeout(300)
        shown.screenshot(path=str(Path(str(PICTURES)) / f"{picture}.png"))
    assert complaints == []
