"""Wheel radii and track from what the wheels turned and where a scanner was, stop by stop. Pure; numpy.

The path is that of UMBmark: squares in both directions (J. Borenstein and L. Feng, IEEE Trans. Robotics and Automation
12(6), 1996). In place of its formulas for four corner points, least squares over each leg, with the pose of the scanner
on the base as three more unknowns (A. Censi, A. Franchi, L. Marchionni, G. Oriolo, "Simultaneous calibration of
odometry and sensor parameters for mobile robots", IEEE Trans. Robotics 29(2), 2013).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from canbase_commissioning.umbmark.planar import Array, Wheels, between, compose, inverse, rolled
from canbase_config.odometry import OdometrySettings
from canbase_driver.motion.pose_error import PoseError

PRIOR: Final = np.array([0.2, 0.2, 0.3, 0.1, 0.1, 0.2])
"""How far the start may be off (1 σ): radii and track as shares, the scanner's x, y [m] and yaw [rad]."""
ROUNDS: Final = 8
OUTLIER: Final = 16.3
"""Chi² of three degrees of freedom beyond which one in a thousand lies: that leg slipped, or its match is wrong."""
MOST_OUTLIERS: Final = 0.2
STEP: Final = 1e-6


class FitError(ValueError):
    """The legs do not carry a result; the text says why and what helps."""


@dataclass(frozen=True, slots=True)
class Leg:
    """From one stop to the next."""

    angles_rad: Array
    """Of the wheels, left and right, sample by sample: n × 2 [rad]."""
    motion: Array
    """Pose of the scanner at the end as seen from the start, by the room."""
    covariance: Array


@dataclass(frozen=True, slots=True)
class Fit:
    """The result, each with its standard deviation, in the same unit."""

    wheels: Wheels
    sigma: Wheels
    ratio_sigma: float
    mount: Array
    """Pose of the scanner on the base."""
    mount_sigma: Array
    legs: int
    """That were used."""
    outliers: tuple[int, ...]
    """Legs that were left out, by number."""
    chi2_share: float
    """Chi² by its degrees of freedom: near 1 when travel_error_m and the scanner are as stated."""


def fit(legs: Sequence[Leg], start: Wheels, mount: Array, errors: OdometrySettings) -> Fit:
    """Least squares from `start`. Raises FitError where too few legs fit any result."""
    weights = [_weight(leg, start, mount, errors) for leg in legs]
    kept = list(range(len(legs)))
    while True:
        found, information = _solve([legs[k] for k in kept], [weights[k] for k in kept], start, mount)
        squares = {k: _square(legs[k], weights[k], found, start, mount) for k in kept}
        worst = max(squares, key=lambda k: squares[k])
        if squares[worst] <= OUTLIER:
            break
        kept.remove(worst)
        if len(legs) - len(kept) > MOST_OUTLIERS * len(legs):
            raise FitError(
                f"{len(legs) - len(kept)} of {len(legs)} legs contradict the others: wheels that slip, a floor that is "
                "not level, or something in the room that moved. Repeat it slower, on another floor"
            )
    share = sum(squares.values()) / max(1, 3 * len(kept) - 6)
    covariance = _inverted(information) * max(1.0, share)
    return _fit(found, covariance, start, mount, len(kept), tuple(sorted(set(range(len(legs))) - set(kept))), share)


def _fit(
    found: Array, covariance: Array, start: Wheels, mount: Array, used: int, out: tuple[int, ...], share: float
) -> Fit:
    wheels, placed = _values(found, start, mount)
    sigma = np.sqrt(np.diag(covariance))
    ratio_variance = covariance[0, 0] + covariance[1, 1] - 2.0 * covariance[0, 1]
    sigmas = Wheels(wheels.left_m * sigma[0], wheels.right_m * sigma[1], wheels.track_m * sigma[2])
    return Fit(wheels, sigmas, math.sqrt(ratio_variance), placed, sigma[3:], used, out, share)


def _values(unknown: Array, start: Wheels, mount: Array) -> tuple[Wheels, Array]:
    """Six unknowns: logarithms of the factors of left, right and track; changes of the mount."""
    left, right, track = np.exp(unknown[:3])
    return Wheels(start.left_m * left, start.right_m * right, start.track_m * track), mount + unknown[3:]


def _residual_at(leg: Leg, start: Wheels, mount: Array, unknown: Array) -> Array:
    """Where the wheels put the scanner at the end of the leg, as seen from where the room puts it."""
    wheels, placed = _values(unknown, start, mount)
    return between(leg.motion, seen(rolled(leg.angles_rad, wheels), placed))


def seen(base: Array, mount: Array) -> Array:
    """Motion of the scanner, as seen from itself, when the base moves by `base`."""
    return compose(compose(inverse(mount), base), mount)


def _solve(legs: list[Leg], weights: list[Array], start: Wheels, mount: Array) -> tuple[Array, Array]:
    """Unknowns and their information, by Gauss-Newton."""
    unknown, prior = np.zeros(6), np.diag(1.0 / PRIOR**2)
    for _ in range(ROUNDS):
        information, right = prior.copy(), -prior @ unknown
        for leg, weight in zip(legs, weights, strict=True):
            residual = _residual_at(leg, start, mount, unknown)
            slopes = _slopes(partial(_residual_at, leg, start, mount), unknown, residual)
            information += slopes.T @ weight @ slopes
            right -= slopes.T @ weight @ residual
        unknown = unknown + np.linalg.solve(information, right)
    return unknown, information


def _slopes(of: Callable[[Array], Array], at: Array, here: Array) -> Array:
    """Jacobian of `of` at `at`, where it is `here`."""
    return np.stack([(of(at + step) - here) / STEP for step in STEP * np.eye(len(at))], axis=1)


def _square(leg: Leg, weight: Array, unknown: Array, start: Wheels, mount: Array) -> float:
    residual = _residual_at(leg, start, mount, unknown)
    return float(residual @ weight @ residual)


def _weight(leg: Leg, start: Wheels, mount: Array, errors: OdometrySettings) -> Array:
    """Inverse covariance of a leg: the match, and what is random in the travel of its wheels."""
    random = PoseError(errors.model_copy(update={"radius_error": 1e-9, "track_error": 1e-9}), start.track_m)
    for left_rad, right_rad in np.diff(leg.angles_rad, axis=0):
        random.roll(left_rad * start.left_m, right_rad * start.right_m)
    planar = np.array(random.covariance()).reshape(6, 6)[np.ix_((0, 1, 5), (0, 1, 5))]
    base = rolled(leg.angles_rad, start)
    scanner = seen(base, mount)
    slopes = _slopes(lambda at: between(scanner, seen(at, mount)), base, np.zeros(3))
    cos, sin = math.cos(leg.motion[2]), math.sin(leg.motion[2])
    turned = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])  # of the match: into the frame of the end
    return _inverted(slopes @ planar @ slopes.T + turned @ leg.covariance @ turned.T)


def _inverted(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)
