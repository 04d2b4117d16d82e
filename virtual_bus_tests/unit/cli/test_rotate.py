"""The angle of `canbase rotate`, the distance of `canbase drive`: units, and what is refused before anything moves."""

from __future__ import annotations

import math

import pytest
import typer
from typer.testing import CliRunner

from canbase_cli.drive import distance_m
from canbase_cli.main import app
from canbase_cli.rotate import angle_rad


@pytest.mark.parametrize(
    ("text", "degrees", "rad"),
    [
        ("1.57", False, 1.57),
        ("-6.2832e0", True, math.radians(-6.2832)),
        ("6.283", False, 6.283),
        ("90rad", False, 90.0),
        ("90deg", False, math.pi / 2.0),
        ("-90 DEG", False, -math.pi / 2.0),
        ("720°", False, 4.0 * math.pi),
        ("90", True, math.pi / 2.0),
        ("1rad", True, 1.0),
    ],
)
def test_an_angle_has_a_unit(text: str, degrees: bool, rad: float) -> None:
    assert angle_rad(text, degrees) == pytest.approx(rad)


@pytest.mark.parametrize("text", ["90", "-90", "6.2832"])
def test_radians_beyond_a_full_turn_need_their_unit(text: str) -> None:
    with pytest.raises(typer.BadParameter, match=f"turns in radians; write {text}deg or {text}rad"):
        angle_rad(text, degrees=False)


@pytest.mark.parametrize("text", ["", "far", "nan", "1e999", "1.2.3", "90 turns", "1,5", "."])
def test_what_is_no_angle_is_refused(text: str) -> None:
    with pytest.raises(typer.BadParameter, match="expected a number such as"):
        angle_rad(text, degrees=False)


@pytest.mark.parametrize(
    ("text", "metres"), [("1", 1.0), ("-0.5", -0.5), ("1m", 1.0), ("-50cm", -0.5), ("20 MM", 0.02), ("1e-1m", 0.1)]
)
def test_a_distance_may_have_a_unit(text: str, metres: float) -> None:
    assert distance_m(text) == pytest.approx(metres)


@pytest.mark.parametrize("text", ["", "far", "nan", "1km", "1rad", "1.2.3", "1,5"])
def test_what_is_no_distance_is_refused(text: str) -> None:
    done = CliRunner().invoke(app, ["drive", text])
    assert done.exit_code == 2
    assert "expected a number such as 1.0, 1m or 50cm" in " ".join(done.output.replace("│", " ").split())


@pytest.mark.parametrize("words", [["-90degg"], ["-90degg", "--speed", "1"], ["--json", "-90degg"]])
def test_a_negative_angle_with_a_unit_is_no_option(words: list[str]) -> None:
    done = CliRunner().invoke(app, ["rotate", *words])
    assert done.exit_code == 2
    assert "ANGLE is '-90degg'" in " ".join(done.output.split())
