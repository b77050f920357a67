"""What the pictures show, and the parallel views they show it from. LPS, mm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.hardware import Fixator, Ring, StrutType

if TYPE_CHECKING:
    from hexafix.imaging.volume import Volume

ANATOMY = {
    "left": (1.0, 0.0, 0.0),
    "right": (-1.0, 0.0, 0.0),
    "back": (0.0, 1.0, 0.0),
    "front": (0.0, -1.0, 0.0),
    "head": (0.0, 0.0, 1.0),
    "foot": (0.0, 0.0, -1.0),
}
"""Directions of the patient in LPS."""

BONE_VOXEL_MM = 1.9
"""Voxel pitch that is fine enough for the picture of the bone."""

BONE_MARGIN_MM = 60.0
"""How far beyond the rings the bone is shown."""


@dataclass(frozen=True, eq=False)
class BoneSample:
    """A coarse piece of the CT inside the rings, for the picture only.

    Attributes
    ----------
    hu : ndarray of int16, shape (K, J, I)
        HU, air where the fixator or nothing is.
    ijk_to_lps : ndarray, shape (4, 4)
    """

    hu: NDArray[np.int16]
    ijk_to_lps: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SceneBall:
    """A numbered ball: centre in LPS mm, diameter mm, ring name."""

    number: int
    center_mm: NDArray[np.float64]
    diameter_mm: float
    ring: str


@dataclass(frozen=True, eq=False)
class SceneGeometry:
    """Rings, struts, balls and bone of one moment.

    Attributes
    ----------
    proximal_lps, distal_lps : ndarray, shape (4, 4)
        Ring poses, ring coordinates to LPS mm.
    fixator : Fixator
    balls : tuple of SceneBall
    side : str
        ``left`` or ``right`` limb: chooses the lateral view.
    bone : BoneSample or None
    """

    proximal_lps: NDArray[np.float64]
    distal_lps: NDArray[np.float64]
    fixator: Fixator
    balls: tuple[SceneBall, ...]
    side: str
    bone: BoneSample | None = field(default=None)

    @classmethod
    def from_document(
        cls, document: Mapping[str, Any], *, bone: BoneSample | None = None
    ) -> SceneGeometry:
        """The scene of a finished plan document, as the CT shows it."""
        rings = document["rings"]
        balls = tuple(
            SceneBall(
                int(ball["number"]),
                np.array(ball["center_mm"], float),
                float(ball["diameter_mm"]),
                ball["ring"],
            )
            for ball in document["balls"]
        )
        return cls(
            np.array(rings["proximal"]["matrix_lps"], float),
            np.array(rings["distal"]["matrix_lps"], float),
            _fixator(document["case"]["fixator"]),
            balls,
            document["limb"]["side"],
            bone,
        )

    def ring_pose(self, ring: str) -> NDArray[np.float64]:
        """The 4×4 pose of ring ``proximal`` or ``distal``."""
        return self.proximal_lps if ring == "proximal" else self.distal_lps

    def ring(self, ring: str) -> Ring:
        """The hardware of ring ``proximal`` or ``distal``."""
        return self.fixator.proximal if ring == "proximal" else self.fixator.distal

    def joints_mm(self, ring: str) -> NDArray[np.float64]:
        """Joint centres of a ring in LPS, shape (6, 3), mm."""
        return transform(self.ring_pose(ring), self.ring(ring).joints_mm)

    def inner_radius_mm(self, ring: str) -> float:
        """Inner radius of the plate as drawn: as far inside the joint circle as it is outside."""
        hardware = self.ring(ring)
        joint_circle = float(np.mean(np.hypot(*hardware.joints_mm[:, :2].T)))
        return max(0.5 * joint_circle, 2 * joint_circle - hardware.outer_radius_mm)

    def outline_mm(self, ring: str, radius_mm: float, z_mm: float) -> NDArray[np.float64]:
        """A circle about a ring's axis in LPS, shape (72, 3), mm."""
        angle = np.linspace(0.0, 2 * np.pi, 72, endpoint=False)
        circle = np.stack(
            [radius_mm * np.cos(angle), radius_mm * np.sin(angle), np.full_like(angle, z_mm)], -1
        )
        return transform(self.ring_pose(ring), circle)

    def plate_mm(self, ring: str) -> NDArray[np.float64]:
        """A plate's edges in LPS, shape (4, 72, 3), mm: top outer, inner, low inner, outer."""
        outer, inner = self.ring(ring).outer_radius_mm, self.inner_radius_mm(ring)
        low = -self.ring(ring).thickness_mm
        corners = ((outer, 0.0), (inner, 0.0), (inner, low), (outer, low))
        return np.array([self.outline_mm(ring, radius, z) for radius, z in corners])


def _fixator(definition: Mapping[str, Any]) -> Fixator:
    """The fixator of a definition that the case reader has already checked."""
    proximal, distal = (
        Ring(
            np.array(definition[name]["joints_mm"], float),
            float(definition[name]["thickness_mm"]),
            float(definition[name]["outer_radius_mm"]),
        )
        for name in ("proximal", "distal")
    )
    strut = StrutType(float(definition["strut"]["min_mm"]), float(definition["strut"]["max_mm"]))
    return Fixator(
        definition["id"],
        definition["name"],
        definition.get("source") or "",
        proximal,
        distal,
        strut,
    )


def transform(pose: NDArray[np.float64], points_mm: ArrayLike) -> NDArray[np.float64]:
    """Points, shape (..., 3), mm, mapped by a 4×4 pose."""
    return np.asarray(points_mm, float) @ pose[:3, :3].T + pose[:3, 3]


@dataclass(frozen=True, eq=False)
class View:
    """A parallel view onto the scene.

    Attributes
    ----------
    name, title : str
        Key of the view and its caption.
    right, up, toward : ndarray, shape (3,)
        Unit vectors in LPS: right and up on the page, and towards the viewer; right × up = toward.
    center_mm : ndarray, shape (3,)
        LPS point in the middle of the picture.
    width_mm, height_mm : float
        Size of the shown window in the patient, mm.
    """

    name: str
    title: str
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    toward: NDArray[np.float64]
    center_mm: NDArray[np.float64]
    width_mm: float
    height_mm: float

    def project(self, points_mm: ArrayLike) -> NDArray[np.float64]:
        """Picture coordinates (u right, v down, depth towards the viewer), mm, shape (..., 3)."""
        offset = np.asarray(points_mm, float) - self.center_mm
        u = offset @ self.right + self.width_mm / 2
        v = self.height_mm / 2 - offset @ self.up
        return np.stack([u, v, offset @ self.toward], axis=-1)

    @property
    def is_along_patient_axis(self) -> bool:
        """Whether the view looks along L, P or S, to 5 degrees."""
        return float(np.max(np.abs(self.toward))) > 0.996

    def words(self, threshold: float = 0.7) -> dict[str, NDArray[np.float64]]:
        """Anatomical words near the picture plane with their unit direction (u, v) on the page."""
        found = {}
        for word, direction in ANATOMY.items():
            flat = np.array([np.dot(self.right, direction), -np.dot(self.up, direction)])
            length = float(np.linalg.norm(flat))
            if length >= threshold:
                found[word] = flat / length
        return found


def _axes(toward: ArrayLike, up: ArrayLike) -> tuple[NDArray, NDArray, NDArray]:
    z = np.asarray(toward, float)
    z = z / np.linalg.norm(z)
    y = np.asarray(up, float) - np.dot(up, z) * z
    y = y / np.linalg.norm(y)
    return np.cross(y, z), y, z


def scene_views(scene: SceneGeometry) -> tuple[View, ...]:
    """AP and lateral views of one scale, and an oblique one from the front, outside and above."""
    outward = 1.0 if scene.side == "left" else -1.0
    directions = (
        ("ap", "From the front (AP)", (0.0, -1.0, 0.0)),
        ("lateral", f"From the {scene.side} side (lateral)", (outward, 0.0, 0.0)),
        ("oblique", "From the front, the outer side and above", (0.75 * outward, -0.8, 0.55)),
    )
    outlines = [
        scene.outline_mm(ring, scene.ring(ring).outer_radius_mm, z)
        for ring in ("proximal", "distal")
        for z in (0.0, -scene.ring(ring).thickness_mm)
    ]
    points = np.vstack([*outlines, *(ball.center_mm for ball in scene.balls)])
    center = (points.min(0) + points.max(0)) / 2
    views = []
    for name, title, toward in directions:
        right, up, z = _axes(toward, (0.0, 0.0, 1.0))
        u, v = points @ right, points @ up
        middle = ((u.max() + u.min()) / 2, (v.max() + v.min()) / 2, float(center @ z))
        anchor = middle[0] * right + middle[1] * up + middle[2] * z
        size = (float(np.ptp(u)) + 62.0, float(np.ptp(v)) + 78.0)
        views.append(View(name, title, right, up, z, anchor, *size))
    wide = max(view.width_mm for view in views[:2])
    high = max(view.height_mm for view in views[:2])
    sized = [
        View(w.name, w.title, w.right, w.up, w.toward, w.center_mm, wide, high) for w in views[:2]
    ]
    return (*sized, views[2])


def view_from_above(scene: SceneGeometry) -> View:
    """The frame seen along the proximal ring's axis, the patient's front upwards if it can be."""
    axis = scene.proximal_lps[:3, 2]
    lean = [np.array(ANATOMY[word]) for word in ("front", "head")]
    up = min(lean, key=lambda direction: abs(float(direction @ axis)))
    right, up, toward = _axes(axis, lean[0] if abs(float(lean[0] @ axis)) < 0.7 else up)
    radius = scene.fixator.proximal.outer_radius_mm
    size = 2 * radius + 130.0
    middle = scene.proximal_lps[:3, 3]
    return View("above", "Seen from above", right, up, toward, middle, size, size)


def sample_bone(volume: Volume, scene: SceneGeometry) -> BoneSample:
    """A coarse copy of the CT inside the rings, so that the picture's bone is free of frame metal.

    Parameters
    ----------
    volume : Volume
        The CT.
    scene : SceneGeometry
        Its ring poses bound the copy: the column inside the narrower ring, along the rings' axes.
    """
    centers = np.stack([scene.proximal_lps[:3, 3], scene.distal_lps[:3, 3]])
    axis = centers[0] - centers[1]
    length = float(np.linalg.norm(axis))
    axis = axis / length
    radius = 0.92 * min(scene.inner_radius_mm(ring) for ring in ("proximal", "distal"))
    tips = np.stack([centers[0] + BONE_MARGIN_MM * axis, centers[1] - BONE_MARGIN_MM * axis])
    corners = np.vstack([tips - radius, tips + radius])
    box = volume.ijk_from_lps(
        np.stack(np.meshgrid(*np.stack([corners.min(0), corners.max(0)], -1), indexing="ij"), -1)
    ).reshape(-1, 3)
    size = np.array(volume.size_ijk)
    low = np.clip(np.floor(box.min(0)).astype(int), 0, size - 1)
    high = np.clip(np.ceil(box.max(0)).astype(int) + 1, low + 1, size)
    step = np.maximum(1, np.floor(BONE_VOXEL_MM / volume.spacing_mm + 0.3).astype(int))
    cut = tuple(slice(a, b, s) for a, b, s in zip(low[::-1], high[::-1], step[::-1], strict=True))
    hu = np.clip(volume.voxels[cut], -1024, 3071).astype(np.int16)
    affine = np.array(volume.ijk_to_lps)
    affine[:3, 3] = volume.lps_from_ijk(low)
    affine[:3, :3] = affine[:3, :3] * step
    hu[~_inside_column(hu.shape, affine, centers[1], axis, radius)] = -1024
    return BoneSample(hu, affine)


def _inside_column(
    shape: tuple[int, ...],
    affine: NDArray[np.float64],
    foot_mm: NDArray[np.float64],
    axis: NDArray[np.float64],
    radius_mm: float,
) -> NDArray[np.bool_]:
    """Whether voxels [k, j, i] lie within `radius_mm` of the line through `foot_mm`."""
    k, j, i = (np.arange(n, dtype=np.float32) for n in shape)
    columns = affine[:3, :3].astype(np.float32)
    offset = (affine[:3, 3] - foot_mm).astype(np.float32)
    across = np.eye(3, dtype=np.float32) - np.outer(axis, axis).astype(np.float32)
    squared = np.zeros(shape, np.float32)
    for row, shift in zip(across @ columns, across @ offset, strict=True):
        line = row[0] * i[None, None, :] + row[1] * j[None, :, None] + row[2] * k[:, None, None]
        squared += np.square(line + shift)
    return squared <= radius_mm**2
