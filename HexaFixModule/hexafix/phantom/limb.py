"""The limb: soft tissue, two bone fragments, and the table under it."""

from __future__ import annotations

import numpy as np

from hexafix.geometry import Pose
from hexafix.phantom.scene import Scene
from hexafix.phantom.solids import Array, Solid, slab_box
from hexafix.phantom.spec import PhantomSpec

SKIN_HU, FAT_HU, MUSCLE_HU, CORTEX_HU, MARROW_HU = 60.0, -100.0, 55.0, 1450.0, 40.0
CANCELLOUS_HU = 320.0
LIMB_RADIUS_MM, BONE_RADIUS_MM = {"femur": 64.0}, {"femur": 14.0}
LONGEST_MM = 400.0


def limb_solids(spec: PhantomSpec, scene: Scene) -> list[Solid]:
    """Table, soft tissue and bone in painting order."""
    solids: list[Solid] = []
    if spec.table:
        solids.append(_table(scene))
    if spec.limb:
        solids.append(_soft_tissue(spec, scene))
        for upper in (True, False):
            solids += _fragment(spec, scene, upper=upper)
    return solids


def _table(scene: Scene) -> Solid:
    """Carbon table with a foam core, behind (posterior of) the frame."""
    middle = 0.5 * (scene.ring_a.position_mm + scene.ring_b.position_mm)
    pose = Pose(np.eye(3), middle + np.array([0.0, 138.0, 0.0]))
    return slab_box(pose, (215.0, 9.0, LONGEST_MM), ((0.0, 80.0), (1.8, -880.0)))


def _soft_tissue(spec: PhantomSpec, scene: Scene) -> Solid:
    """Skin, fat and muscle around an axis that bends where the fragments do."""
    lower = scene.bone_b
    shift = lower.inverse() @ scene.bone_a
    slope = (shift.rotation[:, 2] / shift.rotation[2, 2]).astype(np.float32)
    jump = shift.position_mm.astype(np.float32)
    radius = np.float32(LIMB_RADIUS_MM.get(spec.bone, 52.0))

    def distance(x: Array, y: Array, z: Array) -> Array:
        share = np.clip((z + 25.0) / 50.0, 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        u = x - share * (jump[0] + slope[0] * z) + np.float32(0.18) * radius
        v = (y - share * (jump[1] + slope[1] * z)) * np.float32(1.08)
        girth = radius * (1.0 + 0.0011 * np.clip(z, -150.0, 150.0))
        return np.hypot(u, v) - girth

    reach = 1.5 * float(radius) + 25.0
    layers = ((0.0, SKIN_HU), (1.8, FAT_HU), (8.0, MUSCLE_HU))
    low, high = (-reach, -reach, -LONGEST_MM), (reach, reach, LONGEST_MM)
    return Solid(distance, lower, low, high, layers)


def _fragment(spec: PhantomSpec, scene: Scene, *, upper: bool) -> list[Solid]:
    """Cortical tube with marrow, cut by the fracture; the lower one ends in a condyle."""
    pose = scene.bone_a if upper else scene.bone_b
    shaft = np.float32(BONE_RADIUS_MM.get(spec.bone, 12.5))
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
        wall = np.hypot(x, y) - radius
        end = np.sqrt(x * x + y * y + (z + 92.0) ** 2) - (shaft + 14.0)
        return np.where(z < -92.0, end, wall)

    def cut(x: Array, y: Array, z: Array) -> Array:
        jag = 1.2 * np.sin(0.9 * x) * np.cos(0.7 * y)
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
