"""The limb: soft tissue, two bone fragments, and the table under it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hexafix.geometry import Pose
from hexafix.phantom.posture import scanner_axes
from hexafix.phantom.scene import Scene
from hexafix.phantom.solids import Array, Solid, cylinder, slab_box
from hexafix.phantom.spec import PhantomSpec

SKIN_HU, FAT_HU, MUSCLE_HU, CORTEX_HU, MARROW_HU = 60.0, -100.0, 55.0, 1450.0, 40.0
CANCELLOUS_HU = 320.0
LIMB_RADIUS_MM, BONE_RADIUS_MM = {"femur": 62.0}, {"femur": 14.0}
DEFAULT_LIMB_MM, DEFAULT_BONE_MM = 52.0, 12.5
TWO_BONES = ("tibia", "forearm")
LONGEST_MM = 400.0


def limb_solids(spec: PhantomSpec, scene: Scene) -> list[Solid]:
    """Table, soft tissue and bone in painting order."""
    solids: list[Solid] = []
    if spec.table:
        solids.append(_table(spec, scene))
    if spec.limb:
        solids.append(_soft_tissue(spec, scene))
        for upper in (True, False):
            if spec.bone in TWO_BONES:
                solids.append(_second_bone(spec, scene, upper=upper))
            solids += _fragment(spec, scene, upper=upper)
    return solids


def _table(spec: PhantomSpec, scene: Scene) -> Solid:
    """Carbon table with a foam core, under the frame as the patient lies."""
    middle = 0.5 * (scene.ring_a.position_mm + scene.ring_b.position_mm)
    axes = scanner_axes(spec.patient_position)
    pose = Pose(axes, middle + axes @ np.array([0.0, 138.0, 0.0]))
    return slab_box(pose, (215.0, 9.0, LONGEST_MM), ((0.0, 80.0), (1.8, -880.0)))


def _soft_tissue(spec: PhantomSpec, scene: Scene) -> Solid:
    """Skin, fat and muscle around an axis that bends where the fragments do."""
    distance = _skin_distance(spec, scene)
    reach = 1.5 * LIMB_RADIUS_MM.get(spec.bone, DEFAULT_LIMB_MM) + 25.0
    layers = ((0.0, SKIN_HU), (1.8, FAT_HU), (8.0, MUSCLE_HU))
    low, high = (-reach, -reach, -LONGEST_MM), (reach, reach, LONGEST_MM)
    return Solid(distance, scene.bone_b, low, high, layers)


def _skin_distance(spec: PhantomSpec, scene: Scene) -> Callable[[Array, Array, Array], Array]:
    """Signed distance from the skin in the distal fragment's bone frame."""
    shift = scene.bone_b.inverse() @ scene.bone_a
    slope = (shift.rotation[:, 2] / shift.rotation[2, 2]).astype(np.float32)
    jump = shift.position_mm.astype(np.float32)
    radius = np.float32(LIMB_RADIUS_MM.get(spec.bone, DEFAULT_LIMB_MM))
    back = np.float32(0.18) * radius

    def distance(x: Array, y: Array, z: Array) -> Array:
        share = np.clip((z + np.float32(25.0)) / np.float32(50.0), 0.0, 1.0)
        share = share * share * (np.float32(3.0) - np.float32(2.0) * share)
        u = x - share * (jump[0] + slope[0] * z) + back
        v = (y - share * (jump[1] + slope[1] * z)) * np.float32(1.08)
        girth = radius * (1 + np.float32(0.0011) * np.clip(z, -150.0, 150.0))
        return np.sqrt(u * u + v * v) - girth

    return distance


def skin_radius_mm(spec: PhantomSpec, scene: Scene, sweep_rad: float, z_mm: float) -> float:
    """Distance of the skin from the distal ring's axis at a sweep and height in {B}, mm."""
    if not spec.limb:
        return 50.0
    radii = np.arange(20.0, 90.0, 0.5)
    points = np.stack([radii * np.cos(sweep_rad), radii * np.sin(sweep_rad), 0 * radii + z_mm], -1)
    local = scene.bone_b.inverse().apply(scene.ring_b.apply(points)).astype(np.float32)
    outside = _skin_distance(spec, scene)(*local.T) > 0.0
    return float(radii[int(np.argmax(outside))])


def _second_bone(spec: PhantomSpec, scene: Scene, *, upper: bool) -> Solid:
    """Fibula or ulna: a thin tube behind and lateral of the first bone, broken at its height."""
    pose = scene.bone_a if upper else scene.bone_b
    aside = 24.0 if spec.side == "left" else -24.0
    place = Pose(pose.rotation, pose.apply([-15.0, aside, 0.0]))
    low, high = (6.0, LONGEST_MM) if upper else (-LONGEST_MM, 4.0)
    return cylinder(place, low, high, 5.5, ((0.0, CORTEX_HU), (2.4, MARROW_HU)))


def _fragment(spec: PhantomSpec, scene: Scene, *, upper: bool) -> list[Solid]:
    """Cortical tube with marrow, cut by the fracture; the lower one ends in a condyle."""
    pose = scene.bone_a if upper else scene.bone_b
    shaft = np.float32(BONE_RADIUS_MM.get(spec.bone, DEFAULT_BONE_MM))
    normal = scene.fracture_normal.astype(np.float32)
    side, gap = (-1.0 if upper else 1.0), 0.5 * spec.fracture_gap_mm

    def flare(z: Array) -> Array:
        share = np.clip((-z - 55.0) / 45.0, 0.0, 1.0)
        return share * share * (3.0 - 2.0 * share)

    def surface(x: Array, y: Array, z: Array) -> Array:
        angle = np.arctan2(y, x)
        swell = flare(z)
        radius = shaft * (1.0 + 0.09 * np.cos(3.0 * angle)) + 13.0 * swell
        radius = radius + 2.0 * swell * np.cos(2.0 * angle)
        wall = np.sqrt(x * x + y * y) - radius
        end = np.sqrt(x * x + y * y + (z + 92.0) ** 2) - (shaft + 14.0)
        return np.where(z < -92.0, end, wall)

    def cut(x: Array, y: Array, z: Array) -> Array:
        jag = 1.3 * np.sin(0.55 * x) * np.cos(0.4 * y)
        plane = normal[0] * x + normal[1] * y + normal[2] * z + jag * normal[2]
        return side * plane + gap

    def outer(x: Array, y: Array, z: Array) -> Array:
        return np.maximum(surface(x, y, z), cut(x, y, z)).astype(np.float32)

    def inner(x: Array, y: Array, z: Array) -> Array:
        wall = surface(x, y, z) + 4.2 - 2.6 * flare(z)
        return np.maximum(wall, cut(x, y, z) + 0.2).astype(np.float32)

    def spongy(x: Array, y: Array, z: Array) -> Array:
        wall = surface(x, y, z) + 1.8
        return np.maximum(np.maximum(wall, z + 62.0), cut(x, y, z)).astype(np.float32)

    reach = float(shaft) + 18.0
    low = (-reach, -reach, -12.0 if upper else -92.0 - reach)
    high = (reach, reach, LONGEST_MM if upper else 12.0)
    solids = [
        Solid(outer, pose, low, high, ((0.0, CORTEX_HU),)),
        Solid(inner, pose, low, high, ((0.0, MARROW_HU),)),
    ]
    if not upper:
        solids.append(Solid(spongy, pose, low, (reach, reach, -55.0), ((0.0, CANCELLOUS_HU),)))
    return solids
