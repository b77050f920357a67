"""The Jacobian matrices of Eq. (20)-(22) for many layouts at once, and their check."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hexafix.geometry import angles_xyz_fixed_from_matrix, skew
from hexafix.hardware import MarkerLayout, MarkerSite
from hexafix.recognition import ring_poses
from hexafix.recognition.group_pose import corner_jacobians
from hexafix.recognition.groups import ring_poses_by_groups
from hexafix.study.error_model import ErrorModel
from hexafix.study.layouts import RingLayouts

Array = NDArray[np.float64]
Road = Callable[[Array, MarkerLayout], tuple[Array, Array]]
"""Ball centres (K, N, 3), LPS mm, and a layout to rotations (K, 3, 3) and positions (K, 3)."""

MODELS = {
    "paper": "group method, the paper's linear model: an error of a height moves, never tilts",
    "groups": "group method, complete linear model: unequal heights tilt the ring",
    "least-squares": "weighted least squares over all markers, linear model",
}
"""The three linear models, in the order of the arrays."""

STEP_MM = 1e-4
"""Step of the finite differences; for an angle the same length on the circle."""


def group_image_jacobians(layouts: RingLayouts) -> Array:
    """Derivative of the mean of the groups by the ball centres, shape (G, 6, N, 3).

    Notes
    -----
    Source: Eq. (8)-(19), (21), (22). Departs: nothing for evenly high markers; groups that
    recognition leaves out because they are nearly collinear (H16) count here, as in the paper.
    """
    count = layouts.markers
    points, groups = layouts.points_mm, layouts.groups
    rows = np.arange(len(layouts))
    result = np.zeros((len(layouts), 6, count, 3))
    for k in range(count):
        by_corner = corner_jacobians(points[rows[:, None], groups[:, k]])
        for corner in range(3):
            result[rows, :, groups[:, k, corner]] += by_corner[:, :, corner] / count
    return result


def fit_image_jacobians(layouts: RingLayouts, errors: ErrorModel) -> Array:
    """Derivative of the least-squares pose by the ball centres, shape (G, 6, N, 3).

    Notes
    -----
    Source: the solution of Eq. (6) for all markers at once, weighted by the errors' variances.
    """
    r = layouts.points_mm
    moves = np.concatenate([np.broadcast_to(np.eye(3), (*r.shape, 3)), -skew(r)], axis=-1)
    weighted = moves / errors.variance_mm2[:, None]
    normal = np.einsum("gnia,gnib->gab", weighted, moves)
    return np.einsum("gab,gnib->gani", np.linalg.inv(normal), weighted)


def model_jacobians(layouts: RingLayouts, errors: ErrorModel) -> Array:
    """J of every model in `MODELS`, ring at the identity pose, shape (G, 3, 6, N, 6).

    Rows are (x y z α β γ), mm and radians; the last axis is (δx δy δz of m_i, δt δφ δh of η_i),
    mm, and radians for δφ.

    Notes
    -----
    Source: Eq. (20)-(22). Departs: "groups" and "least-squares" let a height's error act as it
    does in truth; in "paper" it enters Eq. (18) alone.
    """
    groups = group_image_jacobians(layouts)
    paper = _with_installation(groups, layouts)
    paper[..., 5] = 0.0
    paper[:, 2, :, 5] = -1.0 / layouts.markers  # Eq. (18), each marker is j1 of one group
    fit = fit_image_jacobians(layouts, errors)
    return np.stack(
        [paper, _with_installation(groups, layouts), _with_installation(fit, layouts)], axis=1
    )


def _with_installation(image: Array, layouts: RingLayouts) -> Array:
    """Columns of Δη beside those of Δm, shape (G, 6, N, 3) to (G, 6, N, 6).

    A layout believed wrong by Δη acts as the balls displaced the other way.
    """
    cos, sin = np.cos(layouts.sweep_rad), np.sin(layouts.sweep_rad)
    by = np.zeros((*cos.shape, 3, 3))  # rows t φ h, columns x y z
    by[..., 0, 0], by[..., 0, 1] = cos, sin
    by[..., 1, 0], by[..., 1, 1] = -layouts.radius_mm * sin, layouts.radius_mm * cos
    by[..., 2, 2] = 1.0
    return np.concatenate([image, -np.einsum("ganc,gnec->gane", image, by)], axis=-1)


def finite_differences(layout: MarkerLayout, road: Road) -> Array:
    """Central differences of a recognition, ring at the identity pose, shape (6, N, 6).

    Parameters
    ----------
    layout : MarkerLayout
    road : callable
        The recognition, see `Road`.

    Returns
    -------
    ndarray
        Rows and columns as in `model_jacobians`.
    """
    points, count = layout.points_mm, len(layout)
    result = np.empty((6, count, 6))
    for marker, site in enumerate(layout.sites):
        for column in range(6):
            step = STEP_MM / site.radius_mm if column == 4 else STEP_MM
            ends = []
            for signed in (step, -step):
                balls, believed = np.array(points), layout
                if column < 3:
                    balls[marker, column] += signed
                else:
                    believed = _with_site(layout, marker, column - 3, signed)
                rotation, position = road(balls[None], believed)
                ends.append(np.append(position[0], angles_xyz_fixed_from_matrix(rotation)[0]))
            result[:, marker, column] = (ends[0] - ends[1]) / (2 * step)
    return result


def _with_site(layout: MarkerLayout, marker: int, parameter: int, change: float) -> MarkerLayout:
    """The layout with one of t, φ, h of one marker changed, mm or rad."""
    sites = list(layout.sites)
    site = sites[marker]
    eta = [site.radius_mm, site.sweep_rad, site.height_mm]
    eta[parameter] += change
    sites[marker] = MarkerSite(site.number, *eta)
    return MarkerLayout(tuple(sites))


def least_squares_road(errors: ErrorModel) -> Road:
    """The weighted least-squares recognition, told the errors' variances."""
    image = np.diag(np.square(errors.image_sigma_mm))

    def road(points_mm: Array, layout: MarkerLayout) -> tuple[Array, Array]:
        covariances = np.broadcast_to(image, (len(layout), 3, 3))
        return ring_poses(
            points_mm,
            layout,
            covariances_mm2=covariances,
            installation_sigma_mm=errors.installation_sigma_mm,
        )[:2]

    return road


def jacobian_check(layouts: RingLayouts, errors: ErrorModel) -> dict[str, float]:
    """Largest difference of J from finite differences of the recognition, by model.

    Each column of J in mm or rad per mm; columns of δφ per mm on the circle. In "paper" the
    columns of δh are left out, because there the paper's model differs from its own method.
    """
    jacobians = model_jacobians(layouts, errors)
    worst = dict.fromkeys(MODELS, 0.0)
    for g in range(len(layouts)):
        layout = layouts.layout(g)
        per_mm = np.ones((layouts.markers, 6))
        per_mm[:, 4] = 1.0 / layouts.radius_mm[g]
        by_groups = finite_differences(layout, ring_poses_by_groups)
        by_fit = finite_differences(layout, least_squares_road(errors))
        for m, (name, found) in enumerate(zip(MODELS, (by_groups, by_groups, by_fit), strict=True)):
            gap = np.abs(found - jacobians[g, m]) * per_mm
            columns = 5 if name == "paper" else 6
            worst[name] = max(worst[name], float(gap[..., :columns].max()))
    return worst
