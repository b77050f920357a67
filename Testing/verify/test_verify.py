"""A finished export is recomputed by another road; any change in it is found."""

import hashlib
import json
import re
import shutil
import zlib

import numpy as np
import pytest
from hexafix.correction import Deformity, planned_motion
from hexafix.errors import InputError
from hexafix.export import manifest
from hexafix.verify import recompute, verify_export
from hexafix.verify.target import target


@pytest.fixture
def a_copy(an_export, tmp_path):
    return shutil.copytree(an_export, tmp_path / "copy")


def sign_again(folder):
    """Make the manifest fit, so that only the content can betray the change."""
    names = ("plan.json", "schedule.csv", "prescription.pdf", "markers.mrk.json")
    (folder / "manifest.json").write_bytes(manifest({n: (folder / n).read_bytes() for n in names}))


def failed(folder):
    return [check["name"] for check in verify_export(folder)["checks"] if not check["passed"]]


def edit_plan(folder, change):
    document = json.loads((folder / "plan.json").read_text())
    change(document)
    (folder / "plan.json").write_text(json.dumps(document))
    sign_again(folder)


def test_an_untouched_export_verifies(an_export):
    verdict = verify_export(an_export)
    assert verdict["verified"], [c for c in verdict["checks"] if not c["passed"]]
    assert len(verdict["checks"]) > 30


@pytest.mark.parametrize(
    "name", ["plan.json", "schedule.csv", "prescription.pdf", "markers.mrk.json"]
)
def test_a_changed_byte_is_found_by_the_manifest(a_copy, name):
    content = bytearray((a_copy / name).read_bytes())
    content[-3] ^= 1
    (a_copy / name).write_bytes(bytes(content))
    try:
        assert f"{name} as in the manifest" in failed(a_copy)
    except InputError:
        assert name == "plan.json"


def nudge(*path, by):
    def change(document):
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] += by

    change.label = ".".join(map(str, path))
    return change


EDITS = [
    nudge("rings", "proximal", "matrix_lps", 0, 3, by=0.01),
    nudge("rings", "distal", "angles_deg", 2, by=0.01),
    nudge("mechanism", "position_mm", 1, by=0.01),
    nudge("mechanism", "from_struts", "position_mm", 2, by=0.01),
    nudge("mechanism", "difference", "struts_mm", 4, by=0.01),
    nudge("balls", 2, "center_mm", 0, by=0.05),
    nudge("correction", "target", "matrix", 0, 3, by=0.01),
    nudge("schedule", "rows", 5, "strut_mm", 2, by=1.0),
    nudge("schedule", "rows", 0, "strut_mm", 2, by=0.5),
    nudge("schedule", "rows", 7, "day", by=1),
    nudge("schedule", "rate_mm_per_day", by=0.1),
    nudge("case", "strut_readings_mm", 0, by=0.5),
    nudge("case", "markers", "distal", 1, "sweep_deg", by=0.1),
    nudge("case", "schedule", "max_rate_mm_per_day", by=-0.5),
    nudge("case", "fixator", "proximal", "joints_mm", 3, 0, by=0.1),
]


@pytest.mark.parametrize("change", EDITS, ids=lambda change: change.label)
def test_a_changed_number_is_found_by_recomputation(an_export, change):
    document = json.loads((an_export / "plan.json").read_text())
    assert recompute(document).agrees
    change(document)
    assert not recompute(document).agrees


def test_a_red_gate_in_the_plan_fails(a_copy):
    edit_plan(a_copy, lambda d: d["gates"][0].update(passed=False))
    assert "gates" in failed(a_copy)


def test_a_changed_turn_in_the_csv_fails(a_copy):
    lines = (a_copy / "schedule.csv").read_text().splitlines(keepends=True)
    day, date, adjustment, first, *rest = lines[4].split(",")
    lines[4] = ",".join([day, date, adjustment, str(float(first) + 0.5), *rest])
    (a_copy / "schedule.csv").write_text("".join(lines))
    sign_again(a_copy)
    assert failed(a_copy) == ["print"]


def test_two_exchanged_labels_in_the_markups_fail(a_copy):
    markup = json.loads((a_copy / "markers.mrk.json").read_text())
    points = markup["markups"][0]["controlPoints"]
    points[0]["position"], points[1]["position"] = points[1]["position"], points[0]["position"]
    (a_copy / "markers.mrk.json").write_text(json.dumps(markup))
    sign_again(a_copy)
    assert failed(a_copy) == ["print"]


def test_the_pdf_of_another_plan_fails(a_copy, a_phantom):
    from hexafix.report.pdf import prescription_pdf

    document = json.loads((a_copy / "plan.json").read_text())
    document["schedule"]["rows"][3]["strut_mm"][5] += 0.5
    (a_copy / "prescription.pdf").write_bytes(prescription_pdf(document))
    sign_again(a_copy)
    verdict = verify_export(a_copy)
    wrong = next(check for check in verdict["checks"] if not check["passed"])
    assert wrong["name"] == "print"
    assert "turn 3" in wrong["message"]


def test_a_pdf_that_cannot_be_read_fails(a_copy):
    (a_copy / "prescription.pdf").write_bytes(b"%PDF-1.7\n" + zlib.compress(b"nothing"))
    sign_again(a_copy)
    assert failed(a_copy) == ["print"]


@pytest.mark.parametrize("name", ["manifest.json", "schedule.csv", "plan.json"])
def test_an_incomplete_export_is_an_input_error(a_copy, name):
    (a_copy / name).unlink()
    with pytest.raises(InputError):
        verify_export(a_copy)


def test_content_that_is_no_plan_fails_without_a_traceback(a_copy):
    edit_plan(a_copy, lambda d: d.pop("rings"))
    assert failed(a_copy) == ["content"]


def test_the_manifest_lists_each_file(an_export):
    listed = json.loads((an_export / "manifest.json").read_text())["sha256"]
    for name, digest in listed.items():
        assert hashlib.sha256((an_export / name).read_bytes()).hexdigest() == digest
    assert re.fullmatch(r"[0-9a-f]{64}", listed["plan.json"])


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("moving", ["proximal", "distal"])
def test_both_roads_to_a_deformitys_correction_agree(side, moving):
    given = {
        "kind": "deformity",
        "moving": moving,
        "origin_lps_mm": [30.0, -80.0, 400.0],
        "ap_angulation_deg": 9.0,
        "ap_angulation": "varus",
        "lateral_angulation_deg": 6.0,
        "lateral_angulation": "apex-posterior",
        "axial_rotation_deg": 11.0,
        "axial_rotation": "internal",
        "ap_translation_mm": 4.0,
        "ap_translation": "medial",
        "lateral_translation_mm": 3.0,
        "lateral_translation": "anterior",
        "axial_translation_mm": 7.0,
        "axial_translation": "short",
    }
    deformity = Deformity(**{k: v for k, v in given.items() if k != "kind"})
    motion = planned_motion(deformity, side=side).motion.matrix
    rings = (np.eye(4), np.eye(4))
    rings[0][:3, 3] = [0, 0, 180]
    other = target(given, side=side, mode="none", rings=rings, recognised=rings[0], struts=rings[0])
    expected = motion @ rings[0] if moving == "proximal" else np.linalg.solve(motion, rings[0])
    assert np.abs(other - expected).max() < 1e-9
