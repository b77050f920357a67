"""The fixator in the scanner: rings, struts, joints, rods, bolts, wires and pins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexafix.geometry import Pose
from hexafix.hardware import MarkerLayout, Ring
from hexafix.phantom.scene import Scene
from hexafix.phantom.solids import (
    Array,
    Solid,
    cylinder,
    ellipsoid,
    frame_along,
    half_ball,
    hex_prism,
    rod,
)
from hexafix.phantom.spec import ALUMINIUM_HU, RING_HU, STEEL_HU, PhantomSpec

PLATE_WIDTH_MM, HOLE_RADIUS_MM, HOLES = 30.0, 3.5, 36
JOINT_RADIUS_MM, STRUT_RADIUS_MM = 6.0, 6.0
JOINT_RADII_MM = (JOINT_RADIUS_MM, JOINT_RADIUS_MM, JOINT_RADIUS_MM)
WIRE_DIAMETER_MM, PIN_DIAMETER_MM = 1.8, 5.0


def frame_solids(spec: PhantomSpec, scene: Scene) -> list[Solid]:
    """Everything that belongs to the fixator except marker balls, in painting order."""
    solids: list[Solid] = []
    sides = (
        (scene.ring_a, spec.fixator.proximal, spec.proximal, scene.bone_a),
        (scene.ring_b, spec.fixator.distal, spec.distal, scene.bone_b),
    )
    for pose, ring, layout, bone in sides:
        solids.append(plate(pose, ring, RING_HU[spec.ring_material]))
        solids += _stems(pose, ring)
        solids += fixation(pose, ring, layout, bone)
        solids += _rods(spec, scene, pose, ring, layout)
    for number in range(6):
        solids += strut(scene.joints_b_mm[number], scene.joints_a_mm[number])
    return solids


def plate(pose: Pose, ring: Ring, hu: float) -> Solid:
    """Ring plate with a circle of holes; its upper plane is the ring frame's x-y plane."""
    outer, thickness = ring.outer_radius_mm, ring.thickness_mm
    middle, half = outer - PLATE_WIDTH_MM / 2.0, PLATE_WIDTH_MM / 2.0
    pitch = np.float32(2.0 * np.pi / HOLES)

    def distance(x: Array, y: Array, z: Array) -> tuple[Array, ...]:
        rho = np.sqrt(x * x + y * y)
        angle = np.arctan2(y, x)
        angle = angle - pitch * np.rint(angle / pitch)
        hole = HOLE_RADIUS_MM - np.hypot(rho * np.cos(angle) - middle, rho * np.sin(angle))
        face = np.abs(z + thickness / 2) - thickness / 2
        return np.maximum(np.abs(rho - middle) - half, hole), face

    return Solid(distance, pose, (-outer, -outer, -thickness), (outer, outer, 0.0), ((0.0, hu),))


def strut(lower_mm: NDArray, upper_mm: NDArray) -> list[Solid]:
    """Telescopic strut between two joint centres, LPS mm, with its steel ball joints."""
    pose = frame_along(lower_mm, upper_mm)
    length = float(np.linalg.norm(upper_mm - lower_mm))
    split = 0.55 * length
    bars = [
        cylinder(pose, 0.0, length, 3.0, ((0.0, STEEL_HU),)),
        cylinder(pose, 14.0, split, STRUT_RADIUS_MM, ((0.0, ALUMINIUM_HU), (1.6, -1000.0))),
        cylinder(pose, 14.0, length - 14.0, 3.4, ((0.0, STEEL_HU),)),
        cylinder(pose, split - 2.0, split + 9.0, 8.5, ((0.0, ALUMINIUM_HU),)),
    ]
    joints = [
        ellipsoid(Pose(np.eye(3), center), JOINT_RADII_MM, STEEL_HU)
        for center in (lower_mm, upper_mm)
    ]
    return bars + joints


def _stems(pose: Pose, ring: Ring) -> list[Solid]:
    """Stems that carry the joints on the plate."""
    above = float(np.mean(ring.joints_mm[:, 2])) > -ring.thickness_mm / 2.0
    far, sign = (-ring.thickness_mm, -1.0) if above else (0.0, 1.0)
    solids = []
    for joint in ring.joints_mm:
        foot = pose.apply(np.array([joint[0], joint[1], far]))
        solids.append(rod(foot, pose.apply(joint), 6.0, STEEL_HU))
        ends = sorted((0.0, sign * 5.0))
        solids.append(hex_prism(Pose(pose.rotation, foot), ends[0], ends[1], 10.0, STEEL_HU))
    return solids


def _rods(
    spec: PhantomSpec, scene: Scene, pose: Pose, ring: Ring, layout: MarkerLayout
) -> list[Solid]:
    """Resin connection rods from the plate to the balls, with their buckles."""
    if spec.rod_diameter_mm <= 0.0:
        return []
    solids = []
    for site, nominal in zip(layout.sites, layout.points_mm, strict=True):
        face = 0.0 if site.height_mm > -ring.thickness_mm / 2.0 else -ring.thickness_mm
        foot = pose.apply(np.array([nominal[0], nominal[1], face]))
        ball = scene.balls_mm[site.number]
        solids.append(rod(foot, ball, spec.rod_diameter_mm, spec.rod_hu))
        buckle = cylinder(frame_along(foot, ball), 0.0, 4.0, 6.0, ((0.0, spec.rod_hu),))
        solids.append(buckle)
    return solids


def fixation(pose: Pose, ring: Ring, layout: MarkerLayout, bone: Pose) -> list[Solid]:
    """Two crossed wires and a half-pin of a ring, with bolts, nuts and the pin's post."""
    up = 1.0 if np.mean(ring.joints_mm[:, 2]) < -ring.thickness_mm / 2.0 else -1.0
    face = 0.0 if up > 0 else -ring.thickness_mm
    frame = pose.inverse() @ bone
    circle = ring.outer_radius_mm - PLATE_WIDTH_MM / 2.0
    solids: list[Solid] = []
    taken = [np.arctan2(p[1], p[0]) for p in layout.points_mm]
    for number, height in enumerate((3.0, 5.5)):
        z = face + up * height
        center = _on_axis(frame, z)
        angle = freest_angle(taken, spread=np.pi)
        ends = _chord(center, angle, circle)
        taken += [angle, angle + np.pi]
        start, end = (pose.apply(np.array([*xy, z])) for xy in ends)
        solids.append(rod(start, end, WIRE_DIAMETER_MM, STEEL_HU))
        for xy in ends:
            solids += _bolt(pose, xy, ring.thickness_mm, up, dome=number == 0)
    z = face + up * 24.0
    center = _on_axis(frame, z)
    angle = freest_angle(taken, spread=2.0 * np.pi)
    foot = circle * np.array([np.cos(angle), np.sin(angle)])
    inward = center - foot
    tip = center + 12.0 * inward / np.linalg.norm(inward)
    outside = foot - 10.0 * inward / np.linalg.norm(inward)
    solids += [
        rod(
            pose.apply(np.array([*outside, z])),
            pose.apply(np.array([*tip, z])),
            PIN_DIAMETER_MM,
            STEEL_HU,
        ),
        rod(
            pose.apply(np.array([*foot, face])),
            pose.apply(np.array([*foot, z + up * 6.0])),
            12.0,
            ALUMINIUM_HU,
        ),
    ]
    return solids


def freest_angle(taken_rad: list[float], *, spread: float) -> float:
    """Angle on the ring farthest from those taken; a spread of π keeps its opposite free too."""
    tries = np.radians(np.arange(0.0, np.degrees(spread), 2.5))
    ends = np.stack([tries, tries + np.pi], -1) if spread < 4.0 else tries[:, None]
    gaps = np.angle(np.exp(1j * (ends[..., None] - np.array(taken_rad))))
    return float(tries[np.argmax(np.abs(gaps).min(axis=(1, 2)))])


def _on_axis(frame: Pose, z: float) -> NDArray[np.float64]:
    """Where the bone's axis crosses a height of the ring frame, x and y, mm."""
    axis, origin = frame.rotation[:, 2], frame.position_mm
    return (origin + axis * (z - origin[2]) / axis[2])[:2]


def _chord(center: NDArray, angle: float, radius: float) -> tuple[NDArray, NDArray]:
    """Ends on a circle of the straight line through a point at an angle, mm."""
    along = np.array([np.cos(angle), np.sin(angle)])
    middle = center @ along
    reach = np.sqrt(middle**2 + radius**2 - center @ center)
    return center + (-middle - reach) * along, center + (-middle + reach) * along


def _bolt(pose: Pose, xy: NDArray, thickness: float, up: float, *, dome: bool) -> list[Solid]:
    """Wire fixation bolt through the plate: hexagon head on one face, nut or dome on the other."""
    face, back = (0.0, -thickness) if up > 0 else (-thickness, 0.0)
    seat = Pose(pose.rotation, pose.apply(np.array([*xy, 0.0])))
    head = sorted((face, face + up * 8.0))
    solids = [
        cylinder(seat, -thickness, 0.0, 3.0, ((0.0, STEEL_HU),)),
        hex_prism(seat, head[0], head[1], 10.0, STEEL_HU),
    ]
    nut = sorted((back, back - up * 5.0))
    solids.append(hex_prism(seat, nut[0], nut[1], 10.0, STEEL_HU))
    if dome:
        flip = np.diag([1.0, -up, -up])
        top = pose.apply(np.array([*xy, back - up * 5.0]))
        solids.append(half_ball(Pose(pose.rotation @ flip, top), 5.0, ALUMINIUM_HU))
    return solids
