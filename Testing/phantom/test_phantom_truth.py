"""The truth agrees with itself, with the case, and with the rooms that read the case."""

import dataclasses
import json

import numpy as np
import pytest
from hexafix.case import case_from_document
from hexafix.correction.fragment import FragmentMotion
from hexafix.correction.targets import planned_motion
from hexafix.errors import InputError
from hexafix.geometry import Pose
from hexafix.phantom import Phantom, PhantomSpec, random_spec
from hexafix.phantom.scene import build_scene
from hexafix.phantom.spec import CORRECTIONS
from hexafix.phantom.truth import case_document, truth_document
from hexafix.phantom.variety import SURE_NUMBERS_MM, relabelling_rms_mm


def ring(truth: dict, side: str) -> Pose:
    return Pose.from_matrix(np.array(truth["rings"][side]["matrix_lps"]))


def documents(spec: PhantomSpec) -> tuple[dict, dict]:
    scene = build_scene(spec)
    return truth_document(spec, scene, []), case_document(spec, scene, "ct")


def test_struts_join_the_true_joints(a_coarse_phantom: Phantom, a_coarse_spec) -> None:
    struts = a_coarse_phantom.truth["struts"]
    upper = np.array(struts["proximal_joints_lps_mm"])
    lower = np.array(struts["distal_joints_lps_mm"])
    np.testing.assert_allclose(np.linalg.norm(upper - lower, axis=1), struts["length_mm"])
    back = ring(a_coarse_phantom.truth, "proximal").inverse().apply(upper)
    np.testing.assert_allclose(back, a_coarse_spec.fixator.proximal.joints_mm, atol=1e-9)
    assert np.ptp(struts["length_mm"]) > 5.0


def test_mechanism_pose_is_the_proximal_ring_seen_from_the_distal(a_coarse_phantom) -> None:
    truth = a_coarse_phantom.truth
    seen = ring(truth, "distal").inverse() @ ring(truth, "proximal")
    stated = truth["mechanism"]
    np.testing.assert_allclose(seen.matrix, stated["matrix"], atol=1e-12)
    np.testing.assert_allclose(np.degrees(seen.angles_rad), stated["angles_deg"], atol=1e-9)


def test_balls_sit_on_their_rings_up_to_the_installation_error() -> None:
    exact, _ = documents(PhantomSpec(seed=4, installation_sigma_mm=0.0))
    rough, case = documents(PhantomSpec(seed=4, installation_sigma_mm=0.2))
    for side in ("proximal", "distal"):
        sites = {site["number"]: site for site in case["markers"][side]}
        assert set(sites) == {b["number"] for b in rough["balls"] if b["ring"] == side}
        for before, after in zip(exact["balls"], rough["balls"], strict=True):
            if before["ring"] != side:
                continue
            x, y, z = ring(exact, side).inverse().apply(before["center_mm"])
            site = sites[before["number"]]
            assert np.hypot(x, y) == pytest.approx(site["radius_mm"])
            assert np.degrees(np.arctan2(y, x)) % 360 == pytest.approx(
                site["sweep_deg"] % 360, abs=1e-9
            )
            assert z == pytest.approx(site["height_mm"])
            moved = np.array(after["center_mm"]) - before["center_mm"]
            np.testing.assert_allclose(moved, after["installation_error_mm"], atol=1e-9)
    errors = [ball["installation_error_mm"] for ball in rough["balls"]]
    assert 0.1 < np.std(errors) < 0.3
    assert np.all(np.array([b["installation_error_mm"] for b in exact["balls"]]) == 0.0)


def test_readings_follow_scale_step_and_typo() -> None:
    spec = PhantomSpec(strut_reading_step_mm=0.5)
    truth, case = documents(spec)
    lengths, readings = (np.array(truth["struts"][k]) for k in ("length_mm", "reading_mm"))
    assert np.abs(lengths - readings).max() <= 0.25
    np.testing.assert_array_equal(readings * 2, np.round(readings * 2))
    offset = dataclasses.replace(
        spec.fixator, strut=dataclasses.replace(spec.fixator.strut, scale_offset_mm=40.0)
    )
    exact, _ = documents(PhantomSpec(strut_reading_step_mm=0.0, fixator=offset))
    np.testing.assert_allclose(np.array(exact["struts"]["reading_mm"]) + 40.0, lengths)
    _, wrong = documents(PhantomSpec(strut_typo=(3, 10.0)))
    change = np.array(wrong["strut_readings_mm"]) - case["strut_readings_mm"]
    np.testing.assert_allclose(change, [0, 0, 10, 0, 0, 0])


@pytest.mark.parametrize("kind", CORRECTIONS)
@pytest.mark.parametrize(("moving", "side"), [("proximal", "left"), ("distal", "right")])
def test_every_kind_of_correction_plans_the_same_reduction(kind, moving, side, tmp_path) -> None:
    spec = PhantomSpec(correction=kind, moving=moving, side=side, limb=False)
    truth, document = documents(spec)
    assert document["correction"]["kind"] == kind
    (tmp_path / "ct").mkdir()
    case = case_from_document(json.dumps(document).encode(), folder=tmp_path)
    rings = {name: ring(truth, name) for name in ("proximal", "distal")}
    plan = planned_motion(case.correction, side=case.limb.side)
    if isinstance(plan, FragmentMotion):
        assert plan.moving == moving
        rings[moving] = plan.motion @ rings[moving]
        reached = rings["distal"].inverse() @ rings["proximal"]
    else:
        reached = plan.pose
    np.testing.assert_allclose(reached.matrix, spec.target_pose.matrix, atol=1e-9)


def test_the_reduction_closes_the_fracture() -> None:
    truth, _ = documents(PhantomSpec(moving="proximal"))
    motion = Pose.from_matrix(np.array(truth["target"]["fragment_motion_lps"]))
    fracture = truth["fracture"]
    moved = motion.apply(fracture["center_proximal_lps_mm"])
    np.testing.assert_allclose(moved, fracture["center_distal_lps_mm"], atol=1e-9)
    axis = motion.rotation @ fracture["bone_axis_proximal_lps"]
    np.testing.assert_allclose(axis, fracture["bone_axis_distal_lps"], atol=1e-12)
    assert fracture["displacement_mm"] > 5.0
    assert fracture["rotation_deg"] > 3.0


def test_a_changed_fixator_goes_into_the_case_whole(tmp_path) -> None:
    spec = PhantomSpec()
    strut = dataclasses.replace(spec.fixator.strut, scale_offset_mm=12.5)
    own = dataclasses.replace(spec, fixator=dataclasses.replace(spec.fixator, strut=strut))
    assert documents(spec)[1]["fixator"] == spec.fixator.id
    document = documents(own)[1]
    (tmp_path / "ct").mkdir()
    read = case_from_document(json.dumps(document).encode(), folder=tmp_path).fixator
    assert read.strut == strut
    np.testing.assert_array_equal(read.proximal.joints_mm, spec.fixator.proximal.joints_mm)


def test_documents_are_plain_json_of_finite_numbers(a_coarse_phantom: Phantom) -> None:
    for document in (a_coarse_phantom.truth, a_coarse_phantom.case):
        text = json.dumps(document, allow_nan=False)
        assert json.loads(text) == document
        assert document["schema_version"] == 1


def test_random_specs_differ_and_can_be_built_with_sure_numbers() -> None:
    specs = [random_spec(seed) for seed in range(8)]
    poses = {tuple(np.round(spec.mechanism_pose.position_mm, 6)) for spec in specs}
    assert len(poses) == 8
    for spec in specs:
        truth, _ = documents(spec)
        assert all(ball["whole_in_image"] for ball in truth["balls"])
        for layout in (spec.proximal, spec.distal):
            assert relabelling_rms_mm(layout) >= SURE_NUMBERS_MM
    again = random_spec(3, noise_hu=80.0)
    assert again.noise_hu == 80.0
    np.testing.assert_array_equal(again.ring_b_pose.matrix, specs[3].ring_b_pose.matrix)


def test_random_specs_that_cannot_be_built_are_refused() -> None:
    with pytest.raises(InputError, match="does not lie wholly in the volume"):
        random_spec(0, size_ijk=(20, 20, 20))
