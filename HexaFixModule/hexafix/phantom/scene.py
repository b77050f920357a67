"""Where everything truly is: rings, balls, joints, fragments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.geometry import Pose, matrix_from_xyz_fixed
from hexafix.kinematics import strut_lengths
from hexafix.phantom.posture import stack_axes
from hexafix.phantom.solids import Grid
from hexafix.phantom.spec import PhantomSpec

BONE_AXIS_B = ((4.0, -7.0), (0.02, 0.03))
"""Reduced bone axis in {B}: where it crosses z = 0, mm, and its slopes dx/dz, dy/dz."""
FRACTURE_TILT_RAD = 0.45
"""Obliquity of the fracture against the bone's cross-section."""


@dataclass(frozen=True, eq=False)
class Scene:
    """True places, LPS mm.

    Attributes
    ----------
    ring_a, ring_b : Pose
        {A} and {B} in LPS.
    balls_mm : dict of int to ndarray, shape (3,)
        True ball centres by number, installation errors included.
    nominal_mm : dict of int to ndarray, shape (3,)
        Where the layouts would have them.
    joints_a_mm, joints_b_mm : ndarray, shape (6, 3)
        Joint centres.
    strut_lengths_mm, strut_readings_mm : ndarray, shape (6,)
    bone_a, bone_b : Pose
        Bone frame as each fragment carries it: origin in the fracture's middle, z up the bone.
    fracture_normal : ndarray, shape (3,)
        In the bone frame, pointing to the proximal fragment.
    grid : Grid
    """

    ring_a: Pose
    ring_b: Pose
    balls_mm: dict[int, NDArray[np.float64]]
    nominal_mm: dict[int, NDArray[np.float64]]
    joints_a_mm: NDArray[np.float64]
    joints_b_mm: NDArray[np.float64]
    strut_lengths_mm: NDArray[np.float64]
    strut_readings_mm: NDArray[np.float64]
    bone_a: Pose
    bone_b: Pose
    fracture_normal: NDArray[np.float64]
    grid: Grid


def build_scene(spec: PhantomSpec) -> Scene:
    """Place everything that the spec asks for."""
    ring_b = spec.ring_b_pose
    ring_a = ring_b @ spec.mechanism_pose
    rng = np.random.default_rng([spec.seed, 1])
    balls, nominal = {}, {}
    for ring, layout in ((ring_a, spec.proximal), (ring_b, spec.distal)):
        errors = spec.installation_sigma_mm * rng.normal(size=(len(layout), 3))
        balls |= dict(zip(layout.numbers, ring.apply(layout.points_mm + errors), strict=True))
        nominal |= dict(zip(layout.numbers, ring.apply(layout.points_mm), strict=True))
    lengths = strut_lengths(spec.mechanism_pose, spec.fixator)
    bone = bone_in_ring_b(spec)
    return Scene(
        ring_a=ring_a,
        ring_b=ring_b,
        balls_mm=balls,
        nominal_mm=nominal,
        joints_a_mm=ring_a.apply(spec.fixator.proximal.joints_mm),
        joints_b_mm=ring_b.apply(spec.fixator.distal.joints_mm),
        strut_lengths_mm=lengths,
        strut_readings_mm=_readings(spec, lengths),
        bone_a=ring_a @ spec.target_pose.inverse() @ bone,
        bone_b=ring_b @ bone,
        fracture_normal=np.array([np.sin(FRACTURE_TILT_RAD), 0.0, np.cos(FRACTURE_TILT_RAD)]),
        grid=_grid(spec, np.mean(_extent(spec, ring_a, ring_b), axis=0)),
    )


def bone_in_ring_b(spec: PhantomSpec) -> Pose:
    """The reduced bone's frame in {B}: origin in the fracture, z up the bone."""
    (x0, y0), (dx, dy) = BONE_AXIS_B
    middle = 0.5 * float(spec.target_pose.position_mm[2])
    z = np.array([dx, dy, 1.0]) / np.linalg.norm([dx, dy, 1.0])
    x = np.cross([0.0, 1.0, 0.0], z)
    x = x / np.linalg.norm(x)
    origin = np.array([x0 + dx * middle, y0 + dy * middle, middle])
    return Pose(np.column_stack([x, np.cross(z, x), z]), origin)


def _readings(spec: PhantomSpec, lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the user reads off the struts' scales, mm."""
    readings = lengths - spec.fixator.strut.scale_offset_mm
    step = spec.strut_reading_step_mm
    if step > 0.0:
        readings = np.round(readings / step) * step
    if spec.strut_typo is not None:
        strut, error = spec.strut_typo
        readings[strut - 1] += error
    return np.round(readings, 9)


def _extent(spec: PhantomSpec, ring_a: Pose, ring_b: Pose) -> NDArray[np.float64]:
    """Two opposite corners of the box around balls and plates in LPS, shape (2, 3), mm."""
    sweep = np.radians(np.arange(0.0, 360.0, 10.0))
    parts = []
    for pose, ring, layout in (
        (ring_a, spec.fixator.proximal, spec.proximal),
        (ring_b, spec.fixator.distal, spec.distal),
    ):
        rim = ring.outer_radius_mm * np.stack([np.cos(sweep), np.sin(sweep), 0.0 * sweep], -1)
        lower = rim - np.array([0.0, 0.0, ring.thickness_mm])
        parts += [pose.apply(points) for points in (layout.points_mm, rim, lower)]
    points = np.concatenate(parts)
    return np.array([points.min(axis=0), points.max(axis=0)])


def _grid(spec: PhantomSpec, middle_mm: NDArray[np.float64]) -> Grid:
    """Voxel grid whose header values survive the 16 characters of a DICOM decimal string."""
    turn = matrix_from_xyz_fixed(np.asarray(spec.image_angles_rad))
    turn = turn @ stack_axes(spec.patient_position, spec.slice_plane)
    tilt = spec.gantry_tilt_rad
    if tilt:
        turn = turn @ matrix_from_xyz_fixed(np.array([tilt, 0.0, 0.0]))
    axes = np.round(turn, 13)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    axes[:, 2] /= np.linalg.norm(axes[:, 2])
    if tilt:
        # the table goes on as if the gantry stood straight
        axes[:, 2] += np.tan(tilt) * axes[:, 1]
    if spec.slices_reversed:
        axes[:, 2] *= -1.0
    center = middle_mm if spec.image_center_mm is None else np.asarray(spec.image_center_mm)
    affine = np.eye(4)
    affine[:3, :3] = axes * np.array(spec.spacing_mm)
    affine[:3, 3] = np.round(center - affine[:3, :3] @ ((np.array(spec.size_ijk) - 1) / 2.0), 4)
    return Grid(affine, spec.size_ijk, spec.thickness_mm, spec.psf_sigma_mm, tilt)


def distance_to_struts_mm(scene: Scene, points_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of points, shape (N, 3), LPS mm, from the nearest strut's axis, shape (N,)."""
    start, line = scene.joints_b_mm, scene.joints_a_mm - scene.joints_b_mm
    offset = points_mm[:, None] - start
    share = np.clip(np.sum(offset * line, -1) / np.sum(line * line, -1), 0.0, 1.0)
    return np.linalg.norm(offset - share[..., None] * line, axis=-1).min(axis=1)
