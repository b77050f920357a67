import numpy as np
import pytest
from hexafix.benchmark.recognition import exactness, random_layout, random_pose
from hexafix.errors import LayoutRejected
from hexafix.geometry import Pose, skew
from hexafix.hardware import MarkerLayout
from hexafix.recognition import ring_pose, ring_pose_by_groups, ring_poses
from hexafix.recognition.group_pose import group_jacobians
from hexafix.recognition.groups import (
    group_poses,
    marker_groups,
    mean_rotation,
    paper_group_pose,
    ring_poses_by_groups,
)
from hypothesis import given, settings
from hypothesis import strategies as st

# Where the printed formulas go wrong, with the error they make (notes on the paper).
NAMED = {
    "arcsin takes the wrong branch, 12.7 mm": ((60, 110, 100), (0, 40, 200), (20, 20, 20)),
    "order about the axis turns over": ((100, 60, 100), (0, 40, 80), (20, 20, 20)),
    "unequal heights tilt the axis, 4.6 mm": ((100, 100, 100), (0, 120, 240), (20, 20, 45)),
    "first marker on the y axis, cos phi = 0": ((100, 90, 100), (90, 210, 330), (20, 20, 20)),
    "included angle of 180 degrees": ((100, 100, 80), (0, 180, 250), (20, 20, 20)),
}


def layout_of(t, phi, h) -> MarkerLayout:
    return MarkerLayout.of(radius_mm=t, sweep_deg=phi, height_mm=h)


@pytest.mark.parametrize("name", NAMED)
@pytest.mark.parametrize("method", [ring_pose, ring_pose_by_groups])
def test_layouts_that_break_the_printed_formulas_are_exact(name, method, an_oblique_pose):
    layout = layout_of(*NAMED[name])
    found = method(an_oblique_pose.apply(layout.points_mm), layout)
    assert np.max(an_oblique_pose.difference(found.pose)) < 1e-9
    assert found.rms_mm < 1e-9


def test_the_109_mm_layout_is_exact_in_itself_and_refused_as_too_flat(an_oblique_pose):
    layout = layout_of((100, 70, 100), (0, 40, 80), (20, 20, 20))
    points = an_oblique_pose.apply(layout.points_mm)
    rotation, position, _, _ = ring_poses(points[None], layout)
    assert np.max(an_oblique_pose.difference(Pose(rotation[0], position[0]))) < 1e-9
    paper = paper_group_pose(points, layout, (0, 1, 2))
    assert np.max(an_oblique_pose.difference(paper)) < 1e-9
    with pytest.raises(LayoutRejected) as caught:
        ring_pose(points, layout)
    assert caught.value.faults[0].hazard == "H16"


def test_both_methods_are_exact_to_a_nanometre_on_random_layouts():
    result = exactness(layouts=300, seed=1)
    for method in ("least_squares", "groups"):
        assert max(result[method].values()) < 1e-9
    assert result["passed"]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_mended_paper_steps_agree_with_the_triad_at_equal_heights(seed):
    rng = np.random.default_rng(seed)
    random = random_layout(rng)
    layout = layout_of(
        [s.radius_mm for s in random.sites],
        [np.degrees(s.sweep_rad) for s in random.sites],
        [20.0] * len(random),
    )
    try:
        groups = marker_groups(layout)
    except LayoutRejected:
        return
    pose = random_pose(rng)
    points = pose.apply(layout.points_mm) + 0.3 * rng.normal(size=(len(layout), 3))
    rotations, positions = group_poses(points, layout)
    for group, rotation, position in zip(groups, rotations, positions, strict=True):
        paper = paper_group_pose(points, layout, group)
        assert np.abs(paper.rotation - rotation).max() < 1e-9
        assert np.abs(paper.position_mm - position).max() < 1e-7


def test_the_paper_steps_refuse_unequal_heights():
    layout = layout_of((100, 100, 100), (0, 120, 240), (20, 20, 45))
    with pytest.raises(LayoutRejected, match="one height"):
        paper_group_pose(layout.points_mm, layout, (0, 1, 2))


def test_equation_15_holds_with_sin_phi_and_not_as_printed():
    layout = layout_of((60, 110, 100), (25, 140, 250), (20, 20, 20))
    truth = Pose.from_xyz_fixed(position_mm=[1, 2, 3], angles_rad=[0.3, -0.4, 2.0])
    r = paper_group_pose(truth.apply(layout.points_mm), layout, (0, 1, 2)).rotation
    u, w, phi = r[:, 0], r[:, 2], layout.sites[0].sweep_rad
    t = truth.rotation @ [np.cos(phi), np.sin(phi), 0.0]
    mended = (np.eye(3) * np.cos(phi) + np.sin(phi) * skew(w)) @ u - t
    printed = (np.eye(3) * np.cos(phi) + skew(w)) @ u - t
    assert np.abs(mended).max() < 1e-12
    assert np.abs(printed).max() > 0.3


@pytest.mark.parametrize(
    ("count", "expected"),
    [(3, (0, 1, 2)), (6, (0, 2, 4)), (7, (0, 2, 4)), (8, (0, 2, 5)), (10, (0, 3, 6))],
)
def test_groups_follow_section_3_2(count, expected):
    layout = layout_of([100] * count, np.arange(count) * 360 / count, [20] * count)
    groups = marker_groups(layout)
    assert tuple(groups[0]) == expected
    assert len(groups) == count


def test_groups_do_not_depend_on_how_the_markers_are_numbered():
    even = layout_of([100] * 6, [0, 60, 120, 180, 240, 300], [20] * 6)
    shuffled = layout_of([100] * 6, [0, 180, 60, 240, 120, 300], [20] * 6)
    for layout in (even, shuffled):
        triples = {
            frozenset(np.round(np.degrees([layout.sites[k].sweep_rad for k in g])).astype(int))
            for g in marker_groups(layout)
        }
        assert triples == {frozenset((0, 120, 240)), frozenset((60, 180, 300))}


def test_the_mean_of_groups_survives_gamma_at_180_degrees():
    turns = Pose.from_xyz_fixed  # γ = 179.9°, -179.9°, 179.8°
    noisy = [
        turns(position_mm=[0] * 3, angles_rad=np.radians([0, 0, g])).rotation
        for g in (179.9, -179.9, 179.7)
    ]
    mean = Pose(mean_rotation(noisy), np.zeros(3)).angles_rad
    assert np.degrees(mean[2]) == pytest.approx(179.9, abs=1e-3)


def test_a_collinear_group_is_left_out_and_the_pose_stays_exact(an_oblique_pose):
    # Markers 1, 3, 5 on one line; 2, 4, 6 form a good group.
    layout = layout_of(
        (100, 100, 20, 100, 117.4, 100), (0, 60, 90, 120, 160.3, 290), (20, 20, 20, 20, 20, 20)
    )
    points = np.array(layout.points_mm)
    line = points[0] + 0.5 * (points[4] - points[0])
    layout = layout_of(
        [100, 100, np.hypot(*line[:2]), 100, 117.4, 100],
        [0, 60, np.degrees(np.arctan2(line[1], line[0])), 120, 160.3, 290],
        [20] * 6,
    )
    groups = marker_groups(layout)
    assert 0 < len(groups) < 6
    found = ring_pose_by_groups(an_oblique_pose.apply(layout.points_mm), layout)
    assert np.max(an_oblique_pose.difference(found.pose)) < 1e-9


@pytest.mark.parametrize("method", [ring_pose, ring_pose_by_groups])
def test_markers_nearly_on_one_line_are_refused(method):
    layout = layout_of((100, 20, 100), (0, 10, 180), (20, 20, 20))
    with pytest.raises(LayoutRejected) as caught:
        method(layout.points_mm, layout)
    assert caught.value.faults[0].hazard == "H16"
    with pytest.raises(LayoutRejected) as caught:
        marker_groups(layout)
    assert caught.value.faults[0].hazard == "H16"


def test_group_jacobian_agrees_with_finite_differences(an_unequal_layout):
    jacobians = group_jacobians(an_unequal_layout)
    r, step = an_unequal_layout.points_mm, 1e-5
    for marker in range(len(r)):
        for axis in range(3):
            moved = np.zeros_like(r)
            moved[marker, axis] = step
            plus, minus = (group_poses(r + s * moved, an_unequal_layout) for s in (1, -1))
            for g in range(len(jacobians)):
                slope = [
                    Pose(rotation[g], position[g]).log() / (2 * step)
                    for rotation, position in (plus, minus)
                ]
                expected = jacobians[g, :, marker, axis]
                assert np.abs(slope[0] - slope[1] - expected).max() < 1e-6


def test_covariance_of_the_group_method_agrees_with_monte_carlo(an_unequal_layout, an_oblique_pose):
    rng = np.random.default_rng(3)
    spread = np.diag([0.02, 0.03, 0.09]) + 0.01
    centers = an_oblique_pose.apply(an_unequal_layout.points_mm)
    noise = rng.multivariate_normal(np.zeros(3), spread, (20_000, 4))
    stated = ring_pose_by_groups(
        centers,
        an_unequal_layout,
        covariances_mm2=np.tile(spread, (4, 1, 1)),
        installation_sigma_mm=0.0,
    ).covariance
    rotation, position = ring_poses_by_groups(centers + noise, an_unequal_layout)
    back = an_oblique_pose.rotation.T
    turned = back @ rotation
    theta = np.stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]], axis=-1)
    theta = 0.5 * (theta - np.stack([turned[:, 1, 2], turned[:, 2, 0], turned[:, 0, 1]], axis=-1))
    xi = np.concatenate([(position - an_oblique_pose.position_mm) @ back.T, theta], axis=1)
    scale = np.sqrt(np.outer(np.diag(stated), np.diag(stated)))
    assert np.abs(np.cov(xi.T) / scale - stated / scale).max() < 0.04
