"""How wrong the pose may be: the covariances of odom. No ROS, no clock.

Three kinds of errors, each propagated as its own nature is:

- random ones of each side's travel: their variance grows with the distance (Chong and Kleeman, ICRA 1997);
- wrong radius of a side, wrong track: each is one number that does not change, so its effect grows with the distance
  itself, and goes back where a path goes back (the parameters of Borenstein and Feng, 1996);
- slip that was noticed: one number for each side while it lasts, independent of the next slip.

Each number has a column: how far it moves the pose (x, y, yaw) for one standard deviation of it. The covariance is the
sum of their outer products, so it is symmetric and never negative.
"""

from __future__ import annotations

import math

from canbase_config.odometry import OdometrySettings
from canbase_driver.motion.kinematics import Twist2D

Covariance = tuple[float, ...]
"""36 numbers: 6 × 6, row by row, in the order x, y, z, rotation about x, y, z (geometry_msgs, REP 103)."""
Column = tuple[float, float, float]
"""x [m], y [m], yaw [rad] for one standard deviation of one error."""

POSE_FLOOR_M2 = 1e-6
"""Least variance of x and of y [m²]: 1 mm."""
POSE_FLOOR_RAD2 = 1e-6
"""Least variance of yaw [rad²]: 1 mrad."""
TWIST_FLOOR = 1e-6
"""Least variance of a velocity [m²/s², rad²/s²]: 1 mm/s, 1 mrad/s. Sideways no wheel rolls: it is the variance."""
UNMEASURED = 1e6
"""Variance of what wheels cannot measure: z, roll and pitch."""
LEG_M = 0.01
"""Errors are propagated once both sides together have rolled so far: an encoder that flickers by a count adds none."""

NONE: Column = (0.0, 0.0, 0.0)


class PoseError:
    """The error of a pose, from its reset on."""

    __slots__ = (
        "_heading_rad",
        "_left_m",
        "_left_slip_m",
        "_radius_left",
        "_radius_right",
        "_right_m",
        "_right_slip_m",
        "_settings",
        "_slip_left",
        "_slip_right",
        "_track",
        "_track_m",
        "_variances",
    )

    def __init__(self, settings: OdometrySettings, track_m: float) -> None:
        self._settings, self._track_m = settings, track_m
        self.reset(0.0)

    def reset(self, yaw_rad: float) -> None:
        """The pose is known again; its heading is `yaw_rad`."""
        self._variances = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._radius_left = self._radius_right = self._track = NONE
        self._slip_left = self._slip_right = NONE
        self._begin_leg(yaw_rad)

    def roll(self, left_m: float, right_m: float, left_slip_m: float = 0.0, right_slip_m: float = 0.0) -> None:
        """Each side has rolled so far [m], and of that may have slipped so far (1 σ) [m]."""
        self._left_m += left_m
        self._right_m += right_m
        self._left_slip_m += left_slip_m
        self._right_slip_m += right_slip_m
        if abs(self._left_m) + abs(self._right_m) + self._left_slip_m + self._right_slip_m >= LEG_M:
            self._propagate()

    def end_slip(self) -> None:
        """The wheels grip again: the next slip is another one."""
        if self._left_slip_m or self._right_slip_m:
            self._propagate()
        self._add(self._slip_left, 1.0)
        self._add(self._slip_right, 1.0)
        self._slip_left = self._slip_right = NONE

    def lose(self, distance_m: float) -> None:
        """Each side may have rolled by up to `distance_m`, either way, and nothing has measured it."""
        left, right = self._columns(self._heading_rad)
        variance_m2 = distance_m * distance_m / 3.0  # evenly spread over ± distance_m
        self._add(left, variance_m2)
        self._add(right, variance_m2)

    def covariance(self) -> Covariance:
        """Of x, y and yaw; the base is assumed to stay on the ground: z, roll and pitch are `UNMEASURED`."""
        settings, (xx, xy, xt, yy, yt, tt) = self._settings, self._variances
        for (x, y, yaw), sigma in (
            (self._radius_left, settings.radius_error),
            (self._radius_right, settings.radius_error),
            (self._track, settings.track_error),
            (self._slip_left, 1.0),
            (self._slip_right, 1.0),
        ):
            x, y, yaw = x * sigma, y * sigma, yaw * sigma
            xx, xy, xt = xx + x * x, xy + x * y, xt + x * yaw
            yy, yt, tt = yy + y * y, yt + y * yaw, tt + yaw * yaw
        return planar(xx + POSE_FLOOR_M2, xy, xt, yy + POSE_FLOOR_M2, yt, tt + POSE_FLOOR_RAD2)

    def _begin_leg(self, heading_rad: float) -> None:
        self._heading_rad = heading_rad
        self._left_m = self._right_m = self._left_slip_m = self._right_slip_m = 0.0

    def _propagate(self) -> None:
        """Over the leg since the last time; it is short: its errors act in its middle, and its chord is its arc."""
        left_m, right_m = self._left_m, self._right_m
        distance_m, turn_rad = (left_m + right_m) / 2.0, (right_m - left_m) / self._track_m
        middle_rad = self._heading_rad + turn_rad / 2.0
        left, right = self._columns(middle_rad)
        dx_m, dy_m = distance_m * math.cos(middle_rad), distance_m * math.sin(middle_rad)
        self._carry(dx_m, dy_m)
        self._radius_left = _moved(self._radius_left, dx_m, dy_m, left, left_m)
        self._radius_right = _moved(self._radius_right, dx_m, dy_m, right, right_m)
        self._track = _moved(self._track, dx_m, dy_m, (0.0, 0.0, -turn_rad), 1.0)
        self._slip_left = _moved(self._slip_left, dx_m, dy_m, left, self._left_slip_m)
        self._slip_right = _moved(self._slip_right, dx_m, dy_m, right, self._right_slip_m)
        per_m = self._settings.travel_error_m**2
        self._add(left, per_m * abs(left_m))
        self._add(right, per_m * abs(right_m))
        self._begin_leg(self._heading_rad + turn_rad)

    def _columns(self, heading_rad: float) -> tuple[Column, Column]:
        """How 1 m of travel of the left and of the right side moves the base."""
        x, y = math.cos(heading_rad) / 2.0, math.sin(heading_rad) / 2.0
        return (x, y, -1.0 / self._track_m), (x, y, 1.0 / self._track_m)

    def _carry(self, dx_m: float, dy_m: float) -> None:
        """F P Fᵀ: an error of the heading at the start of the leg moves its end sideways."""
        xx, xy, xt, yy, yt, tt = self._variances
        self._variances = (
            xx - 2.0 * dy_m * xt + dy_m * dy_m * tt,
            xy + dx_m * xt - dy_m * yt - dx_m * dy_m * tt,
            xt - dy_m * tt,
            yy + 2.0 * dx_m * yt + dx_m * dx_m * tt,
            yt + dx_m * tt,
            tt,
        )

    def _add(self, column: Column, variance: float) -> None:
        (x, y, yaw), (xx, xy, xt, yy, yt, tt) = column, self._variances
        self._variances = (
            xx + variance * x * x,
            xy + variance * x * y,
            xt + variance * x * yaw,
            yy + variance * y * y,
            yt + variance * y * yaw,
            tt + variance * yaw * yaw,
        )


def _moved(column: Column, dx_m: float, dy_m: float, of_leg: Column, share: float) -> Column:
    """The column at the end of a leg: carried along, and `share` times that of the leg itself."""
    x, y, yaw = column
    return (
        x - dy_m * yaw + share * of_leg[0],
        y + dx_m * yaw + share * of_leg[1],
        yaw + share * of_leg[2],
    )


class TwistError:
    """The covariance of the velocity that odom has, as a filter takes it in: independent from message to message."""

    __slots__ = ("_period_s", "_settings", "_track_m")

    def __init__(self, settings: OdometrySettings, track_m: float, period_s: float) -> None:
        """`period_s`: from one odom message to the next. Over it the random part is that of the travel."""
        self._settings, self._track_m, self._period_s = settings, track_m, period_s

    def covariance(self, twist: Twist2D, left_slip_mps: float = 0.0, right_slip_mps: float = 0.0) -> Covariance:
        """Of `twist`, in the base frame [m²/s², rad²/s²]; `*_slip_mps`: so fast may each side slip now (1 σ)."""
        half_mps = twist.angular_radps * self._track_m / 2.0
        left = self._side(twist.linear_mps - half_mps, left_slip_mps)
        right = self._side(twist.linear_mps + half_mps, right_slip_mps)
        track_m = self._track_m
        linear, both = (left + right) / 4.0 + TWIST_FLOOR, (right - left) / (2.0 * track_m)
        turn = (left + right) / (track_m * track_m) + (self._settings.track_error * twist.angular_radps) ** 2
        return planar(linear, 0.0, both, TWIST_FLOOR, 0.0, turn + TWIST_FLOOR)

    def _side(self, rim_mps: float, slip_mps: float) -> float:
        """Variance of the speed of one side over the floor [m²/s²]."""
        settings = self._settings
        random = settings.travel_error_m**2 * abs(rim_mps) / self._period_s
        return random + (settings.radius_error * rim_mps) ** 2 + slip_mps * slip_mps


def planar(xx: float, xy: float, xt: float, yy: float, yt: float, tt: float) -> Covariance:
    """6 × 6 with these variances and covariances of x, y and yaw (t); z, roll and pitch are `UNMEASURED`."""
    return (
        *(xx, xy, 0.0, 0.0, 0.0, xt),
        *(xy, yy, 0.0, 0.0, 0.0, yt),
        *_NOT_MEASURED,
        *(xt, yt, 0.0, 0.0, 0.0, tt),
    )


_NOT_MEASURED = tuple(UNMEASURED if row == column else 0.0 for row in (2, 3, 4) for column in range(6))
"""z, rotation about x and y."""
