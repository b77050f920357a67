"""Gates that no room's own tests hold by themselves."""

import ast
import json

import numpy as np
import pytest
from hexafix import gates
from hexafix.errors import HexaFixError, InputError, Refused
from hexafix.hardware import MarkerLayout
from hexafix.markers import Ball, find
from hexafix.recognition import least_squares
from hexafix.recognition.rigid import MIN_TRIANGLE_HEIGHT_MM, best_triangle_height_mm
from hexafix.strict_json import parse_json_object
from hypothesis import assume, given, settings
from hypothesis import strategies as st

RUNS_CONTENT = {"pickle", "cPickle", "marshal", "shelve", "dill", "runpy", "code"}
CALLS = {"eval", "exec", "compile", "__import__", "joblib.load"}


def case_faults(measured, document):
    with pytest.raises(InputError) as error:
        measured.read(document)
    return {(fault.where, fault.code): fault for fault in error.value.faults}


@pytest.mark.parametrize("per_mm", [0.1, 1 / 25.4], ids=["cm", "inch"])
def test_readings_in_centimetres_or_inches_are_refused(measured, per_mm):
    document = measured.PLAIN.document()
    document["strut_readings_mm"] = [q * per_mm for q in document["strut_readings_mm"]]
    found = case_faults(measured, document)
    assert len(found) == 6
    assert {(f.code, f.hazard) for f in found.values()} == {("strut-reading-out-of-range", "H26")}


def test_a_reading_off_by_more_than_a_millimetre_is_told():
    told = gates.struts_agree([0.1, 0.0, 0.0, -1.2, 0.3, 0.0])
    assert told.passed
    assert "strut 4" in told.message
    assert "read it again" in told.message
    assert gates.struts_agree([0.1, 0.0, 0.0, -0.9, 0.3, 0.0]).message == "readings and CT agree"


@pytest.mark.parametrize(
    ("key", "allowed", "refused"),
    [("max_rate_mm_per_day", 3.0, 3.1), ("max_rate_deg_per_day", 5.0, 5.1)],
)
def test_a_rate_beyond_the_hard_limit_is_refused(measured, key, allowed, refused):
    document = measured.PLAIN.document()
    document["schedule"][key] = allowed
    measured.read(document)
    document["schedule"][key] = refused
    assert (f"schedule.{key}", "case-value") in case_faults(measured, document)


def test_subtracted_pose_vectors_are_compared_with_composed_poses():
    near, far = (gates.subtraction_near_composition(mm) for mm in (0.04, 0.06))
    assert near.passed
    assert far.passed
    assert "BEYOND" not in near.name
    assert "BEYOND" in far.name
    assert "too large" in far.message
    assert "BEYOND" in gates.subtraction_near_composition(np.nan).name


def test_an_additive_plan_tells_how_far_its_subtraction_is_off(a_phantom, a_phantom_case):
    from hexafix.pipeline import plan_correction

    def told(mode):
        schedule = {**a_phantom.case["schedule"], "compensation": mode}
        plan = plan_correction(a_phantom_case(schedule=schedule), volume=a_phantom.volume)
        return [gate for gate in plan.gates if gate.gate == "H34"]

    (gate,) = told("additive")
    assert 0.0 < gate.value < 0.5
    assert gate.limit == gates.SUBTRACTION_WARNING_MM
    assert told("fused") == []


@pytest.mark.parametrize(
    ("place", "key"),
    [
        ("schedule", "structures_at_risk_ras_mm"),
        ("correction", "position_ras_mm"),
        ("limb", "side_ras"),
    ],
)
def test_points_in_ras_are_refused(measured, place, key):
    document = measured.PLAIN.document()
    document[place][key] = [[1.0, 2.0, 3.0]]
    assert (f"{place}.{key}", "unknown-key") in case_faults(measured, document)


def test_markups_in_ras_are_noticed():
    from hexafix.verify.printed import _markup_differences

    def differences(system):
        markup = {"coordinateSystem": system, "controlPoints": [{"label": "1", "position": [1]}]}
        document = {"balls": [{"number": 1, "center_mm": [1]}], "numbering": {"1": [1]}}
        return _markup_differences(document, json.dumps({"markups": [markup]}).encode())

    assert differences("LPS") == []
    assert differences("RAS")


def test_a_print_that_differs_is_never_written(a_phantom, a_phantom_case, tmp_path, monkeypatch):
    from hexafix import verify
    from hexafix.pipeline import plan_and_export

    monkeypatch.setattr(verify, "check_printed", lambda *_: ["schedule.csv: row 3"])
    with pytest.raises(HexaFixError) as error:
        plan_and_export(a_phantom_case(), tmp_path / "out", volume=a_phantom.volume)
    assert [(f.code, f.hazard) for f in error.value.faults] == [("print-differs", "H41")]
    assert error.value.exit_code == 1
    assert not (tmp_path / "out").exists()


def test_a_demo_that_does_not_verify_fails(tmp_path, monkeypatch):
    from hexafix import case, pipeline, verify
    from hexafix.cli import demo
    from hexafix.phantom import compare
    from hexafix.progress import silent

    verdict = {"verified": False, "checks": [{"name": "print", "passed": False}]}
    monkeypatch.setattr(demo, "run_phantom", lambda *_, **__: {})
    monkeypatch.setattr(case, "load_case", lambda *_: None)
    plan = {"schedule": {"days": 1}}
    monkeypatch.setattr(pipeline, "plan_and_export", lambda *_, **__: plan)
    monkeypatch.setattr(verify, "verify_export", lambda *_: verdict)
    monkeypatch.setattr(compare, "errors_against_truth", lambda *_: {})
    with pytest.raises(Refused) as error:
        demo.run_demo(tmp_path / "demo", seed=1, progress=silent)
    assert [(f.code, f.hazard) for f in error.value.faults] == [("not-verified", "H41")]


def test_of_two_fits_that_overlap_only_the_rounder_one_stays():
    def fit(place, rms):
        shape = {"diameter_mm": 10.0, "covariance_mm2": np.eye(3), "core_hu": 2000.0}
        ball = Ball(np.array(place), rms_residual_mm=rms, method="gradient-rays", **shape)
        return find.FittedBall(ball, 2000.0)

    good, worse, apart = fit([0, 0, 0.0], 0.02), fit([8.0, 0, 0], 0.05), fit([30.0, 0, 0], 0.04)
    kept, dropped = find._apart([worse, good, apart], 5.0)
    assert kept == [good, apart]
    assert [d.reason.split(":")[0] for d in dropped] == ["overlap"]


def test_a_ring_pose_that_does_not_settle_is_refused(monkeypatch):
    layout = MarkerLayout.of(
        radius_mm=[80.0] * 3, sweep_deg=[0.0, 105.0, 225.0], height_mm=[12.0] * 3
    )
    points = layout.points_mm + np.array([[0.2, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    weights = np.array([np.diag([1.0, 4.0, 9.0]) * k for k in (1, 2, 3)]) * 1e-3
    least_squares.ring_pose(points, layout, covariances_mm2=weights)
    monkeypatch.setattr(least_squares, "MAX_STEPS", 1)
    with pytest.raises(Refused) as error:
        least_squares.ring_pose(points, layout, covariances_mm2=weights)
    assert [(f.code, f.hazard) for f in error.value.faults] == [("ring-pose-diverged", "H19")]


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-150, 150), st.floats(-150, 150), st.floats(-40, 40)),
        min_size=3,
        max_size=8,
    )
)
def test_a_layout_of_ten_millimetres_height_is_spread_across_its_best_line(places):
    points = np.array(places)
    assume(best_triangle_height_mm(points) >= MIN_TRIANGLE_HEIGHT_MM)
    second = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1]
    assert second >= MIN_TRIANGLE_HEIGHT_MM / np.sqrt(2.0) - 1e-9


@pytest.mark.parametrize(
    "raw",
    [
        b'{"a": 1, "a": 2}',
        b'{"a": {"b": 1, "c": 2, "b": 1}}',
        b'{"a": [{"b": 1}, {"b": 1, "b": 2}]}',
    ],
)
def test_a_key_given_twice_is_refused_wherever_it_stands(raw):
    with pytest.raises(InputError) as error:
        parse_json_object(raw, what="case file", where="case.json")
    assert [(f.code, f.hazard) for f in error.value.faults] == [("duplicate-key", "H55")]


@pytest.mark.parametrize("text", ["NaN", "Infinity", "-Infinity", "[1, NaN]"])
def test_what_is_no_number_of_json_is_refused(text):
    with pytest.raises(InputError) as error:
        parse_json_object(f'{{"a": {text}}}'.encode(), what="case file", where="case.json")
    assert [(f.code, f.hazard) for f in error.value.faults] == [("not-json", "H55")]


def test_no_module_can_run_what_a_file_holds(hazard_table):
    found = []
    for file, tree in hazard_table.package_files(everywhere=True):
        for node in ast.walk(tree):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [(str(file), n) for n in names if n.split(".")[0] in RUNS_CONTENT]
            if isinstance(node, ast.Call):
                name = node.func.id if isinstance(node.func, ast.Name) else ast.unparse(node.func)
                shut = [ast.unparse(k.value) for k in node.keywords if k.arg == "allow_pickle"]
                open_ = "load" in name and shut not in ([], ["False"])
                found += [(str(file), name)] if name in CALLS or open_ else []
    assert found == []
