"""The keys of robot.yaml below `odometry`: how wrong the wheels may be, and who publishes the transform."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from canbase_config.section import Section


class OdometrySettings(Section):
    """Standard deviations (1 σ) of what odom is made of, and the transform. The covariances of odom follow from them.

    The model: K. S. Chong and L. Kleeman, "Accurate odometry and error modelling for a mobile robot", ICRA 1997, for
    what is random; J. Borenstein and L. Feng, "Measurement and correction of systematic odometry errors in mobile
    robots", IEEE Trans. Robotics and Automation 12(6), 1996, for what is not.
    """

    publish_tf: Annotated[
        bool,
        Field(
            description="motor_driver publishes odom_frame → base_frame on tf; false where a filter, such as "
            "robot_localization, does"
        ),
    ] = True
    radius_error: Annotated[
        float,
        Field(ge=1e-5, le=0.2, description="of the wheel radius, each side for itself, as a share; it does not change"),
    ] = 0.005
    track_error: Annotated[
        float, Field(ge=1e-5, le=0.5, description="of the track, as a share; it does not change")
    ] = 0.02
    travel_error_m: Annotated[
        float,
        Field(
            ge=1e-5,
            le=0.5,
            description="random, of the travel of one side after 1 m; it grows with the square root of the distance "
            "[m/√m]",
        ),
    ] = 0.003
    grip_mps2: Annotated[
        float,
        Field(
            ge=0.2,
            le=20.0,
            description="a rim that accelerates or brakes harder slips on the floor: rubber on a dry floor 8, on a "
            "smooth or dusty one 4 [m/s²]",
        ),
    ] = 4.0
