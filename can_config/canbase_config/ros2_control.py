"""What ros2_control needs of a robot.yaml: its tag in the URDF, and the parameters of diff_drive_controller. Pure.

The tag is that of joint_state_topic_hardware_interface 1.1.0 (its README), the parameters those of
diff_drive_controller 6.9.0 (diff_drive_controller_parameter.yaml). docs/ros2_control.md has both.
"""

from __future__ import annotations

import json
from typing import Final
from xml.etree import ElementTree

from canbase_config.drive import Drive
from canbase_config.mux import JOINTS, MEASURED, MuxSource
from canbase_config.robot import Robot

PLUGIN: Final = "joint_state_topic_hardware_interface/JointStateTopicSystem"
NAME: Final = "canbase_wheels"
"""Of the tag, and so of the ROS node that publishes the commands."""
ALWAYS: Final = "-1"
"""Threshold below which the hardware publishes nothing. With its default it is silent while the wheels turn as ordered,
so that the mux stops the base, and at rest, so that the mux never receives a zero."""
CONTROLLER: Final = "diff_drive_controller"
TIMEOUT_S: Final = 0.5
"""The controller's own default: without a new cmd_vel for longer it commands zero [s]."""


def joint_source(robot: Robot) -> MuxSource | None:
    """The source that ros2_control publishes; None: there is none. Raises ValueError for several."""
    found = {name: source for name, source in robot.mux.sources.items() if source.type == JOINTS}
    if len(found) > 1:
        names = ", ".join(found)
        raise ValueError(f"mux.sources has several of type {JOINTS} ({names}): a URDF has the wheels in one tag")
    return next(iter(found.values()), None)


def ros2_control_tag(robot: Robot, source: MuxSource) -> ElementTree.Element:
    """The <ros2_control> tag whose hardware publishes the topic of `source`."""
    tag = ElementTree.Element("ros2_control", name=NAME, type="system")
    hardware = ElementTree.SubElement(tag, "hardware")
    ElementTree.SubElement(hardware, "plugin").text = PLUGIN
    hardware.append(ElementTree.Comment(" -1: publish every command. With 0 or more the mux receives nothing while "))
    hardware.append(ElementTree.Comment(" the wheels turn as ordered, or at rest, and stops the base. "))
    topics = {"joint_commands_topic": source.topic, "joint_states_topic": MEASURED}
    for name, value in {**topics, "trigger_joint_command_threshold": ALWAYS}.items():
        ElementTree.SubElement(hardware, "param", name=name).text = value
    for drive in robot.drives:
        tag.append(_joint(drive))
    return tag


def _joint(drive: Drive) -> ElementTree.Element:
    """Every value that joint_states has needs its interface: the hardware ends with an error for one that is missing.

    Velocities begin with 0 and not with NaN: a zero arms the source, and the controller ends at a NaN of its feedback.
    """
    joint = ElementTree.Element("joint", name=drive.joint)
    _initial_zero(ElementTree.SubElement(joint, "command_interface", name="velocity"))
    ElementTree.SubElement(joint, "state_interface", name="position")
    _initial_zero(ElementTree.SubElement(joint, "state_interface", name="velocity"))
    if drive.rated_torque_nm is not None:
        ElementTree.SubElement(joint, "state_interface", name="effort")
    return joint


def _initial_zero(interface: ElementTree.Element) -> None:
    ElementTree.SubElement(interface, "param", name="initial_value").text = "0.0"


def controllers(robot: Robot) -> str:
    """controllers.yaml of controller_manager and diff_drive_controller. Units: m, m/s, m/s², rad/s, rad/s².

    Raises ValueError without a source that takes its commands, and where the sides have different numbers of wheels,
    which the controller refuses.
    """
    if joint_source(robot) is None:
        key = f"control: {{topic: {JOINTS}, type: {JOINTS}, priority: 60, timeout_s: 0.3}}"
        raise ValueError(f"no source of robot.yaml takes wheel speeds; add below mux.sources, for example, {key}")
    left, right = ([drive.joint for drive in robot.drives if drive.side == side] for side in ("left", "right"))
    if len(left) != len(right):
        sides = f"{len(left)} on the left, {len(right)} on the right"
        raise ValueError(f"{CONTROLLER} needs as many wheels on each side; drives has {sides}")
    base, limits = robot.base, robot.limits
    return _TEMPLATE.format(
        controller=CONTROLLER,
        update_hz=round(robot.rates.command_hz),
        left=", ".join(map(json.dumps, left)),
        right=", ".join(map(json.dumps, right)),
        track_m=float(base.track_m),
        radius_m=float(base.wheel_radius_m),
        left_share=round(base.radius_m("left") / base.wheel_radius_m, 6),
        right_share=round(base.radius_m("right") / base.wheel_radius_m, 6),
        odom_frame=json.dumps(base.odom_frame),
        base_frame=json.dumps(base.base_frame),
        timeout_s=TIMEOUT_S,
        linear=float(limits.linear_mps),
        acceleration=float(limits.acceleration_mps2),
        deceleration=float(limits.deceleration_mps2),
        angular=float(limits.angular_radps),
        angular_acceleration=float(limits.angular_acceleration_radps2),
        angular_deceleration=float(limits.angular_deceleration_radps2),
    )


_TEMPLATE: Final = """\
# Printed by canbase print urdf --controllers: {controller} with the wheels and limits of robot.yaml.
controller_manager:
  ros__parameters:
    update_rate: {update_hz}                  # rates.command_hz
    {controller}:
      type: {controller}/DiffDriveController

{controller}:
  ros__parameters:
    left_wheel_names: [{left}]
    right_wheel_names: [{right}]
    wheel_separation: {track_m}            # base.track_m; leave its multiplier at 1.0
    wheel_radius: {radius_m}                # base.wheel_radius_m
    left_wheel_radius_multiplier: {left_share}   # both by base.wheel_ratio
    right_wheel_radius_multiplier: {right_share}
    odom_frame_id: {odom_frame}
    base_frame_id: {base_frame}
    enable_odom_tf: false            # canbase publishes this transform
    open_loop: false
    position_feedback: false         # its odom comes from measured velocities; take canbase's odom
    cmd_vel_timeout: {timeout_s}             # never 0.0: the hardware repeats the last command for ever
    linear:
      x:
        max_velocity: {linear}
        min_velocity: -{linear}
        max_acceleration: {acceleration}
        max_deceleration: -{deceleration}
        max_acceleration_reverse: -{acceleration}
        max_deceleration_reverse: {deceleration}
    angular:
      z:
        max_velocity: {angular}
        min_velocity: -{angular}
        max_acceleration: {angular_acceleration}
        max_deceleration: -{angular_deceleration}
        max_acceleration_reverse: -{angular_acceleration}
        max_deceleration_reverse: {angular_deceleration}
"""
