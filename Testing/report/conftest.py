"""A finished plan, computed here by plain numpy, as report's input."""

import copy
import json
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

FIXATOR = Path(__file__).parents[2] / "Resources/Hardware/Frames/generic-6sps-160.json"

SITES = {
    "proximal": [(1, 100, 0, 20), (2, 100, 105, 20), (3, 100, 225, 20), (4, 95, 300, 45)],
    "distal": [(5, 100, 15, 20), (6, 100, 125, 20), (7, 105, 250, 20)],
}


def _matrix(position, angles_deg):
    m = np.eye(4)
    m[:3, :3] = Rotation.from_euler("xyz", angles_deg, degrees=True).as_matrix()
    m[:3, 3] = position
    return m


def _pose(matrix):
    angles = Rotation.from_matrix(matrix[:3, :3]).as_euler("xyz", degrees=True)
    return {
        "position_mm": matrix[:3, 3].tolist(),
        "angles_deg": angles.tolist(),
        "matrix": matrix.tolist(),
    }


def _struts(fixator, matrix):
    a, b = (np.array(fixator[ring]["joints_mm"]) for ring in ("proximal", "distal"))
    return np.linalg.norm(a @ matrix[:3, :3].T + matrix[:3, 3] - b, axis=1)


def _ring_entry(matrix, rng):
    sigma_mm, sigma_deg = [0.011, 0.012, 0.009], [0.008, 0.0075, 0.006]
    pose = _pose(matrix)
    return {
        "matrix_lps": pose["matrix"],
        "position_mm": pose["position_mm"],
        "angles_deg": pose["angles_deg"],
        "rms_mm": float(rng.uniform(0.006, 0.015)),
        "covariance": np.diag(np.square(sigma_mm + sigma_deg)).tolist(),
        "covariance_order": ["x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"],
        "covariance_frame": "ring",
        "sigma_position_mm": sigma_mm,
        "sigma_angles_deg": sigma_deg,
        "residuals_mm": rng.uniform(0.003, 0.02, 4).tolist(),
        "group_method": {
            "position_mm": (matrix[:3, 3] + 0.004).tolist(),
            "angles_deg": pose["angles_deg"],
            "difference_mm": 0.007,
            "difference_deg": 0.004,
        },
    }


def _schedule(fixator, start, target, days, per_day, step):
    """Rows of a straight path in pose parameters, rounded to the step."""
    offset = fixator["strut"]["scale_offset_mm"]
    first = date(2026, 12, 1)
    readings = np.round(_struts(fixator, _matrix(*start)) - offset, 1)
    rows = [{"day": 0, "date": first.isoformat(), "adjustment": 0, "strut_mm": readings.tolist()}]
    count = days * per_day
    for k in range(1, count + 1):
        position, angles = (np.array(s) + (np.array(t) - s) * k / count
                            for s, t in zip(start, target, strict=True))  # fmt: skip
        values = np.round((_struts(fixator, _matrix(position, angles)) - offset) / step) * step
        day = (k - 1) // per_day + 1
        rows.append(
            {
                "day": day,
                "date": (first + timedelta(days=day - 1)).isoformat(),
                "adjustment": (k - 1) % per_day + 1,
                "strut_mm": values.tolist(),
            }
        )
    table = np.array([row["strut_mm"] for row in rows])
    return {
        "start_date": first.isoformat(),
        "adjustments_per_day": per_day,
        "days": days,
        "strut_step_mm": step,
        "rows": rows,
        "ruling_point": "joint 3 of the proximal ring",
        "rate_mm_per_day": 0.98,
        "rate_deg_per_day": 0.6,
        "realised_max_mm_per_day": 1.12,
        "end_error_mm": 0.213,
        "end_error_deg": 0.152,
        "strut_range_mm": [float(table.min()), float(table.max())],
        "strut_min_mm": table.min(0).tolist(),
        "strut_max_mm": table.max(0).tolist(),
        "condition_number_max": 8.43,
    }


def _gates():
    rows = [
        ("G2", "rigid RMS of the proximal ring", "H02", 0.012, 0.5, "mm"),
        ("G2", "rigid RMS of the distal ring", "H02", 0.009, 0.5, "mm"),
        ("G3", "ball diameter against the known one", "H15", 0.021, 0.3, "mm"),
        ("G4", "proximal ring above the distal ring along {B} z", "H20", 172.4, 0.0, "mm"),
        ("G5", "rotation rebuilt from its angles", "H01", 2.2e-16, 1e-9, ""),
        ("G6", "largest strut difference, CT against reading", "H24", 0.14, 2.0, "mm"),
        ("G7", "uniqueness margin of the numbering", "H18", 9.4, 5.0, "mm"),
        ("G8", "second starts of the forward kinematics agree", "H30", 3e-11, 1e-6, "mm"),
        ("G9", "independent recomputation of the schedule", "H41", 0.0, 1e-6, "mm"),
    ]
    keys = ("gate", "name", "hazard", "value", "limit", "unit")
    return [dict(zip(keys, row, strict=True), passed=True, message="passed") for row in rows]


def _balls(matrices, rng):
    balls, case_rows = [], {}
    for ring, sites in SITES.items():
        case_rows[ring] = []
        for number, t, phi, h in sites:
            local = [t * np.cos(np.radians(phi)), t * np.sin(np.radians(phi)), h, 1.0]
            center = matrices[ring] @ local
            sigma = rng.uniform(0.006, 0.012, 3)
            balls.append(
                {
                    "number": number,
                    "ring": ring,
                    "center_mm": center[:3].tolist(),
                    "diameter_mm": 10 + float(rng.normal(0, 0.02)),
                    "sigma_mm": sigma.tolist(),
                    "covariance_mm2": np.diag(sigma**2).tolist(),
                    "rms_residual_mm": 0.021,
                    "core_hu": 2290.0,
                    "method": "gradient-rays",
                    "warnings": [],
                }
            )
            keys = ("number", "radius_mm", "sweep_deg", "height_mm")
            case_rows[ring].append(dict(zip(keys, (number, t, phi, h), strict=True)))
    return balls, case_rows


def example_document(
    *,
    days=12,
    per_day=4,
    step=0.5,
    case_id="left-tibia-01",
    side="left",
    bone="tibia",
):
    """A consistent plan document."""
    rng = np.random.default_rng(7)
    fixator = json.loads(FIXATOR.read_text("utf-8"))
    start = ([3.2, -6.1, 172.4], [4.0, -7.5, 3.0])
    target = ([0.0, 0.0, 178.0], [0.0, 0.0, 0.0])
    distal = _matrix([12.5, -20.25, 310.0], [8.0, -5.0, -82.0])
    mechanism = _matrix(*start)
    proximal = distal @ mechanism
    balls, case_markers = _balls({"proximal": proximal, "distal": distal}, rng)
    schedule = _schedule(fixator, start, target, days, per_day, step)
    readings = schedule["rows"][0]["strut_mm"]
    case = {
        "schema_version": 1,
        "case_id": case_id,
        "limb": {"side": side, "bone": bone},
        "image": {"path": None, "series_instance_uid": None},
        "fixator": fixator,
        "markers": {"ball_diameter_mm": 10.0, **case_markers},
        "numbering": None,
        "strut_readings_mm": readings,
        "correction": {"kind": "target-pose", "position_mm": target[0], "angles_deg": target[1]},
        "schedule": {
            "start_date": schedule["start_date"],
            "adjustments_per_day": per_day,
            "strut_step_mm": step,
            "max_rate_mm_per_day": 1.0,
            "max_rate_deg_per_day": 1.0,
            "compensation": "fused",
        },
    }
    layout = {
        "included_angles_deg": [105.0, 120.0, 75.0, 60.0],
        "rule": "preferred",
        "uniqueness_mm": 9.5,
        "predicted_error_mm": 0.031,
        "predicted_error_deg": 0.022,
        "out_of_plane_mm": 25.0,
    }
    differences = (_struts(fixator, mechanism) - np.array(readings)).tolist()
    mechanism_entry = _pose(mechanism) | {
        "covariance": np.diag([0.015**2] * 3 + [0.011**2] * 3).tolist(),
        "sigma_position_mm": [0.0153, 0.0161, 0.0124],
        "sigma_angles_deg": [0.0112, 0.0108, 0.0087],
        "from_struts": _pose(mechanism) | {"condition_number": 7.9, "iterations": 4},
        "difference": {
            "position_mm": [0.021, -0.034, 0.012],
            "angles_deg": [0.015, -0.011, 0.02],
            "distance_mm": 0.042,
            "rotation_deg": 0.027,
            "struts_mm": differences,
        },
    }
    return {
        "schema_version": 1,
        "kind": "hexafix-plan",
        "hexafix_version": "0.1.0",
        "notice": "Research software. Not a medical device.",
        "approval": "not approved",
        "case_id": case_id,
        "limb": {"side": side, "bone": bone},
        "case": case,
        "inputs": {"case_sha256": "a" * 64, "image_sha256": "3" * 64, "fixator_sha256": "f" * 64},
        "versions": {"python": "3.11.7", "numpy": "2.4.6"},
        "image": {
            "frame": "LPS",
            "kind": "dicom",
            "size_ijk": [512, 512, 400],
            "spacing_mm": [0.7, 0.7, 0.625],
            "warnings": [],
        },
        "balls": balls,
        "rejected": [{"center_mm": [1.0, 2.0, 3.0], "reason": "diameter 7.2 mm, limit 10 ± 1 mm"}],
        "numbering": {str(ball["number"]): ball["center_mm"] for ball in balls},
        "numbering_settled_by": "layout",
        "numbering_margin_mm": 9.4,
        "rings": {"proximal": _ring_entry(proximal, rng), "distal": _ring_entry(distal, rng)},
        "mechanism": mechanism_entry,
        "layout": {
            "proximal": layout,
            "distal": layout | {"included_angles_deg": [110.0, 125.0, 125.0]},
            "advice": ["a fourth ball out of the plane of the distal ring would show a mirror"],
        },
        "correction": {
            "kind": "target-pose",
            "moving": "proximal",
            "compensation": "fused",
            "start": _pose(mechanism),
            "target": _pose(_matrix(*target)),
            "corrected_rings": {
                "proximal": {"matrix_lps": proximal.tolist()},
                "distal": {"matrix_lps": distal.tolist()},
            },
            "fragment_motion_lps": {
                "matrix": (distal @ _matrix(*target) @ np.linalg.inv(proximal)).tolist(),
                "rotation_deg": 9.0,
                "translation_at_origin_mm": [1.0, 2.0, 3.0],
            },
            "recognition_error_left": "0.05 mm and 0.02° expected after compensation",
        },
        "schedule": schedule,
        "gates": _gates(),
    }


@pytest.fixture(scope="session")
def _short_plan():
    return example_document()


@pytest.fixture
def a_plan(_short_plan):
    """Twelve days of four adjustments, left tibia; each test has its own copy."""
    return copy.deepcopy(_short_plan)


@pytest.fixture(scope="session")
def a_long_plan():
    """Sixty days of four adjustments, right femur."""
    return example_document(days=60, case_id="right-femur-07", side="right", bone="femur")


@pytest.fixture
def make_plan():
    """The example plan with other days, adjustments a day or strut step."""
    return example_document
