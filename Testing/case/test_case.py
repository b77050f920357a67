"""The case file is read strictly; every fault is named at once with its JSON path."""

import datetime
import json

import numpy as np
import pytest
from hexafix.case import case_from_document, load_case, load_layouts, load_rings
from hexafix.errors import InputError


def read(document, folder, **options):
    raw = document if isinstance(document, bytes) else json.dumps(document).encode()
    return case_from_document(raw, folder=folder, **options)


def faults(document, folder, **options):
    with pytest.raises(InputError) as error:
        read(document, folder, **options)
    return {fault.where: fault for fault in error.value.faults}


def test_the_contracts_example_reads_with_radians_inside(a_case_document, a_case_folder):
    case = read(a_case_document, a_case_folder)
    assert case.proximal.numbers == (1, 2, 3)
    assert case.distal.numbers == (4, 5, 6)
    assert case.proximal.sites[1].sweep_rad == pytest.approx(np.radians(105))
    assert case.schedule.start_date == datetime.date(2026, 12, 1)
    assert case.schedule.max_rate_rad_per_day == pytest.approx(np.radians(1))
    assert case.fixator.id == "generic-6sps-160"
    assert case.correction.pose.position_mm.tolist() == [0, 0, 185]


def test_the_document_keeps_no_path(a_case_document, a_case_folder):
    a_case_document["image"]["path"] = "ct"
    case = read(a_case_document, a_case_folder)
    assert case.document["image"] == {"path": None, "series_instance_uid": None}
    assert case.document["fixator"]["id"] == "generic-6sps-160"


def test_every_fault_is_named_at_once_with_its_path(a_case_document, a_case_folder):
    d = a_case_document
    d["limb"]["side"] = "middle"
    d["markers"]["proximal"][1]["radius_mm"] = -3
    d["strut_readings_mm"][4] = 19.02
    d["shedule"] = {}
    d["schedule"]["max_rate_mm_per_day"] = 9.0
    d["image"]["path"] = "nowhere"
    found = faults(d, a_case_folder)
    assert set(found) == {
        "limb.side",
        "markers.proximal[1].radius_mm",
        "strut_readings_mm[4]",
        "shedule",
        "schedule.max_rate_mm_per_day",
        "image.path",
    }
    assert found["shedule"].code == "unknown-key"
    assert found["strut_readings_mm[4]"].hazard == "H26"


@pytest.mark.parametrize(
    ("path", "value", "where"),
    [
        (("schema_version",), 3, "schema_version"),
        (("case_id",), "../x", "case_id"),
        (("strut_readings_mm", 0), "190,2", "strut_readings_mm[0]"),
        (("strut_readings_mm",), [190.0] * 5, "strut_readings_mm"),
        (("markers", "distal", 0, "number"), 1, "markers.distal[0].number"),
        (("markers", "distal", 0, "number"), True, "markers.distal[0].number"),
        (("markers", "ball_diameter_mm"), 0.0, "markers.ball_diameter_mm"),
        (("correction", "kind"), "wish", "correction"),
        (("correction", "angles_deg"), [0, 0], "correction.angles_deg"),
        (("schedule", "start_date"), "1.12.2026", "schedule.start_date"),
        (("schedule", "compensation"), "much", "schedule.compensation"),
        (("schedule", "adjustments_per_day"), 0, "schedule.adjustments_per_day"),
        (("fixator",), "taylor", "fixator"),
    ],
)
def test_a_wrong_value_is_refused_at_its_path(a_case_document, a_case_folder, path, value, where):
    target = a_case_document
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    assert where in faults(a_case_document, a_case_folder)


def test_a_mirrored_motion_is_refused(a_case_document, a_case_folder):
    a_case_document["correction"] = {
        "kind": "fragment-motion",
        "moving": "proximal",
        "matrix_lps": [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
    }
    found = faults(a_case_document, a_case_folder)
    assert found["correction.matrix_lps"].hazard == "H01"


def test_a_deformity_needs_its_direction_in_words(a_case_document, a_case_folder):
    a_case_document["correction"] = {
        "kind": "deformity",
        "origin_lps_mm": [0, 0, 0],
        "ap_angulation_deg": 5.0,
    }
    assert "correction.ap_angulation" in faults(a_case_document, a_case_folder)
    a_case_document["correction"]["ap_angulation"] = "varus"
    case = read(a_case_document, a_case_folder)
    assert case.correction.moving == "distal"
    assert case.correction.ap_angulation_deg == 5.0


def test_unequal_landmarks_are_refused(a_case_document, a_case_folder):
    a_case_document["correction"] = {
        "kind": "landmarks",
        "moving": "distal",
        "moving_points_lps_mm": [[0, 0, 0], [0, 50, 0], [50, 0, 0]],
        "fixed_points_lps_mm": [[0, 0, 0], [0, 50, 0], [50, 0, 0], [1, 1, 1]],
    }
    assert "correction.fixed_points_lps_mm" in faults(a_case_document, a_case_folder)


def test_the_users_numbering_must_name_every_marker_and_no_other(a_case_document, a_case_folder):
    a_case_document["numbering"] = {str(n): [n * 10.0, 0, 0] for n in (1, 2, 3, 4, 5, 9)}
    assert {"numbering", "numbering.9"} <= set(faults(a_case_document, a_case_folder))


def test_readings_correction_and_schedule_are_needed_only_for_a_plan(
    a_case_document, a_case_folder
):
    for key in ("strut_readings_mm", "correction", "schedule"):
        del a_case_document[key]
    assert read(a_case_document, a_case_folder, plannable=False).schedule is None
    assert set(faults(a_case_document, a_case_folder)) == {
        "strut_readings_mm",
        "correction",
        "schedule",
    }


@pytest.mark.parametrize(
    "raw",
    [
        b"",
        b"[1]",
        b"{",
        b'{"a": NaN}',
        b'{"a": Infinity}',
        b"\xff\xfe",
        b"[" * 100_000,
        b'{"case_id": "a", "case_id": "b"}',
    ],
)
def test_what_is_no_strict_json_is_an_input_error(raw, tmp_path):
    (tmp_path / "case.json").write_bytes(raw)
    with pytest.raises(InputError) as error:
        load_case(tmp_path / "case.json")
    assert error.value.exit_code == 2
    assert error.value.faults[0].code in {"not-json", "duplicate-key"}


def test_a_missing_file_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_case(tmp_path / "none.json")


def test_layouts_are_read_from_a_case_and_from_a_layout_file(a_case_document, tmp_path):
    markers = a_case_document["markers"]
    layout = {"schema_version": 1, "proximal": markers["proximal"], "distal": markers["distal"]}
    (tmp_path / "layout.json").write_text(json.dumps(layout))
    (tmp_path / "case.json").write_text(json.dumps(a_case_document))
    one, two = (load_layouts(tmp_path / name) for name in ("layout.json", "case.json"))
    for a, b in zip(one, two, strict=True):
        assert np.array_equal(a.points_mm, b.points_mm)


@pytest.mark.parametrize("version", [0, 2, True, 1.0, "1", None])
def test_a_layout_or_ring_file_of_any_other_version_is_refused(version, a_case_document, tmp_path):
    markers = a_case_document["markers"]
    rings = {ring: markers[ring] for ring in ("proximal", "distal")}
    holes = {"holes": {"count": 36, "radius_mm": 100.0}}
    for read_file, content in ((load_layouts, rings), (load_rings, rings), (load_rings, holes)):
        path = tmp_path / "file.json"
        path.write_text(json.dumps({"schema_version": 1, **content}))
        read_file(path)
        path.write_text(json.dumps({"schema_version": version, **content}))
        with pytest.raises(InputError) as error:
            read_file(path)
        assert [fault.where for fault in error.value.faults] == ["schema_version"]


def test_the_fixator_may_be_written_out_or_lie_beside_the_case(a_case_document, a_case_folder):
    shipped = read(a_case_document, a_case_folder)
    a_case_document["fixator"] = shipped.document["fixator"]
    inline = read(a_case_document, a_case_folder)
    (a_case_folder / "frame.json").write_text(json.dumps(shipped.document["fixator"]))
    a_case_document["fixator"] = "frame.json"
    beside = read(a_case_document, a_case_folder)
    assert inline.fixator_sha256 == beside.fixator_sha256 == shipped.fixator_sha256
    a_case_document["fixator"] = {**shipped.document["fixator"], "colour": "red"}
    assert any("colour" in str(f.where) for f in faults(a_case_document, a_case_folder).values())
