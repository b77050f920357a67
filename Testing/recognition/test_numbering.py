import dataclasses

import numpy as np
import pytest
from hexafix.benchmark.recognition import random_layout, random_pose
from hexafix.errors import (
    ImageRefused,
    InputError,
    MarkersNotFound,
    NumberingAmbiguous,
    Refused,
)
from hexafix.geometry import Pose
from hexafix.hardware import MarkerLayout
from hexafix.recognition import number_balls, numbering
from hexafix.recognition.choices import OTHER_BALLS_LIMIT_MM, UNIQUENESS_LIMIT_MM
from hypothesis import given, settings
from hypothesis import strategies as st


def layout_at(sweep_deg, first_number=1, height_mm=20.0, radius_mm=100.0) -> MarkerLayout:
    count = len(sweep_deg)
    return MarkerLayout.of(
        radius_mm=np.broadcast_to(radius_mm, count),
        sweep_deg=sweep_deg,
        height_mm=np.broadcast_to(height_mm, count),
        first_number=first_number,
    )


@pytest.fixture
def even_rings():
    return layout_at([0, 120, 240]), layout_at([0, 120, 240], first_number=4, height_mm=-30.0)


def strut_judge(pose_a, pose_b, joints_deg):
    """RMS over six struts between the poses judged and the truth, as the pipeline's judge."""
    angles = np.radians(joints_deg)
    a = 80 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    b = np.roll(a, 1, axis=0)
    true = np.linalg.norm(pose_a.apply(a) - pose_b.apply(b), axis=1)

    def judge(proximal, distal):
        lengths = np.linalg.norm(proximal.pose.apply(a) - distal.pose.apply(b), axis=1)
        return float(np.sqrt(np.mean((lengths - true) ** 2)))

    return judge


@pytest.mark.parametrize("extra", [0, 4])
@pytest.mark.parametrize("seed", range(5))
def test_every_ball_gets_its_number(
    image_of_rings, a_proximal_layout, a_distal_layout, seed, extra
):
    points, where, *_ = image_of_rings(a_proximal_layout, a_distal_layout, seed=seed, extra=extra)
    found = number_balls(points, proximal=a_proximal_layout, distal=a_distal_layout)
    assert found.proximal.balls == tuple(where[:3])
    assert found.distal.balls == tuple(where[3:6])
    assert found.ball_of_number == dict(zip(range(1, 7), map(int, where[:6]), strict=True))
    assert found.unused == tuple(sorted(map(int, where[6:])))
    assert found.settled_by == "layout"
    assert found.rms_mm < 0.3
    assert found.margin_mm > (1.0 if extra else 7.0)
    assert found.next_best_is_bound == (extra > 0 and found.next_best_mm >= UNIQUENESS_LIMIT_MM)
    assert found.margin_ratio > 10.0


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_numbers_are_right_or_refused_and_never_wrong(seed):
    rng = np.random.default_rng(seed)
    proximal, distal = random_layout(rng), random_layout(rng)
    distal = MarkerLayout.of(
        radius_mm=[s.radius_mm for s in distal.sites],
        sweep_deg=[np.degrees(s.sweep_rad) for s in distal.sites],
        height_mm=[s.height_mm for s in distal.sites],
        first_number=20,
    )
    balls = np.vstack([random_pose(rng).apply(r.points_mm) for r in (proximal, distal)])
    decoys = balls[0] + rng.uniform(-200, 200, (rng.integers(0, 8), 3))
    points = np.vstack([balls, decoys]) + 0.05 * rng.normal(size=(len(balls) + len(decoys), 3))
    order = rng.permutation(len(points))
    try:
        found = number_balls(points[order], proximal=proximal, distal=distal)
    except NumberingAmbiguous:
        return
    truth = np.argsort(order)[: len(balls)]
    assert (*found.proximal.balls, *found.distal.balls) == tuple(truth)


def test_an_even_ring_is_refused_naming_the_turned_numbers(image_of_rings, a_distal_layout):
    even = layout_at([0, 120, 240])
    points, *_ = image_of_rings(even, a_distal_layout, seed=1)
    with pytest.raises(NumberingAmbiguous) as caught:
        number_balls(points, proximal=even, distal=a_distal_layout)
    fault = caught.value.faults[0]
    assert fault.hazard == "H18"
    assert "proximal numbers 1,2,3 turned to 2,3,1" in fault.what
    assert "proximal numbers 1,2,3 turned to 3,1,2" in fault.what
    assert "turned over to" in fault.what
    assert "distal" not in fault.what


def test_rings_of_one_shape_are_refused_naming_the_exchange(image_of_rings, a_proximal_layout):
    # Turned by 15° and on the other side of the plate, but the same triangle.
    distal = layout_at([15, 120, 240], first_number=4, height_mm=-30.0)
    points, *_ = image_of_rings(a_proximal_layout, distal, seed=2)
    with pytest.raises(NumberingAmbiguous) as caught:
        number_balls(points, proximal=a_proximal_layout, distal=distal)
    assert caught.value.faults[0].hazard == "H20"
    assert "rings exchanged: 1,2,3,4,5,6 become 4,5,6,1,2,3" in caught.value.faults[0].what


def test_a_layout_separated_by_less_than_the_limit_is_refused(image_of_rings, a_distal_layout):
    # 105/130/125: two numbers exchanged turn the ring over and miss by 2.7 mm only.
    near = layout_at([0, 105, 235])
    points, *_ = image_of_rings(near, a_distal_layout, seed=3)
    with pytest.raises(NumberingAmbiguous, match="turned over") as caught:
        number_balls(points, proximal=near, distal=a_distal_layout)
    assert 0.5 < float(caught.value.faults[0].value.split()[2]) < UNIQUENESS_LIMIT_MM


def test_a_margin_below_ten_times_the_noise_is_refused(
    image_of_rings, a_proximal_layout, a_distal_layout
):
    points, *_ = image_of_rings(a_proximal_layout, a_distal_layout, seed=4)
    number_balls(points, proximal=a_proximal_layout, distal=a_distal_layout, noise_mm=0.1)
    with pytest.raises(NumberingAmbiguous):
        number_balls(points, proximal=a_proximal_layout, distal=a_distal_layout, noise_mm=1.0)


def test_a_decoy_that_nearly_replaces_a_ball_is_refused(
    image_of_rings, a_proximal_layout, a_distal_layout
):
    points, where, *_ = image_of_rings(a_proximal_layout, a_distal_layout, seed=5)
    near = points[where[2]] + [0.6, 0.3, -0.4]
    with pytest.raises(NumberingAmbiguous, match="number 3 on an unused ball"):
        number_balls(np.vstack([points, near]), proximal=a_proximal_layout, distal=a_distal_layout)
    far = points[where[2]] + [4.0, 3.0, -2.0]
    found = number_balls(
        np.vstack([points, far]), proximal=a_proximal_layout, distal=a_distal_layout
    )
    assert found.unused == (6,)
    assert found.next_best_mm > 1.0


def test_strut_readings_settle_an_even_layout_and_say_so(image_of_rings, a_distal_layout):
    even = layout_at([0, 120, 240])
    points, where, pose_a, pose_b = image_of_rings(even, a_distal_layout, seed=6)
    judge = strut_judge(pose_a, pose_b, [20, 100, 140, 220, 260, 340])
    found = number_balls(points, proximal=even, distal=a_distal_layout, judge=judge)
    assert found.settled_by == "strut-readings"
    assert found.proximal.balls == tuple(where[:3])
    assert found.distal.balls == tuple(where[3:6])
    assert found.margin_mm < 1.0
    assert any("turned to 2,3,1" in a.words for a in found.alternatives)


def test_struts_alike_after_a_turn_of_both_rings_settle_nothing(image_of_rings, even_rings):
    # Joints that repeat every 120° and a straight mechanism: turning both rings changes no strut.
    proximal, distal = even_rings
    _, _, _, pose_b = image_of_rings(proximal, distal, seed=6)
    pose_a = pose_b @ Pose.from_xyz_fixed(position_mm=[0, 0, 185], angles_rad=[0, 0, 0])
    points = np.vstack([pose_a.apply(proximal.points_mm), pose_b.apply(distal.points_mm)])
    judge = strut_judge(pose_a, pose_b, [20, 100, 140, 220, 260, 340])
    with pytest.raises(NumberingAmbiguous, match="do not settle"):
        number_balls(points, proximal=proximal, distal=distal, judge=judge)


@pytest.mark.parametrize("answer", [0.1, 1.9, 3.0, 9.0, float("nan")])
def test_readings_that_agree_with_all_or_none_settle_nothing(image_of_rings, even_rings, answer):
    proximal, distal = even_rings
    points, *_ = image_of_rings(proximal, distal, seed=7)
    with pytest.raises(NumberingAmbiguous) as caught:
        number_balls(points, proximal=proximal, distal=distal, judge=lambda a, b: answer)
    assert caught.value.faults[0].code == "numbering-not-settled"


def test_a_second_choice_not_clearly_out_settles_nothing(image_of_rings, even_rings):
    proximal, distal = even_rings
    points, *_ = image_of_rings(proximal, distal, seed=8)
    answers = iter([0.3, 4.0] + [30.0] * 100)
    with pytest.raises(NumberingAmbiguous, match="do not settle"):
        number_balls(points, proximal=proximal, distal=distal, judge=lambda a, b: next(answers))


def test_the_judge_is_not_asked_when_the_layouts_suffice(
    image_of_rings, a_proximal_layout, a_distal_layout
):
    def never(a, b):
        raise AssertionError("asked")

    points, *_ = image_of_rings(a_proximal_layout, a_distal_layout, seed=9)
    found = number_balls(points, proximal=a_proximal_layout, distal=a_distal_layout, judge=never)
    assert found.settled_by == "layout"


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mirrored_image_is_refused_where_a_ball_is_out_of_plane(
    image_of_rings, an_unequal_layout, a_distal_layout, axis
):
    distal = layout_at([15, 105, 230], first_number=5, height_mm=-30.0)
    points, *_ = image_of_rings(an_unequal_layout, distal, seed=10)
    points[:, axis] *= -1
    with pytest.raises(ImageRefused) as caught:
        number_balls(points, proximal=an_unequal_layout, distal=distal)
    assert caught.value.faults[0].hazard == "H01"


@pytest.mark.parametrize(
    ("lost", "words"),
    [(0, "proximal 2 of 3; distal 3 of 3"), (4, "proximal 3 of 3; distal 2 of 3")],
)
def test_a_missing_ball_names_found_and_needed_per_ring(
    image_of_rings, a_proximal_layout, a_distal_layout, lost, words
):
    points, where, *_ = image_of_rings(a_proximal_layout, a_distal_layout, seed=11)
    with pytest.raises(MarkersNotFound) as caught:
        number_balls(
            np.delete(points, where[lost], axis=0),
            proximal=a_proximal_layout,
            distal=a_distal_layout,
        )
    assert words in caught.value.faults[0].what
    assert caught.value.faults[0].hazard == "H13"


def test_chance_fits_among_many_balls_do_not_refuse_and_end_soon(
    image_of_rings, a_proximal_layout, a_distal_layout
):
    rings = {"proximal": a_proximal_layout, "distal": a_distal_layout}
    decided = 0
    for seed in range(4):
        points, where, *_ = image_of_rings(*rings.values(), seed=seed, extra=34)
        try:
            found = number_balls(points, **rings)
        except NumberingAmbiguous as refusal:
            assert "unused ball" in str(refusal)  # noqa: PT017
            continue
        decided += 1
        assert (*found.proximal.balls, *found.distal.balls) == tuple(where[:6])
        assert found.next_best_mm >= OTHER_BALLS_LIMIT_MM or not found.next_best_is_bound
    assert decided > 0


def test_an_even_ring_stays_ambiguous_among_many_balls(image_of_rings, a_distal_layout):
    near = layout_at([0, 105, 235])
    points, *_ = image_of_rings(near, a_distal_layout, seed=1, extra=34)
    with pytest.raises(NumberingAmbiguous, match="proximal numbers 1,2,3 turned over to 2,1,3"):
        number_balls(points, proximal=near, distal=a_distal_layout)


def test_no_ball_at_all_is_the_wrong_body_part(a_proximal_layout, a_distal_layout):
    with pytest.raises(MarkersNotFound) as caught:
        number_balls(np.zeros((0, 3)), proximal=a_proximal_layout, distal=a_distal_layout)
    assert caught.value.faults[0].hazard == "H12"


def test_a_pixel_spacing_wrong_by_one_percent_is_refused(
    image_of_rings, a_proximal_layout, a_distal_layout
):
    points, *_ = image_of_rings(a_proximal_layout, a_distal_layout, seed=12)
    with pytest.raises(Refused) as caught:
        number_balls(points * [1.01, 1.01, 1.0], proximal=a_proximal_layout, distal=a_distal_layout)
    assert caught.value.faults[0].code == "ring-not-found"


def test_a_number_used_twice_is_an_input_error(a_proximal_layout):
    with pytest.raises(InputError, match="used twice"):
        number_balls(np.zeros((6, 3)), proximal=a_proximal_layout, distal=a_proximal_layout)


def test_rings_are_told_apart_with_the_limb_upside_down(
    image_of_rings, a_proximal_layout, a_distal_layout
):
    points, where, *_ = image_of_rings(a_proximal_layout, a_distal_layout, seed=13)
    flipped = points * [1, -1, -1]
    found = number_balls(flipped, proximal=a_proximal_layout, distal=a_distal_layout)
    assert found.proximal.balls == tuple(where[:3])
    assert found.distal.balls == tuple(where[3:6])


def test_twelve_markers_a_ring_among_thirty_balls_are_numbered(image_of_rings):
    rng = np.random.default_rng(14)
    rings = [
        MarkerLayout.of(
            radius_mm=rng.uniform(80, 110, 12),
            sweep_deg=np.arange(12) * 30 + rng.uniform(-8, 8, 12),
            height_mm=rng.uniform(0, 40, 12),
            first_number=first,
        )
        for first in (1, 13)
    ]
    points, where, *_ = image_of_rings(rings[0], rings[1], seed=14, extra=6)
    found = number_balls(points, proximal=rings[0], distal=rings[1])
    assert (*found.proximal.balls, *found.distal.balls) == tuple(where[:24])


def test_twenty_four_even_markers_a_ring_are_refused_and_not_searched_for_ever(image_of_rings):
    rings = [layout_at(np.arange(24) * 15, first_number=f) for f in (1, 25)]
    points, *_ = image_of_rings(rings[0], rings[1], seed=15, extra=10)
    with pytest.raises(NumberingAmbiguous):
        number_balls(points, proximal=rings[0], distal=rings[1])


def test_a_near_decoy_is_refused_even_when_the_noise_is_said_to_be_small(
    image_of_rings, a_proximal_layout, a_distal_layout
):
    points, where, *_ = image_of_rings(a_proximal_layout, a_distal_layout, seed=5, noise_mm=0.0)
    near = np.vstack([points, points[where[2]] + [0.6, 0.3, -0.4]])
    rings = {"proximal": a_proximal_layout, "distal": a_distal_layout}
    with pytest.raises(NumberingAmbiguous):
        number_balls(near, **rings, noise_mm=0.01)


def test_struts_never_settle_on_numbers_that_miss_the_layout(image_of_rings, a_distal_layout):
    near = layout_at([0, 105, 235])
    points, *_ = image_of_rings(near, a_distal_layout, seed=3)
    answers = iter([30.0, 0.1])
    with pytest.raises(NumberingAmbiguous, match="do not settle"):
        number_balls(
            points, proximal=near, distal=a_distal_layout, judge=lambda a, b: next(answers)
        )


def test_a_search_cut_short_is_refused_and_never_judged(
    image_of_rings, a_proximal_layout, a_distal_layout, monkeypatch
):
    full = numbering.search
    monkeypatch.setattr(
        numbering, "search", lambda *a, **k: dataclasses.replace(full(*a, **k), complete=False)
    )
    points, *_ = image_of_rings(a_proximal_layout, a_distal_layout, seed=9)
    rings = {"proximal": a_proximal_layout, "distal": a_distal_layout}
    for judge in (None, lambda a, b: 0.0):
        with pytest.raises(NumberingAmbiguous) as caught:
            number_balls(points, **rings, judge=judge)
        assert caught.value.faults[0].code == "numbering-too-symmetric"
