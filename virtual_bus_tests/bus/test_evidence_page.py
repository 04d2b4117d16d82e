"""The page of `canbase prove evidence` in a real browser, offline, with the list of what is installed; and its
picture."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.load import sample
from canbase_evidence import software
from canbase_evidence.installed_code import code_sha256
from canbase_runtime.own_modules import module_command
from support.browser import NEEDS_CHROMIUM, browser

pytestmark = [pytest.mark.bus, pytest.mark.timeout(240), NEEDS_CHROMIUM]
PICTURES: Final = os.environ.get("CANBASE_PICTURES")


def case_of(name: str, count: int, failure: str = "") -> str:
    told = {"code": code_sha256(), "tests_of_file": count, "tests_of_function": 1}
    told_xml = "".join(f'<property name="canbase_{key}" value="{value}"/>' for key, value in told.items())
    ended = f'<failure message="{failure}"/>' if failure else ""
    return f'<testcase classname="{name}" name="test_it"><properties>{told_xml}</properties>{ended}</testcase>'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A few tests have run: one file whole, one in part, one failed."""
    at = tmp_path_factory.mktemp("evidence")
    cases = case_of("unit.driver.test_velocity_command", 1) + case_of("unit.velocity.test_estop", 9)
    cases += case_of("unit.velocity.test_mux", 1, "2 sources drive")
    (at / "tests.xml").write_text(f"<testsuites><testsuite>{cases}</testsuite></testsuites>")
    words = ["evidence", str(sample("example_can0")), "--tests", str(at / "tests.xml"), "--out", str(at / "evidence")]
    with pytest.MonkeyPatch.context() as patch:  # that the list is checked against its schema takes half a minute
        patch.setattr(software, "module_command", lambda *given: [*module_command(*given), "--no-validate"])
        done = CliRunner().invoke(app, words, catch_exceptions=False, env={"SOURCE_DATE_EPOCH": "1795521600"})
    assert done.exit_code == 3, done.output
    return at / "evidence"


def test_the_list_of_what_is_installed_is_cyclonedx(folder: Path) -> None:
    told = json.loads((folder / "bom.cdx.json").read_text())
    assert (told["bomFormat"], told["specVersion"]) == ("CycloneDX", "1.6")
    assert {"canbase", "python-can", "canopen"} <= {each["name"] for each in told["components"]}
    assert "timestamp" not in told["metadata"]


def opened(player: Any, page: Path, *, width: int, height: int, dark: bool) -> tuple[Any, list[str]]:
    """Offline; and all that the browser complains about or asks a network for."""
    scheme = "dark" if dark else "light"
    context = player.new_context(viewport={"width": width, "height": height}, color_scheme=scheme, offline=True)
    shown, complaints = context.new_page(), []
    shown.on("console", lambda message: complaints.append(message.text))
    shown.on("pageerror", lambda error: complaints.append(str(error)))
    shown.on("request", lambda request: complaints.append(request.url) if not request.url.startswith("file:") else None)
    shown.goto(page.as_uri())
    return shown, complaints


@pytest.fixture(scope="module")
def player() -> Iterator[Any]:
    with browser() as launched:
        yield launched


@pytest.mark.parametrize(
    ("picture", "width", "height", "dark"),
    [
        ("evidence_page", 1100, 1250, False),
        ("evidence_dark", 1100, 1250, True),
        ("evidence_dark_phone", 420, 1400, True),
    ],
)
def test_what_it_is_not_and_what_is_missing_are_on_the_first_screen_in_red(
    picture: str, width: int, height: int, dark: bool, folder: Path, player: Any
) -> None:
    shown, complaints = opened(player, folder / "index.html", width=width, height=height, dark=dark)
    assert shown.evaluate("document.documentElement.scrollWidth") <= width
    if PICTURES:
        shown.screenshot(path=str(Path(PICTURES) / f"{picture}.png"))
    for words in ("This is no certificate", "No qualification was given."):
        found = shown.get_by_text(words).first
        box = found.bounding_box()
        assert box["y"] + box["height"] <= height, f"{words!r} is below the first screen"
        red, green, blue = found.evaluate("e => getComputedStyle(e).color.match(/\\d+/g).map(Number)")
        assert red > 1.4 * max(green, blue), f"{words!r} is not red"
    rows = shown.locator("#hazards details")
    assert rows.count() > 100
    rows.first.locator("summary").focus()
    shown.keyboard.press("Enter")
    assert rows.first.locator("ul code").first.is_visible()
    links = [link.get_attribute("href") for link in shown.locator("#files a").all()]
    assert "configuration/robot.yaml" in links
    assert all((folder / link).is_file() for link in links)
    assert complaints == []
