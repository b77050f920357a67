"""What a user sees: colours looked for at the pixels where known points of the patient project."""

import numpy as np
import pytest
from hexafix.mrml import models
from hexafix.mrml.nodes import find
from hexafix.mrml.views import OffscreenView
from hexafix.report.scene import ANATOMY
from hexafix.surfaces import ring_colour, strut_colour

RINGS = ("proximal", "distal")


@pytest.fixture(scope="module")
def balls(planned):
    return {ball["number"]: ball for ball in planned.document["balls"]}


@pytest.fixture(scope="module")
def middle(planned):
    rings = planned.document["rings"]
    return np.mean([np.array(rings[r]["matrix_lps"])[:3, 3] for r in RINGS], axis=0)


@pytest.fixture(scope="module")
def front(planned, middle):
    """The scene from the patient's front, head up, target and labels off."""
    view = OffscreenView(planned.app, "Front", size=(700, 800))
    view.aim(middle, toward=ANATOMY["front"], up=ANATOMY["head"], height_mm=440.0)
    yield view
    view.close()


@pytest.fixture
def bare(planned):
    """Hides what would stand before balls and struts while a test looks at them."""
    hidden = ("markups", "model/target", "model/bone")
    models.set_shown(planned.app.scene, hidden, False)
    yield
    models.set_shown(planned.app.scene, hidden, True)
    planned.logic.show_rejected(False)


def patch(picture, pixel, half=3):
    column, row = pixel
    return picture[row - half : row + half + 1, column - half : column + half + 1].reshape(-1, 3)


def hue_of(colour):
    """Which of red, green, blue lead: colour without brightness, shading changes that only."""
    colour = np.asarray(colour, float)
    return colour / np.linalg.norm(colour)


def looks(picture, pixel, colour, *, half=3):
    """Whether the middle of a patch has the direction of a colour."""
    seen = np.median(patch(picture, pixel, half), axis=0)
    return float(hue_of(seen + 1e-9) @ hue_of(colour)) > 0.97


def test_the_projection_puts_left_and_head_where_the_surgeon_expects_them(front, middle):
    center = front.pixel_of(middle)
    assert center == pytest.approx((350, 400), abs=1)
    left = front.pixel_of(middle + 50 * np.array(ANATOMY["left"]))
    head = front.pixel_of(middle + 50 * np.array(ANATOMY["head"]))
    assert left[0] > center[0] + 60, "seen from the front the patient's left is at the right"
    assert head[1] < center[1] - 60


def test_every_ball_is_seen_at_its_place_in_its_rings_colour(front, bare, planned, balls):
    models.set_shown(planned.app.scene, ("model/strut", "model/ring"), False)
    picture = front.image()
    models.set_shown(planned.app.scene, ("model/strut", "model/ring"), True)
    for ball in balls.values():
        pixel = front.pixel_of(ball["center_mm"])
        assert looks(picture, pixel, ring_colour(ball["ring"]), half=2), ball["number"]
        # mirrored in x or y, as a forgotten flip would show it, there is no such ball
        wrong = np.array(ball["center_mm"]) * [-1, -1, 1]
        column, row = front.pixel_of(wrong)
        assert not (0 <= column < 700 and 0 <= row < 800) or not looks(
            picture, (column, row), ring_colour(ball["ring"]), half=2
        )


def test_every_strut_is_seen_in_its_colour(front, bare, planned):
    picture, rings, fixator = front.image(), planned.document["rings"], planned.case.fixator
    found = set()
    for number in range(6):
        ends = [
            np.array(rings[r]["matrix_lps"]) @ [*getattr(fixator, r).joints_mm[number], 1]
            for r in RINGS
        ]
        for share in (0.3, 0.4, 0.5, 0.6, 0.7):
            pixel = front.pixel_of((share * ends[0] + (1 - share) * ends[1])[:3])
            if looks(picture, pixel, strut_colour(number + 1), half=1):
                found.add(number + 1)
    assert len(found) >= 5, "a strut behind another one may be hidden"


def test_the_rings_are_seen_in_their_colours_and_the_corner_is_empty(front, bare, planned):
    picture = front.image()
    for ring in RINGS:
        pose = np.array(planned.document["rings"][ring]["matrix_lps"])
        hardware = getattr(planned.case.fixator, ring)
        rim = []
        for angle in np.linspace(0, 2 * np.pi, 48, endpoint=False):
            radius = hardware.outer_radius_mm - 1.0
            point = [radius * np.cos(angle), radius * np.sin(angle), -hardware.thickness_mm / 2, 1]
            pixel = front.pixel_of((pose @ point)[:3])
            rim.append(looks(picture, pixel, ring_colour(ring), half=1))
        assert np.mean(rim) > 0.3, ring
    assert picture[2:20, 2:20].min() > 240


def test_the_numbers_are_seen_beside_their_balls(front, planned, balls):
    """Label on, label off: what differs is a white box in the ring's colour beside the ball."""
    scene = planned.app.scene
    models.set_shown(scene, ("markups/frame",), False)
    with_labels = front.image().astype(int)
    lists = [find(scene, f"markups/{ring}").GetDisplayNode() for ring in RINGS]
    for display in lists:
        display.SetPointLabelsVisibility(False)
    without = front.image().astype(int)
    for display in lists:
        display.SetPointLabelsVisibility(True)
    models.set_shown(scene, ("markups/frame",), True)
    changed = np.abs(with_labels - without).sum(axis=2) > 60
    for ball in balls.values():
        column, row = front.pixel_of(ball["center_mm"])
        near = (slice(max(0, row - 40), row + 5), slice(column - 5, column + 40))
        assert changed[near].sum() > 80, f"the number {ball['number']} is missing"
        box = with_labels[near][changed[near]]
        assert (box.min(axis=1) > 200).mean() > 0.25, "on a light ground"
        dark = box[box.max(axis=1) < 200]
        assert hue_of(np.median(dark, axis=0)) @ hue_of(ring_colour(ball["ring"])) > 0.9


def test_struts_carry_their_numbers_and_rings_their_fronts(front, planned):
    scene = planned.app.scene
    whole = front.image().astype(int)
    models.set_shown(scene, ("markups/frame",), False)
    bare = front.image().astype(int)
    models.set_shown(scene, ("markups/frame",), True)
    changed = np.abs(whole - bare).sum(axis=2) > 60
    for role in [*(f"strut/{n}" for n in range(1, 7)), *RINGS]:
        node = find(scene, f"markups/frame/{role}")
        world = [0.0] * 3
        node.GetNthControlPointPositionWorld(0, world)
        column, row = front.pixel_of(np.array(world) * [-1, -1, 1])
        near = changed[max(0, row - 40) : row + 10, max(0, column - 60) : column + 60]
        assert near.sum() > 60, role


def test_the_bone_is_light_and_the_target_green(front, planned):
    scene = planned.app.scene
    models.set_shown(scene, ("markups", "model/strut", "model/ring", "model/balls"), False)
    models.set_shown(scene, ("model/target",), False)
    bone = front.image().astype(int)
    models.set_shown(scene, ("model/target",), True)
    both = front.image().astype(int)
    models.set_shown(scene, ("markups", "model/strut", "model/ring", "model/balls"), True)
    planned.logic.show_rejected(False)
    seen = bone[bone.max(axis=2) < 235]
    assert len(seen) > 3000, "the bone is there"
    assert np.median(seen[:, 0] - seen[:, 2]) > 15, "ivory: more red than blue"
    ghost = both[np.abs(both - bone).sum(axis=2) > 30]
    assert len(ghost) > 3000, "the target is there"
    assert np.median(ghost[:, 1] - ghost[:, 0]) > 10, "green"


@pytest.mark.parametrize("orientation", ["Axial", "Sagittal", "Coronal"])
def test_a_slice_shows_the_ball_in_its_outline_with_its_number(planned, balls, orientation):
    view = OffscreenView(planned.app, f"Slice{orientation}", orientation, size=(400, 400))
    ball = balls[2]
    view.show_slice(planned.volume_node, ball["center_mm"])
    view.node.SetFieldOfView(100.0, 100.0, view.node.GetFieldOfView()[2])
    picture = view.image().astype(int)
    column, row = view.pixel_of(ball["center_mm"])
    assert abs(column - 200) < 6
    assert abs(row - 200) < 6
    radius = round(400 * ball["diameter_mm"] / 2 / 100)
    inside = [picture[row + 10, column - 10], picture[row + 10, column + 10]]
    assert np.mean(inside) > 180, "the metal of the ball is white"
    ring = []
    for angle in np.linspace(0, 2 * np.pi, 40, endpoint=False):
        r, c = row + radius * np.sin(angle), column + radius * np.cos(angle)
        around = patch(picture, (round(c), round(r)), 2)
        ring.append(max(hue_of(p + 1e-9) @ hue_of(ring_colour("proximal")) for p in around))
    assert np.mean(np.array(ring) > 0.97) > 0.7, "the outline lies on the edge of the ball"
    background = picture[row - 80 : row - 60, column - 80 : column - 60]
    assert background.max() < 60, "air is dark"
    view.close()


def test_a_slice_elsewhere_shows_no_ball(planned, balls):
    view = OffscreenView(planned.app, "SliceElsewhere", "Axial", size=(300, 300))
    view.show_slice(planned.volume_node, np.array(balls[2]["center_mm"]) + np.array([0, 0, 30.0]))
    picture = view.image().astype(int)
    column, row = view.pixel_of(balls[2]["center_mm"])
    colours = patch(picture, (column, row), 12)
    teal = [
        hue_of(p + 1e-9) @ hue_of(ring_colour("proximal")) > 0.97 and p.max() > 80 for p in colours
    ]
    assert not any(teal)
    view.close()
