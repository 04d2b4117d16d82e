"""The catalogue of hazards belongs to the package, so that the commands of an installed canbase can read it."""

from __future__ import annotations

from pathlib import Path

from canbase_hazards import catalogue
from site_builder.modules import shipped_packages


def test_the_file_lies_inside_a_package_of_the_wheel() -> None:
    assert Path("qualification/canbase_hazards") in shipped_packages()
    assert catalogue.FILE.parent == Path(catalogue.__file__).parent
    assert len(catalogue.load().rows) > 100
