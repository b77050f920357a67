import copy

import pytest

CASE = {
    "schema_version": 1,
    "case_id": "left-tibia-01",
    "limb": {"side": "left", "bone": "tibia"},
    "image": {"path": "ct", "series_instance_uid": None},
    "fixator": "generic-6sps-160",
    "markers": {
        "ball_diameter_mm": 10.0,
        "proximal": [
            {"number": n, "radius_mm": 100.0, "sweep_deg": phi, "height_mm": 20.0}
            for n, phi in ((1, 0.0), (2, 105.0), (3, 225.0))
        ],
        "distal": [
            {"number": n, "radius_mm": 100.0, "sweep_deg": phi, "height_mm": 20.0}
            for n, phi in ((4, 15.0), (5, 110.0), (6, 250.0))
        ],
    },
    "numbering": None,
    "strut_readings_mm": [190.2, 190.2, 190.2, 190.2, 190.2, 190.2],
    "correction": {"kind": "target-pose", "position_mm": [0, 0, 185], "angles_deg": [0, 0, 0]},
    "schedule": {
        "start_date": "2026-12-01",
        "adjustments_per_day": 4,
        "strut_step_mm": 0.5,
        "max_rate_mm_per_day": 1.0,
        "max_rate_deg_per_day": 1.0,
        "compensation": "fused",
    },
}


@pytest.fixture
def a_case_document():
    return copy.deepcopy(CASE)


@pytest.fixture
def a_case_folder(tmp_path):
    (tmp_path / "ct").mkdir()
    return tmp_path
