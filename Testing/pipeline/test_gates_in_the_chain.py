"""Each fault of hazards.md that this chain can meet is refused with its hazard id."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest
from hexafix import gates
from hexafix.errors import HexaFixError, InputError, MarkersNotFound, Refused
from hexafix.geometry import Pose
from hexafix.imaging import ImageSource, Volume
from hexafix.pipeline import plan_correction, recognise


def refusal(case, volume, **options):
    with pytest.raises(HexaFixError) as error:
        plan_correction(case, volume=volume, **options)
    assert error.value.exit_code == 3, str(error.value)
    return error.value


def hazards(error):
    return {fault.hazard for fault in error.faults}


def mirrored(volume, axis):
    """The same voxels with a world that is mirrored along one LPS axis."""
    affine = np.array(volume.ijk_to_lps)
    affine[axis] *= -1
    return Volume(volume.voxels, affine, volume.source)


def flat(case_document):
    """The layouts without the balls out of plane: a mirror cannot be seen in them."""
    markers = copy.deepcopy(case_document["markers"])
    for ring in ("proximal", "distal"):
        markers[ring] = markers[ring][:3]
    return markers


def test_the_untouched_phantom_passes_every_gate(a_phantom, a_phantom_case):
    plan = plan_correction(a_phantom_case(), volume=a_phantom.volume)
    assert gates.red(plan.gates) == ()
    assert {"G2", "G3", "G4", "G5", "G6", "G7", "G8"} <= {gate.gate for gate in plan.gates}


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mirrored_image_is_refused_with_balls_out_of_plane(a_phantom, a_phantom_case, axis):
    error = refusal(a_phantom_case(), mirrored(a_phantom.volume, axis))
    assert "H01" in hazards(error)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mirrored_image_is_refused_with_coplanar_balls(a_phantom, a_phantom_case, axis):
    case = a_phantom_case(markers=flat(a_phantom.case))
    assert gates.red(plan_correction(case, volume=a_phantom.volume).gates) == ()
    error = refusal(case, mirrored(a_phantom.volume, axis))
    assert hazards(error) & {"H01", "H18", "H20", "H21"}


def test_a_scaled_image_is_refused(a_phantom, a_phantom_case):
    affine = np.array(a_phantom.volume.ijk_to_lps)
    affine[:3, :2] *= 1.01
    error = refusal(a_phantom_case(), Volume(a_phantom.volume.voxels, affine))
    assert error.faults


def test_a_lost_slice_is_refused_by_the_struts(a_phantom, a_phantom_case):
    volume = a_phantom.volume
    middle = volume.size_ijk[2] // 2
    voxels = np.delete(volume.voxels, slice(middle, middle + 3), axis=0)
    error = refusal(a_phantom_case(), Volume(voxels, volume.ijk_to_lps))
    assert "H24" in hazards(error) or "H25" in hazards(error)


def test_a_mistyped_reading_is_refused_and_the_strut_named(a_phantom, a_phantom_case):
    readings = list(a_phantom.case["strut_readings_mm"])
    readings[3] += 10.0
    error = refusal(a_phantom_case(strut_readings_mm=readings), a_phantom.volume)
    assert hazards(error) == {"H24"}
    assert "strut 4" in str(error)


def test_exchanged_readings_are_refused_and_the_right_order_told(a_phantom, a_phantom_case):
    given = a_phantom.case["strut_readings_mm"]
    readings = [given[k] for k in (0, 4, 2, 3, 1, 5)]
    error = refusal(a_phantom_case(strut_readings_mm=readings), a_phantom.volume)
    assert hazards(error) == {"H25"}
    assert "order 1, 5, 3, 4, 2, 6" in str(error)


def test_exchanged_rings_are_refused(a_phantom, a_phantom_case):
    markers = copy.deepcopy(a_phantom.case["markers"])
    markers["proximal"], markers["distal"] = markers["distal"], markers["proximal"]
    error = refusal(a_phantom_case(markers=markers), a_phantom.volume)
    assert hazards(error) & {"H20", "H21"}


def test_a_wrong_layout_is_refused(a_phantom, a_phantom_case):
    markers = copy.deepcopy(a_phantom.case["markers"])
    markers["proximal"][2]["sweep_deg"] += 4.0
    error = refusal(a_phantom_case(markers=markers), a_phantom.volume)
    assert isinstance(error, MarkersNotFound)


def test_balls_of_another_size_are_not_taken(a_phantom, a_phantom_case):
    markers = {**copy.deepcopy(a_phantom.case["markers"]), "ball_diameter_mm": 12.0}
    error = refusal(a_phantom_case(markers=markers), a_phantom.volume)
    assert isinstance(error, MarkersNotFound)


def test_a_layout_that_breaks_both_angle_rules_is_refused_unread(a_phantom, a_phantom_case):
    markers = copy.deepcopy(a_phantom.case["markers"])
    for marker, sweep in zip(markers["proximal"], (0, 8, 16, 24), strict=True):
        marker["sweep_deg"] = sweep
    error = refusal(a_phantom_case(markers=markers), None)
    assert "H17" in hazards(error)


def test_a_relaxed_layout_needs_the_users_word(a_phantom, a_phantom_case):
    markers = flat(a_phantom.case)
    for marker, sweep in zip(markers["proximal"], (0.0, 30.0, 180.0), strict=True):
        marker["sweep_deg"] = sweep
    case = a_phantom_case(markers=markers)
    assert "H17" in hazards(refusal(case, a_phantom.volume))
    error = refusal(case, a_phantom.volume, accept_relaxed_layout=True)
    assert "H17" not in hazards(error)


def test_the_other_side_in_the_images_header_is_refused(a_phantom, a_phantom_case):
    source = ImageSource(laterality="R")
    volume = Volume(a_phantom.volume.voxels, a_phantom.volume.ijk_to_lps, source)
    assert hazards(refusal(a_phantom_case(), volume)) == {"H37"}


def test_a_leg_upside_down_in_the_image_is_refused(a_phantom, a_phantom_case):
    turned = np.diag([1.0, -1.0, -1.0, 1.0]) @ a_phantom.volume.ijk_to_lps
    volume = Volume(a_phantom.volume.voxels, turned)
    assert hazards(refusal(a_phantom_case(), volume)) == {"H21"}
    arm = a_phantom_case(limb={"side": "left", "bone": "humerus"})
    assert gates.red(recognise(arm, volume).gates) == ()


def test_a_target_out_of_the_struts_reach_is_refused(a_phantom, a_phantom_case):
    far = {"kind": "target-pose", "position_mm": [0, 0, 290], "angles_deg": [0, 0, 0]}
    assert hazards(refusal(a_phantom_case(correction=far), a_phantom.volume)) == {"H27"}


def test_a_user_numbering_that_fits_worse_is_refused(a_phantom, a_phantom_case):
    numbering = {str(b["number"]): b["center_mm"] for b in a_phantom.truth["balls"]}
    case = a_phantom_case(numbering=numbering)
    assert gates.red(plan_correction(case, volume=a_phantom.volume).gates) == ()
    numbering["1"], numbering["2"] = numbering["2"], numbering["1"]
    refusal(a_phantom_case(numbering=numbering), a_phantom.volume)


def test_a_user_numbering_far_from_every_ball_is_wrong_input(a_phantom, a_phantom_case):
    numbering = {str(b["number"]): b["center_mm"] for b in a_phantom.truth["balls"]}
    numbering["3"] = [x + 15.0 for x in numbering["3"]]
    with pytest.raises(InputError) as error:
        plan_correction(a_phantom_case(numbering=numbering), volume=a_phantom.volume)
    assert any("numbering.3" in str(fault.where) for fault in error.value.faults)


def pose(position_mm, angles_deg=(0, 0, 0)):
    return Pose.from_xyz_fixed(position_mm=position_mm, angles_rad=np.radians(angles_deg))


@pytest.mark.parametrize(
    ("gate", "good", "bad"),
    [
        (gates.moving_ring_above, (pose([0, 0, 180]),), (pose([0, 0, -180]),)),
        (
            gates.rings_face_each_other,
            (pose([0, 0, 180], (30, 0, 0)), pose([0, 0, 0])),
            (pose([0, 0, 180], (180, 0, 0)), pose([0, 0, 0])),
        ),
        (
            gates.towards_the_head,
            ("tibia", pose([0, 0, 180]), pose([0, 0, 0])),
            ("tibia", pose([0, 0, -180], (180, 0, 0)), pose([0, 0, 0], (180, 0, 0))),
        ),
        (gates.ring_rms, ("proximal", 0.1), ("proximal", 0.79)),
        (gates.ring_rms, ("proximal", 0.1), ("proximal", np.nan)),
        (gates.ball_diameters, ("distal", [10.02, 9.9], 10.0), ("distal", [10.4, 10.0], 10.0)),
        (gates.struts_agree, ([0.1, -1.9, 0, 0, 0, 0],), ([0.1, 0, -2.1, 0, 0, 0],)),
        (gates.numbering_unique, (6.0, "layout"), (0.3, "layout")),
        (gates.forward_basin, (1e-9, 20), (np.inf, 20)),
        (gates.well_conditioned, (5.0,), (500.0,)),
        (gates.realised_rate, (1.4, 1.0, 0.5), (2.1, 1.0, 0.5)),
        (
            gates.angles_rebuild,
            ("mechanism", pose([0, 0, 0], (10, 20, 30))),
            ("mechanism", SimpleNamespace(rotation=-np.eye(3), angles_rad=np.zeros(3))),
        ),
        (gates.sides_agree, ("left", None), ("left", "R")),
        (gates.sides_agree, ("left", "L"), ("right", "L")),
    ],
)
def test_a_gate_refuses_beyond_its_limit_only(gate, good, bad):
    gates.decide([gate(*good)])
    with pytest.raises(Refused) as error:
        gates.decide([gate(*bad)])
    assert error.value.faults[0].hazard


def test_every_red_gate_is_named_at_once():
    red = [
        gates.ring_rms("proximal", 9.0),
        gates.ring_rms("distal", 9.0),
        gates.well_conditioned(1),
    ]
    with pytest.raises(Refused) as error:
        gates.decide(red)
    assert len(error.value.faults) == 2


def test_recognition_error_is_refused_in_position_and_in_orientation():
    assert gates.red(gates.recognition_error(1.0, np.radians(0.5))) == ()
    assert len(gates.red(gates.recognition_error(1.6, np.radians(0.5)))) == 1
    assert len(gates.red(gates.recognition_error(1.0, np.radians(1.1)))) == 1


def test_the_recomputation_gate_refuses_a_plan_that_ends_elsewhere():
    assert gates.red(gates.recomputed(0.1, 0.05)) == ()
    assert len(gates.red(gates.recomputed(0.3, 0.2))) == 2


def test_a_relaxed_layout_is_red_without_the_users_word_and_a_violated_one_always():
    def passed(rule, accepted):
        return gates.layout_rule("proximal", rule, 20.0, relaxed_accepted=accepted).passed

    assert passed("preferred", False)
    assert passed("relaxed", True)
    assert not passed("relaxed", False)
    assert not passed("violated", True)
