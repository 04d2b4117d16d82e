"""The robot of a robot.yaml as a URDF: base, wheels, scanners, and ros2_control where it is a source. Pure.

The frames are those of `odom`, `joint_states` and the scans. robot.yaml has no heights, and no place of a wheel along
the base: they are chosen so that the picture looks right, and nothing else depends on them. Source of the format:
wiki.ros.org/urdf/XML; axes as in REP 103.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree

from canbase_config.drive import Drive
from canbase_config.robot import Robot
from canbase_config.ros2_control import joint_source, ros2_control_tag
from canbase_config.safety import Footprint, Scan

WHEEL_WIDTH = 0.4
"""Of its radius."""
BODY_HEIGHT = 1.5
"""Of the wheel radius; the body begins at half of it above the floor."""
WHEELBASE = 0.7
"""Several wheels on a side are spread over this share of the footprint's length."""
SCANNER_M = 0.05
COLOURS = {"body": "0.25 0.45 0.65 0.8", "wheel": "0.1 0.1 0.1 1", "scanner": "0.9 0.5 0.1 1"}
"""Red, green, blue and alpha, 0 to 1."""

Vector = tuple[float, float, float]


def urdf(robot: Robot) -> str:
    """The XML text of the robot; `robot.base.base_frame` is its root, on the floor between the wheels.

    A scanner whose pose comes from tf has its own frame there and is left out. Units: m, rad. Raises ValueError when
    two links would have one name, and for several sources of type joint_command.
    """
    radius_m = robot.base.wheel_radius_m
    root = ElementTree.Element("robot", name=robot.name)
    root.append(
        ElementTree.Comment(" Printed by canbase print urdf. Heights, and wheels' x, are not in robot.yaml: chosen. ")
    )
    for name, rgba in COLOURS.items():
        ElementTree.SubElement(ElementTree.SubElement(root, "material", name=name), "color", rgba=rgba)
    base = ElementTree.SubElement(root, "link", name=robot.base.base_frame)
    _body(base, robot.safety.footprint, radius_m)
    for drive, (x_m, y_m) in zip(robot.drives, wheel_places(robot), strict=True):
        _wheel(root, robot, drive, (x_m, y_m, radius_m))
    for scan in robot.safety.scans:
        if scan.pose == "config":
            _scanner(root, robot.base.base_frame, scan, (0.5 + BODY_HEIGHT) * radius_m)
    source = joint_source(robot)
    if source is not None:
        root.append(ros2_control_tag(robot, source))
    _refuse_twins([link.get("name", "") for link in root.iter("link")])
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def wheel_places(robot: Robot) -> list[tuple[float, float]]:
    """x and y of each drive's wheel in the base frame [m], in the order of robot.yaml; the first of a side in front."""
    footprint = robot.safety.footprint
    half_m = WHEELBASE * min(footprint.front_m, footprint.rear_m)
    places = {}
    for side, sign in (("left", 1), ("right", -1)):
        drives = [drive for drive in robot.drives if drive.side == side]
        for drive, x_m in zip(drives, _spread(len(drives), half_m), strict=True):
            places[drive.joint] = (x_m, sign * robot.base.track_m / 2)
    return [places[drive.joint] for drive in robot.drives]


def scanner_frame(scan: Scan) -> str:
    """The name of the link of a scanner with its pose in robot.yaml: its topic, `/` replaced by `_`."""
    return scan.topic.strip("/").replace("/", "_")


def _refuse_twins(names: Sequence[str]) -> None:
    twins = sorted({name for name in names if names.count(name) > 1})
    if twins:
        raise ValueError(
            f"two frames would be called {', '.join(twins)}: rename base.base_frame, a drive's joint, or a scan's topic"
        )


def _spread(count: int, half_m: float) -> Sequence[float]:
    if count == 1:
        return (0.0,)
    return [half_m - 2 * half_m * i / (count - 1) for i in range(count)]


def _body(link: ElementTree.Element, footprint: Footprint, radius_m: float) -> None:
    length_m, width_m = footprint.front_m + footprint.rear_m, footprint.left_m + footprint.right_m
    height_m = BODY_HEIGHT * radius_m
    middle = ((footprint.front_m - footprint.rear_m) / 2, (footprint.left_m - footprint.right_m) / 2)
    shape = _shape(link, "body", (*middle, 0.5 * radius_m + height_m / 2))
    ElementTree.SubElement(shape, "box", size=_text((length_m, width_m, height_m)))


def _wheel(root: ElementTree.Element, robot: Robot, drive: Drive, place_m: Vector) -> None:
    """A joint that turns about +y, as a positive `joint_states` velocity drives the base forward (REP 103)."""
    link = ElementTree.SubElement(root, "link", name=f"{drive.joint}_link")
    radius_m = robot.base.wheel_radius_m
    shape = _shape(link, "wheel", (0.0, 0.0, 0.0), (math.pi / 2, 0.0, 0.0))
    ElementTree.SubElement(shape, "cylinder", radius=f"{radius_m:g}", length=f"{WHEEL_WIDTH * radius_m:g}")
    joint = _joint(root, drive.joint, "continuous", robot.base.base_frame, f"{drive.joint}_link", place_m)
    ElementTree.SubElement(joint, "axis", xyz="0 1 0")


def _scanner(root: ElementTree.Element, base_frame: str, scan: Scan, height_m: float) -> None:
    frame = scanner_frame(scan)
    link = ElementTree.SubElement(root, "link", name=frame)
    ElementTree.SubElement(
        _shape(link, "scanner", (0.0, 0.0, 0.0)), "cylinder", radius=f"{SCANNER_M / 2:g}", length=f"{SCANNER_M:g}"
    )
    turn = (math.pi if scan.upside_down else 0.0, 0.0, scan.yaw_rad)
    _joint(root, f"{frame}_mount", "fixed", base_frame, frame, (scan.x_m, scan.y_m, height_m), turn)


def _joint(
    root: ElementTree.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    place_m: Vector,
    turn: Vector | None = None,
) -> ElementTree.Element:
    joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    ElementTree.SubElement(joint, "origin", xyz=_text(place_m), rpy=_text(turn or (0.0, 0.0, 0.0)))
    return joint


def _shape(
    link: ElementTree.Element, material: str, place_m: Vector, turn: Vector = (0.0, 0.0, 0.0)
) -> ElementTree.Element:
    """The geometry of a new visual of this link."""
    visual = ElementTree.SubElement(link, "visual")
    ElementTree.SubElement(visual, "origin", xyz=_text(place_m), rpy=_text(turn))
    geometry = ElementTree.SubElement(visual, "geometry")
    ElementTree.SubElement(visual, "material", name=material)
    return geometry


def _text(numbers: Sequence[float]) -> str:
    return " ".join(f"{number:.6g}" for number in numbers)
