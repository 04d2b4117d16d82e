"""Where a scanner is, from two scans of one room: points of one onto lines of the other.

A. Censi, "An ICP variant using a point-to-line metric", ICRA 2008. Pure; numpy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from canbase_commissioning.umbmark.planar import Array, moved, pose
from canbase_commissioning.umbmark.room_scan import RoomError

GATES_M: Final = (0.6, 0.4, 0.3, 0.2, 0.15, 0.1, 0.1, 0.06, 0.06, 0.06, 0.06, 0.06)
"""How far a point may be from its line, iteration by iteration [m]: the guess is 3 % of a side away, the end is not."""
NEIGHBOURS: Final = 4
"""Points on each side, in the order of the beams, that make the line at a point."""
LINE_SHARE: Final = 0.15
"""A line is this much thinner than long (standard deviations)."""
LEAP_SHARE: Final = 0.15
"""Neighbours farther apart than this share of their range are two objects."""
LEAST_SHARE: Final = 0.5
"""So many points of the second scan find their line, or the scans do not see the same."""
FLOOR: Final = np.diag([0.002, 0.002, 0.001]) ** 2
"""Errors of a scanner that no average reduces: 2 mm, 1 mrad."""
MOST_M, MOST_RAD = 0.01, 0.01
"""A pose that is less certain (1 σ) is none."""


@dataclass(frozen=True, slots=True)
class Match:
    """Pose of the second scan as seen from the first, with its covariance."""

    pose: Array
    covariance: Array
    share: float
    """Of the points that found a line."""
    noise_m: float
    """Of the points about their lines (1 σ)."""


def match(first: Array, second: Array, guess: Array) -> Match:
    """Aligns `second` with `first` (n × 2 points in the order of their beams), beginning at `guess`.

    Raises RoomError when they do not see the same, or when the room does not fix the pose.
    """
    normals = _normals(first)
    lines = np.isfinite(normals[:, 0])
    if lines.sum() < NEIGHBOURS:
        raise RoomError("the scan has no walls: nothing in it is straight")
    found = np.array(guess, dtype=float)
    for gate_m in GATES_M:
        rows, residuals, _ = _pairs(first[lines], normals[lines], second, found, gate_m)
        found = found - np.linalg.lstsq(rows, residuals, rcond=None)[0]
    rows, residuals, share = _pairs(first[lines], normals[lines], second, found, GATES_M[-1])
    if share < LEAST_SHARE:
        raise RoomError(f"only {share:.0%} of the scan fits the one before: has something moved, or is the view new?")
    noise_m = max(float(np.sqrt(residuals @ residuals / len(residuals))), 1e-4)
    covariance = noise_m**2 * np.linalg.pinv(rows.T @ rows)
    _fixed(rows, noise_m)
    return Match(pose(found[0], found[1], math.remainder(found[2], math.tau)), covariance + FLOOR, share, noise_m)


def _fixed(rows: Array, noise_m: float) -> None:
    """Raises RoomError where a direction is seen by (almost) no line, as along a corridor."""
    values, vectors = np.linalg.eigh(rows.T @ rows)
    sigma = noise_m / math.sqrt(max(values[0], 1e-12))
    along = vectors[:, 0]
    limit = MOST_M if abs(along[2]) < 0.5 else MOST_RAD
    if sigma > limit:
        where = (
            f"along {math.degrees(math.atan2(along[1], along[0])):.0f}°" if abs(along[2]) < 0.5 else "in its heading"
        )
        raise RoomError(f"the room does not fix the pose {where} (1 σ {sigma:.3f}): a corridor, or a round room?")


def _normals(points: Array) -> Array:
    """Unit normal of the line at each point; NaN where there is none."""
    normals = np.full_like(points, np.nan)
    for k in range(len(points)):
        near = points[max(0, k - NEIGHBOURS) : k + NEIGHBOURS + 1]
        near = near[np.hypot(*(near - points[k]).T) <= LEAP_SHARE * math.hypot(*points[k]) + 0.05]
        if len(near) < NEIGHBOURS:
            continue
        off = near - near.sum(axis=0) / len(near)
        values, vectors = np.linalg.eigh(off.T @ off)
        if math.sqrt(max(values[0], 0.0)) <= LINE_SHARE * math.sqrt(values[1]):
            normals[k] = vectors[:, 0]
    return normals


def _pairs(lines: Array, normals: Array, points: Array, at: Array, gate_m: float) -> tuple[Array, Array, float]:
    """Rows of the Jacobian, distances from the lines [m], and the share of the points that have one."""
    there = moved(points, at)
    nearest = ((lines**2).sum(axis=1) - 2.0 * there @ lines.T).argmin(axis=1)  # |there|² is the same for all lines
    normal, away = normals[nearest], there - lines[nearest]
    residuals = (away * normal).sum(axis=1)
    taken = (np.hypot(*away.T) <= 2.0 * gate_m) & (np.abs(residuals) <= gate_m)
    if taken.sum() < NEIGHBOURS:
        raise RoomError("the scans have nothing in common: is the guess of the odometry far off?")
    arm = there - at[:2]
    rows = np.stack([normal[:, 0], normal[:, 1], normal[:, 1] * arm[:, 0] - normal[:, 0] * arm[:, 1]], axis=1)
    spread_m = 3.0 * 1.4826 * float(np.median(np.abs(residuals[taken]))) + 1e-3
    taken &= np.abs(residuals) <= spread_m
    return rows[taken], residuals[taken], float(taken.mean())
