"""Section 2 of the hazards: which gate sees which fault, and that the chain refuses it."""

import numpy as np
import pytest
from hexafix import gates
from hexafix.geometry import Pose
from hexafix.imaging import ImageSource
from hexafix.kinematics import strut_lengths
from hexafix.pipeline.strut_witness import compare_struts
from hexafix.recognition.rigid import rigid_rms_mm
from hypothesis import given, settings
from hypothesis import strategies as st

NAMES = [
    *(f"mirror {axis}, 3 coplanar balls" for axis in "xyz"),
    *(f"mirror {axis}, rings taken by height, one shape" for axis in "xyz"),
    *(f"mirror {axis}, 3 coplanar balls and 1 raised 25 mm" for axis in "xyz"),
    "gantry tilt 16.5 deg uncorrected",
    "slice spacing 2.5 for 2.397",
    "one 5 mm slice lost",
    "PixelSpacing +1 %",
    "rings exchanged, one shape",
    "numbers turned by one, even",
    "numbers turned by one, 105/130/125",
    "two numbers exchanged, even",
    "two numbers exchanged, 105/130/125",
    "two numbers exchanged, 60/100/200",
    "reading of strut 1 +10 mm",
    "readings 3 and 4 exchanged",
    "readings in reverse order",
]


def codes(verdict):
    return {code for _, code in verdict}


def hazards(verdict):
    return {hazard for hazard, _ in verdict}


def turned(degrees, about="x", position=(0.0, 0.0, 0.0)):
    angles = np.radians([degrees * (about == axis) for axis in "xyz"])
    return Pose.from_xyz_fixed(position_mm=position, angles_rad=angles)


@pytest.mark.parametrize("name", NAMES)
def test_the_fault_turns_these_gates_red_and_the_chain_refuses(name, faults, measured):
    fault = faults[name]
    document = fault.case()
    found = measured.measure(document, fault.numbered(), fault.frame.mechanism)
    assert found.red == fault.red
    assert measured.verdict(document, fault.numbered())


def test_every_row_of_section_two_is_among_these(faults):
    assert sorted(NAMES) == sorted(faults)


@pytest.mark.parametrize("raised", [False, True])
@pytest.mark.parametrize("bone", ["tibia", "humerus"])
def test_without_a_fault_no_gate_is_red_and_the_chain_plans(measured, raised, bone):
    frame = measured.Frame(raised=raised, bone=bone)
    document, balls = frame.document(), frame.balls_mm()
    assert measured.measure(document, balls, frame.mechanism).red == frozenset()
    assert measured.verdict(document, balls) == []


def test_one_ball_out_of_plane_shows_a_mirror_in_the_residual(faults, measured):
    def rms(name):
        fault = faults[name]
        return measured.measure(fault.case(), fault.numbered(), fault.frame.mechanism).rms_mm

    assert max(rms("mirror x, 3 coplanar balls")) < 1e-9
    assert min(rms("mirror x, 3 coplanar balls and 1 raised 25 mm")) > 10.0


def test_only_the_pose_sees_exchanged_rings_of_one_shape(faults, measured):
    fault = faults["rings exchanged, one shape"]
    found = measured.measure(fault.case(), fault.numbered(), fault.frame.mechanism)
    assert max(found.rms_mm) < 1e-9
    assert {"G4", "G5"} <= found.red
    assert ("H20", "rings-swapped") in measured.verdict(fault.case(), fault.numbered())


@pytest.mark.parametrize("ring", ["proximal", "distal"])
def test_a_ring_upside_down_is_refused_by_its_axis(measured, ring):
    frame = measured.PLAIN
    rings, poses = frame.markers(), {"distal": frame.distal_pose}
    poses["proximal"] = frame.distal_pose @ frame.mechanism
    poses[ring] = poses[ring] @ turned(180.0)
    balls = np.vstack([poses[name].apply(measured.points_of(rings[name])) for name in rings])
    assert ("H21", "ring-axis") in measured.verdict(frame.document(), balls)


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("ring", ["proximal", "distal"])
def test_one_wrong_sign_of_a_height_is_refused_by_the_layout(measured, ring, place):
    document = measured.PLAIN.document()
    document["markers"][ring][place]["height_mm"] *= -1.0
    found = codes(measured.verdict(document, measured.PLAIN.balls_mm()))
    assert found & {"ring-not-found", "mirrored-balls"}
    assert found <= {"ring-not-found", "mirrored-balls"}


@pytest.mark.parametrize("ring", ["proximal", "distal"])
def test_all_wrong_signs_of_one_ring_are_refused_by_the_struts(measured, ring):
    document = measured.PLAIN.document()
    for marker in document["markers"][ring]:
        marker["height_mm"] *= -1.0
    assert ("H24", "strut-reading") in measured.verdict(document, measured.PLAIN.balls_mm())


@pytest.mark.parametrize("by", [-1.0, 1.0])
@pytest.mark.parametrize("ring", ["proximal", "distal"])
def test_a_radius_wrong_by_one_millimetre_is_refused(measured, ring, by):
    document = measured.PLAIN.document()
    for marker in document["markers"][ring]:
        marker["radius_mm"] += by
    assert codes(measured.verdict(document, measured.PLAIN.balls_mm())) == {"ring-not-found"}


@settings(max_examples=60, deadline=None)
@given(
    first=st.floats(45.0, 200.0),
    second=st.floats(45.0, 200.0),
    radius=st.floats(50.0, 140.0),
    by=st.sampled_from([-1.0, 1.0]),
)
def test_three_balls_of_any_allowed_layout_show_a_radius_wrong_by_one(first, second, radius, by):
    if 360.0 - first - second < 45.0:
        second = 315.0 - first if first <= 270.0 else 45.0
    sweeps = np.radians([0.0, first, first + second])
    ring = np.stack([np.cos(sweeps), np.sin(sweeps), 0.0 * sweeps], axis=-1)
    assert rigid_rms_mm(points_mm=ring * (radius + by), layout_mm=ring * radius) > 0.5


@pytest.mark.parametrize("by", ["the next ring size", "joints turned by 5 deg"])
def test_another_ring_model_is_refused_by_the_struts(measured, by):
    document = measured.PLAIN.document()
    fixator = dict(measured.read(document).document["fixator"])
    change = turned(5.0, "z").rotation if "turned" in by else np.diag([1.125, 1.125, 1.0])
    joints = np.array(fixator["proximal"]["joints_mm"]) @ change.T
    fixator["proximal"] = {**fixator["proximal"], "joints_mm": joints.tolist()}
    document["fixator"] = {**fixator, "id": "another"}
    assert hazards(measured.verdict(document, measured.PLAIN.balls_mm())) & {"H24", "H25"}


@pytest.mark.parametrize(
    "order",
    [(0, 1, 2, 5, 4, 3), (0, 1, 3, 2, 4, 5), (5, 4, 3, 2, 1, 0), (1, 2, 3, 4, 5, 0)],
    ids=["struts 4 and 6", "struts 3 and 4", "reversed", "turned"],
)
def test_readings_in_another_order_are_refused_and_the_order_told(measured, order):
    frame = measured.PLAIN
    document = frame.document()
    given = np.array(document["strut_readings_mm"])[list(order)]
    witness = compare_struts(frame.mechanism, measured.read(document).fixator, lengths_mm=given)
    back = ", ".join(str(k + 1) for k in np.argsort(order))
    assert witness.better_order == f"the readings would fit in the order {back}"
    document["strut_readings_mm"] = given.tolist()
    assert ("H25", "strut-order") in measured.verdict(document, frame.balls_mm())


def test_readings_that_differ_by_little_are_refused_when_exchanged(measured):
    fixator = measured.read(measured.PLAIN.document()).fixator
    pose, apart = _struts_3_and_4_apart(measured, fixator, 1.6)
    assert apart == pytest.approx(1.6, abs=0.05)
    given = strut_lengths(pose, fixator)[[0, 1, 3, 2, 4, 5]]
    witness = compare_struts(pose, fixator, lengths_mm=given)
    assert witness.better_order == "the readings would fit in the order 1, 2, 4, 3, 5, 6"
    gate = gates.struts_agree(witness.differences_mm, better_order=witness.better_order)
    assert gate.code == "strut-order"
    assert not gate.passed
    # the same differences without a better order are told and pass
    assert gates.struts_agree(witness.differences_mm).passed


def _struts_3_and_4_apart(measured, fixator, wanted_mm):
    """A pose near the frame's whose struts 3 and 4 differ by so much, and by how much."""
    poses = [measured.PLAIN.mechanism @ turned(angle, "z") for angle in np.linspace(-4, 4, 400)]
    apart = [float(np.subtract(*strut_lengths(pose, fixator)[[3, 2]])) for pose in poses]
    nearest = int(np.argmin(np.abs(np.abs(apart) - wanted_mm)))
    return poses[nearest], abs(apart[nearest])


def test_readings_that_turn_the_ring_are_refused_though_every_strut_passes(measured):
    document = measured.PLAIN.document()
    document["strut_readings_mm"] = [q + 1.9 for q in document["strut_readings_mm"]]
    assert set(measured.verdict(document, measured.PLAIN.balls_mm())) == {
        ("H33", "recognition-error")
    }


def test_a_frame_adjusted_after_the_scan_is_refused(measured):
    frame = measured.PLAIN
    document = frame.document()
    later = frame.mechanism @ turned(1.5, "y", (0.0, 0.0, 3.0))
    lengths = strut_lengths(later, measured.read(document).fixator)
    document["strut_readings_mm"] = lengths.tolist()
    assert ("H24", "strut-reading") in measured.verdict(document, frame.balls_mm())


@pytest.mark.parametrize(
    ("bone", "body_part", "refused"),
    [
        ("tibia", "UPPER ARM", True),
        ("tibia", "Forearm", True),
        ("humerus", "TIBIA/FIBULA", True),
        ("tibia", "LOWER LEG", False),
        ("humerus", "ARM", False),
        ("tibia", "ABDOMEN", False),
        ("tibia", None, False),
        ("pelvis", "ARM", False),
    ],
)
def test_an_arm_in_the_images_header_is_refused_for_a_leg(measured, bone, body_part, refused):
    frame = measured.Frame(bone=bone)
    source = ImageSource(body_part=body_part)
    found = measured.verdict(frame.document(), frame.balls_mm(), source=source)
    assert found == ([("H37", "wrong-limb")] if refused else [])
