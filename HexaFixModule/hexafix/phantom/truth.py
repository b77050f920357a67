"""The truth of a phantom and the case a user would have written for it, as JSON documents."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexafix.geometry import Pose
from hexafix.hardware import Fixator, MarkerLayout, Ring, shipped_fixator, shipped_fixators
from hexafix.kinematics import strut_lengths
from hexafix.phantom.clinical import deformity_document
from hexafix.phantom.scene import Scene
from hexafix.phantom.spec import PhantomSpec

TRUTH_SCHEMA_VERSION = 1
CASE_SCHEMA_VERSION = 1


def numbers(values: ArrayLike) -> Any:
    """Nested lists of plain floats, without negative zeros."""
    return (np.asarray(values, float) + 0.0).tolist()


def pose_document(pose: Pose) -> dict[str, Any]:
    """A pose with its matrix, position and angles."""
    return {
        "matrix": numbers(pose.matrix),
        "position_mm": numbers(pose.position_mm),
        "angles_deg": numbers(np.degrees(pose.angles_rad)),
    }


def truth_document(spec: PhantomSpec, scene: Scene, decoys: list[dict[str, Any]]) -> dict[str, Any]:
    """Everything that is known exactly, LPS mm, with units in the keys."""
    motion = reduction_lps(scene, spec)
    fracture = scene.bone_b.position_mm
    moved = scene.bone_a.position_mm
    displacement = scene.bone_b.inverse() @ scene.bone_a
    return {
        "schema_version": TRUTH_SCHEMA_VERSION,
        "frame": "LPS",
        "seed": spec.seed,
        "image": {
            "size_ijk": list(spec.size_ijk),
            "spacing_mm": numbers(scene.grid.spacing_mm),
            "slice_thickness_mm": spec.thickness_mm,
            "ijk_to_lps": numbers(scene.grid.ijk_to_lps),
            "psf_sigma_mm": spec.psf_sigma_mm,
            "noise_hu": spec.noise_hu,
            **_posture(spec),
        },
        "ball_diameter_mm": spec.ball_diameter_mm,
        "balls": [
            {
                "number": number,
                "ring": "proximal" if number in spec.proximal.numbers else "distal",
                "center_mm": numbers(center),
                "installation_error_mm": numbers(center - scene.nominal_mm[number]),
                "whole_in_image": in_image(center, spec.ball_diameter_mm / 2.0, scene),
            }
            for number, center in scene.balls_mm.items()
        ],
        "rings": {
            "proximal": {"matrix_lps": numbers(scene.ring_a.matrix)},
            "distal": {"matrix_lps": numbers(scene.ring_b.matrix)},
        },
        "mechanism": pose_document(spec.mechanism_pose),
        "struts": {
            "length_mm": numbers(scene.strut_lengths_mm),
            "reading_mm": numbers(scene.strut_readings_mm),
            "proximal_joints_lps_mm": numbers(scene.joints_a_mm),
            "distal_joints_lps_mm": numbers(scene.joints_b_mm),
        },
        "decoys": decoys,
        "fracture": {
            "center_distal_lps_mm": numbers(fracture),
            "center_proximal_lps_mm": numbers(moved),
            "normal_distal_lps": numbers(scene.bone_b.rotation @ scene.fracture_normal),
            "bone_axis_distal_lps": numbers(scene.bone_b.rotation[:, 2]),
            "bone_axis_proximal_lps": numbers(scene.bone_a.rotation[:, 2]),
            "gap_mm": spec.fracture_gap_mm,
            "displacement_mm": float(np.linalg.norm(moved - fracture)),
            "rotation_deg": float(np.degrees(displacement.rotation_angle_rad)),
        },
        "target": {
            "mechanism": pose_document(spec.target_pose),
            "moving": spec.moving,
            "fragment_motion_lps": numbers(motion.matrix),
            "strut_length_mm": numbers(strut_lengths(spec.target_pose, spec.fixator)),
        },
    }


def _posture(spec: PhantomSpec) -> dict[str, Any]:
    """How the scan departs from a plain one: head first, supine, axial, upright."""
    plain = PhantomSpec()
    names = ("patient_position", "slice_plane", "slices_reversed")
    told = {name: getattr(spec, name) for name in names}
    told = {name: value for name, value in told.items() if value != getattr(plain, name)}
    if spec.gantry_tilt_rad:
        told["gantry_tilt_deg"] = float(np.degrees(spec.gantry_tilt_rad))
    return told


def in_image(center_mm: np.ndarray, radius_mm: float, scene: Scene) -> bool:
    """Whether a ball with its blur lies wholly in the volume."""
    grid = scene.grid
    inverse = np.linalg.inv(grid.ijk_to_lps)
    ijk = inverse[:3, :3] @ center_mm + inverse[:3, 3]
    reach = radius_mm + 3.0 * grid.psf_sigma_mm + 0.5 * grid.thickness_mm
    reach = reach * np.linalg.norm(inverse[:3, :3], axis=1)
    return bool(np.all(ijk >= reach) and np.all(ijk <= np.array(grid.size_ijk) - 1 - reach))


def reduction_lps(scene: Scene, spec: PhantomSpec) -> Pose:
    """Motion of the moving fragment in LPS that brings {A} in {B} to the target."""
    if spec.moving == "proximal":
        return scene.ring_b @ spec.target_pose @ scene.ring_a.inverse()
    return scene.ring_a @ spec.target_pose.inverse() @ scene.ring_b.inverse()


def case_document(spec: PhantomSpec, scene: Scene, image_path: str) -> dict[str, Any]:
    """A case of the contract's schema that plans the reduction of this phantom's fracture."""
    return {
        "schema_version": CASE_SCHEMA_VERSION,
        "case_id": f"phantom-{spec.seed}",
        "limb": {"side": spec.side, "bone": spec.bone},
        "image": {"path": image_path, "series_instance_uid": None},
        "fixator": fixator_document(spec.fixator),
        "markers": {
            "ball_diameter_mm": spec.ball_diameter_mm,
            "proximal": layout_document(spec.proximal),
            "distal": layout_document(spec.distal),
        },
        "numbering": None,
        "strut_readings_mm": numbers(scene.strut_readings_mm),
        "correction": correction_document(spec, scene),
        "schedule": {
            "start_date": "2026-12-01",
            "adjustments_per_day": 4,
            "strut_step_mm": 0.5,
            "max_rate_mm_per_day": 1.0,
            "max_rate_deg_per_day": 1.0,
            "compensation": "fused",
        },
    }


def layout_document(layout: MarkerLayout) -> list[dict[str, float]]:
    """The layout as the case file writes it."""
    return [
        {
            "number": site.number,
            "radius_mm": site.radius_mm,
            "sweep_deg": round(float(np.degrees(site.sweep_rad)), 10),
            "height_mm": site.height_mm,
        }
        for site in layout.sites
    ]


def fixator_document(fixator: Fixator) -> str | dict[str, Any]:
    """The id of a shipped fixator, else the whole definition."""

    def ring(value: Ring) -> dict[str, Any]:
        return {
            "joints_mm": numbers(value.joints_mm),
            "thickness_mm": value.thickness_mm,
            "outer_radius_mm": value.outer_radius_mm,
        }

    document = {
        "schema_version": 1,
        "id": fixator.id,
        "name": fixator.name,
        "source": fixator.source,
        "proximal": ring(fixator.proximal),
        "distal": ring(fixator.distal),
        "strut": {
            "min_mm": fixator.strut.min_mm,
            "max_mm": fixator.strut.max_mm,
            "scale_offset_mm": fixator.strut.scale_offset_mm,
        },
    }
    if fixator.id in shipped_fixators():
        shipped = shipped_fixator(fixator.id)
        same = ring(shipped.proximal) == document["proximal"]
        same = same and ring(shipped.distal) == document["distal"]
        if same and shipped.strut == fixator.strut:
            return fixator.id
    return document


def correction_document(spec: PhantomSpec, scene: Scene) -> dict[str, Any]:
    """The reduction in the wanted kind of correction."""
    motion = reduction_lps(scene, spec)
    if spec.correction == "fragment-motion":
        return {
            "kind": "fragment-motion",
            "moving": spec.moving,
            "matrix_lps": numbers(motion.matrix),
        }
    moving = scene.bone_a if spec.moving == "proximal" else scene.bone_b
    if spec.correction == "landmarks":
        local = np.array([[11.0, 0, 0], [-6.0, 9.0, 0], [-6.0, -9.0, 0], [0, 0, 12.0]])
        points = moving.apply(local)
        return {
            "kind": "landmarks",
            "moving": spec.moving,
            "moving_points_lps_mm": numbers(points),
            "fixed_points_lps_mm": numbers(motion.apply(points)),
        }
    if spec.correction == "deformity":
        return deformity_document(
            motion=motion, point_mm=moving.position_mm, moving=spec.moving, side=spec.side
        )
    return {
        "kind": "target-pose",
        "position_mm": numbers(spec.target_pose.position_mm),
        "angles_deg": numbers(np.degrees(spec.target_pose.angles_rad)),
    }
