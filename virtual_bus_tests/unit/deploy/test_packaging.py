"""What several files must say alike: versions, package folders, the kind of package; and what the watchdog imports.

Reads the files of the checkout; builds and installs nothing.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    from pip._vendor import tomli as tomllib

ROOT = Path(__file__).parents[3]
WATCHDOG = sorted(file for name in ("watchdog", "base") for file in ROOT.glob(f"*/canbase_{name}/*.py"))
WATCHDOG_MAY_IMPORT = sys.stdlib_module_names | {"can", "canbase_base", "canbase_watchdog", "canbase_config.watchdog"}


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def pyproject() -> dict[str, Any]:
    return tomllib.loads(read("pyproject.toml"))


def package_xml(name: str = "package.xml") -> ElementTree.Element:
    return ElementTree.fromstring(read(name))


def test_pyproject_package_xml_and_changelog_name_the_same_version() -> None:
    version = pyproject()["project"]["version"]

    newest = re.search(r"^## \[([^\]]+)\]", read("CHANGELOG.md"), re.MULTILINE)

    assert package_xml().findtext("version") == version
    assert newest is not None
    assert newest[1] == version


def test_both_builds_install_the_same_python_packages_and_leave_none_out() -> None:
    packed_by_pip = pyproject()["tool"]["scikit-build"]["wheel"]["packages"]
    installed_by_colcon = re.findall(r"\b\w+/canbase_\w+", read("CMakeLists.txt"))
    in_the_tree = [str(init.parent.relative_to(ROOT)) for init in ROOT.glob("*/canbase_*/__init__.py")]

    assert sorted(packed_by_pip) == sorted(in_the_tree)
    assert sorted(installed_by_colcon) == sorted(in_the_tree)


def test_every_import_rule_knows_all_python_packages() -> None:
    packages = sorted(Path(folder).name for folder in pyproject()["tool"]["scikit-build"]["wheel"]["packages"])

    assert sorted(pyproject()["tool"]["importlinter"]["root_packages"]) == packages


@pytest.mark.parametrize("name", ["package.xml", "interfaces/tf2_msgs/package.xml", "interfaces/nav2_msgs/package.xml"])
def test_ros_tools_see_an_ament_cmake_package_with_interfaces(name: str) -> None:
    package = package_xml(name)

    assert package.findtext("export/build_type") == "ament_cmake"
    assert package.findtext("member_of_group") == "rosidl_interface_packages"


def test_a_maintainer_address_is_one_that_colcon_accepts() -> None:
    maintainer = package_xml().find("maintainer")

    assert maintainer is not None
    assert re.fullmatch(r"[\w.+-]+@[\w-]+(\.[\w-]+)+", maintainer.attrib["email"])


def test_the_ros_wheels_stay_an_extra() -> None:
    project = pyproject()["project"]

    assert [name for name in project["dependencies"] if name.startswith("ros-")] == []
    assert [name for name in project["optional-dependencies"]["ros"] if not name.startswith("ros-jazzy-")] == []


def imported_modules(source: str) -> set[str]:
    """Modules that a source imports, at any depth of its blocks."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        if isinstance(node, ast.ImportFrom):
            found.add(node.module or "")
    return found


def allowed(module: str) -> bool:
    return module in WATCHDOG_MAY_IMPORT or module.partition(".")[0] in WATCHDOG_MAY_IMPORT


@pytest.mark.parametrize("file", WATCHDOG, ids=lambda file: f"{file.parent.name}/{file.name}")
def test_the_watchdog_imports_only_the_standard_library_python_can_its_base_and_its_dataclass(file: Path) -> None:
    strangers = {module for module in imported_modules(file.read_text(encoding="utf-8")) if not allowed(module)}

    assert strangers == set()


def test_a_stranger_in_the_watchdog_would_be_noticed() -> None:
    source = "import time, can.interface\ndef f():\n    from canbase_config.robot import Robot\n    import rclpy.node\n"

    strangers = {module for module in imported_modules(source) if not allowed(module)}

    assert strangers == {"canbase_config.robot", "rclpy.node"}
