"""Hand-checked signs. LPS: +x the patient's left, +y posterior, +z superior; limb along z."""

import numpy as np
import pytest
from hexafix.correction import Deformity, planned_motion
from hexafix.errors import InputError
from hypothesis import given
from hypothesis import strategies as st

ORIGIN = np.array([80.0, -20.0, -300.0])
DOWN, UP = np.array([0.0, 0.0, -100.0]), np.array([0.0, 0.0, 100.0])
FRONT = np.array([0.0, -30.0, 0.0])


def displaced(side, point_from_origin, **parameters):
    """Where a point of the moving fragment lies now, relative to the origin."""
    parameters = {"moving": "distal", **parameters}
    deformity = Deformity(origin_lps_mm=ORIGIN, **parameters)
    return deformity.displacement(side=side).apply(ORIGIN + point_from_origin) - ORIGIN


TAN10, SIN10, COS10 = np.tan(np.radians(10)), np.sin(np.radians(10)), np.cos(np.radians(10))


@pytest.mark.parametrize(
    ("side", "word", "x"),
    [("left", "varus", -1), ("left", "valgus", 1), ("right", "varus", 1), ("right", "valgus", -1)],
)
def test_varus_of_the_distal_fragment_leans_to_the_midline(side, word, x):
    # a left limb lies at +x, its midline is towards −x: varus sends the foot there
    end = displaced(side, DOWN, ap_angulation_deg=10.0, ap_angulation=word)
    np.testing.assert_allclose(end, [x * 100 * SIN10, 0.0, -100 * COS10], atol=1e-9)


@pytest.mark.parametrize(
    ("side", "word", "x"),
    [("left", "varus", -1), ("left", "valgus", 1), ("right", "varus", 1), ("right", "valgus", -1)],
)
def test_varus_of_the_proximal_fragment_has_the_same_lateral_apex(side, word, x):
    end = displaced(side, UP, moving="proximal", ap_angulation_deg=10.0, ap_angulation=word)
    np.testing.assert_allclose(end, [x * 100 * SIN10, 0.0, 100 * COS10], atol=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(
    ("moving", "away"), [("distal", DOWN), ("proximal", UP)], ids=["distal", "proximal"]
)
def test_an_anterior_apex_sends_the_far_end_backwards(side, moving, away):
    end = displaced(
        side, away, moving=moving, lateral_angulation_deg=10.0, lateral_angulation="apex-anterior"
    )
    np.testing.assert_allclose(end, [0.0, 100 * SIN10, np.sign(away[2]) * 100 * COS10], atol=1e-9)
    end = displaced(
        side, away, moving=moving, lateral_angulation_deg=10.0, lateral_angulation="apex-posterior"
    )
    assert end[1] == pytest.approx(-100 * SIN10)


@pytest.mark.parametrize("moving", ["distal", "proximal"])
@pytest.mark.parametrize(
    ("side", "word", "x"),
    [
        ("left", "internal", -1),
        ("left", "external", 1),
        ("right", "internal", 1),
        ("right", "external", -1),
    ],
)
def test_internal_rotation_turns_the_front_to_the_midline(moving, side, word, x):
    toes = displaced(side, FRONT, moving=moving, axial_rotation_deg=10.0, axial_rotation=word)
    np.testing.assert_allclose(toes, [x * 30 * SIN10, -30 * COS10, 0.0], atol=1e-9)


@pytest.mark.parametrize(
    ("side", "moving", "name", "word", "expected"),
    [
        ("left", "distal", "ap", "medial", [-7, 0, 0]),
        ("left", "distal", "ap", "lateral", [7, 0, 0]),
        ("right", "distal", "ap", "medial", [7, 0, 0]),
        ("right", "proximal", "ap", "lateral", [-7, 0, 0]),
        ("left", "distal", "lateral", "anterior", [0, -7, 0]),
        ("right", "distal", "lateral", "posterior", [0, 7, 0]),
        ("left", "distal", "axial", "short", [0, 0, 7]),
        ("left", "distal", "axial", "long", [0, 0, -7]),
        ("right", "proximal", "axial", "short", [0, 0, -7]),
        ("right", "proximal", "axial", "long", [0, 0, 7]),
    ],
)
def test_translations_go_where_their_word_says(side, moving, name, word, expected):
    words = {f"{name}_translation_mm": 7.0, f"{name}_translation": word, "moving": moving}
    np.testing.assert_allclose(displaced(side, np.zeros(3), **words), expected, atol=1e-12)
    np.testing.assert_allclose(displaced(side, DOWN, **words) - DOWN, expected, atol=1e-12)


def test_both_views_show_the_angles_that_were_entered():
    end = displaced(
        "left",
        DOWN,
        ap_angulation_deg=20.0,
        ap_angulation="valgus",
        lateral_angulation_deg=35.0,
        lateral_angulation="apex-posterior",
        axial_rotation_deg=15.0,
        axial_rotation="external",
    )
    assert np.degrees(np.arctan2(end[0], -end[2])) == pytest.approx(20.0)
    assert np.degrees(np.arctan2(-end[1], -end[2])) == pytest.approx(35.0)
    assert np.linalg.norm(end) == pytest.approx(100.0)


WHOLE = {
    "ap_angulation_deg": 8.0,
    "ap_angulation": "varus",
    "lateral_angulation_deg": 5.0,
    "lateral_angulation": "apex-anterior",
    "axial_rotation_deg": 12.0,
    "axial_rotation": "internal",
    "ap_translation_mm": 4.0,
    "ap_translation": "medial",
    "lateral_translation_mm": 3.0,
    "lateral_translation": "posterior",
    "axial_translation_mm": 6.0,
    "axial_translation": "short",
}


@pytest.mark.parametrize("moving", ["distal", "proximal"])
def test_the_correction_takes_every_point_back(moving):
    deformity = Deformity(moving=moving, origin_lps_mm=ORIGIN, **WHOLE)
    motion = planned_motion(deformity, side="right")
    assert motion.moving == moving
    rng = np.random.default_rng(0)
    healthy = ORIGIN + rng.uniform(-80, 80, (10, 3))
    now = deformity.displacement(side="right").apply(healthy)
    np.testing.assert_allclose(motion.motion.apply(now), healthy, atol=1e-9)
    corresponding = deformity.corresponding_point_lps_mm(side="right")
    np.testing.assert_allclose(motion.motion.apply(corresponding), ORIGIN, atol=1e-9)


def test_a_right_limb_is_the_mirror_image_of_a_left_one():
    mirror = np.diag([-1.0, 1.0, 1.0])
    left = Deformity(moving="distal", origin_lps_mm=ORIGIN, **WHOLE).displacement(side="left")
    right = Deformity(moving="distal", origin_lps_mm=mirror @ ORIGIN, **WHOLE).displacement(
        side="right"
    )
    np.testing.assert_allclose(right.rotation, mirror @ left.rotation @ mirror, atol=1e-12)
    np.testing.assert_allclose(right.position_mm, mirror @ left.position_mm, atol=1e-9)


@given(st.floats(0.0, 59.0), st.floats(0.0, 59.0))
def test_the_lean_has_no_twist_about_the_axis(ap, lateral):
    deformity = Deformity(
        moving="distal",
        origin_lps_mm=np.zeros(3),
        ap_angulation_deg=ap,
        ap_angulation="varus",
        lateral_angulation_deg=lateral,
        lateral_angulation="apex-anterior",
    )
    rotation = deformity.displacement(side="left").rotation
    # the smallest turn has its axis across the bone
    assert rotation[1, 0] - rotation[0, 1] == pytest.approx(0.0, abs=1e-12)


def test_every_wrong_parameter_is_named_at_once():
    with pytest.raises(InputError) as caught:
        Deformity(
            moving="distal",
            origin_lps_mm=ORIGIN,
            ap_angulation_deg=-5.0,
            ap_angulation="varus",
            axial_rotation_deg=3.0,
            lateral_translation_mm=400.0,
            lateral_translation="anterior",
            axial_translation_mm=float("nan"),
            axial_translation="short",
        )
    assert {fault.where for fault in caught.value.faults} == {
        "correction.ap_angulation_deg",
        "correction.axial_rotation",
        "correction.lateral_translation_mm",
        "correction.axial_translation_mm",
    }


def test_a_word_of_the_other_view_is_refused():
    with pytest.raises(InputError, match="varus or valgus"):
        Deformity(
            moving="distal",
            origin_lps_mm=ORIGIN,
            ap_angulation_deg=5.0,
            ap_angulation="internal",  # pyright: ignore[reportArgumentType]
        )


def test_an_unknown_side_is_refused():
    deformity = Deformity(moving="distal", origin_lps_mm=ORIGIN, **WHOLE)
    with pytest.raises(InputError, match="left or right"):
        deformity.displacement(side="Left")  # pyright: ignore[reportArgumentType]
