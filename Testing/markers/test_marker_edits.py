"""What the user takes out of the balls found, and puts in."""

import numpy as np
import pytest
from hexafix.errors import InputError, MarkersNotFound
from hexafix.markers import BallSet, MarkerEdits, edited_balls, find_balls


@pytest.fixture(scope="module")
def found(a_recognised):
    return a_recognised.balls


@pytest.fixture
def edit(a_phantom, found):
    """`edit(added=…, removed=…)`: the phantom's balls with these edits."""

    def edited(*, added=(), removed=(), balls=found):
        edits = MarkerEdits(added_lps_mm=added, removed_lps_mm=removed)
        return edited_balls(a_phantom.volume, balls, edits, ball_diameter_mm=10.0)

    return edited


def same_places(first, second):
    return np.array_equal(first.centers_mm, second.centers_mm)


def test_without_edits_nothing_changes(edit, found):
    assert edit() is found


def test_a_ball_that_the_user_removes_is_rejected_by_name(edit, found):
    gone = found.balls[3]
    left = edit(removed=[gone.center_mm + np.array([1.5, -1.0, 1.0])])
    assert [b for b in found.balls if b is not gone] == list(left.balls)
    assert left.rejected[0].reason == "removed by the user"
    np.testing.assert_array_equal(left.rejected[0].center_mm, gone.center_mm)
    assert len(left.rejected) == len(found.rejected) + 1


def test_a_ball_removed_and_added_back_2_mm_off_has_its_centre_again(edit, found):
    ball = found.balls[5]
    again = edit(removed=[ball.center_mm], added=[ball.center_mm + np.array([1.2, -1.2, 1.0])])
    np.testing.assert_allclose(again.centers_mm, found.centers_mm, rtol=0, atol=1e-6)
    assert [b.added for b in again.balls] == [b is ball for b in found.balls]
    assert again.balls[5].warnings == ball.warnings
    assert len(again.rejected) == len(found.rejected)


@pytest.mark.parametrize("off_mm", [0.0, 2.0, 4.0])
def test_an_added_ball_is_fitted_as_the_search_fits_it(edit, found, off_mm):
    """The ball was never found here: it is fitted anew from each click."""
    for k, ball in enumerate(found.balls):
        others = BallSet(tuple(b for b in found.balls if b is not ball))
        direction = np.random.default_rng(k).standard_normal(3)
        point = ball.center_mm + off_mm * direction / np.linalg.norm(direction)
        added = edit(added=[point], balls=others)
        assert [b.added for b in added.balls] == [b is ball for b in found.balls]
        np.testing.assert_allclose(added.centers_mm, found.centers_mm, rtol=0, atol=1e-3)
        assert abs(added.balls[k].diameter_mm - ball.diameter_mm) < 1e-3
        np.testing.assert_allclose(added.balls[k].sigma_mm, ball.sigma_mm, rtol=0.05)


def test_a_click_a_ball_away_adds_nothing(edit, found):
    others = BallSet(found.balls[1:])
    point = found.balls[0].center_mm + np.array([0.0, 0.0, 8.0])
    with pytest.raises(MarkersNotFound) as error:
        edit(added=[point], balls=others)
    (fault,) = error.value.faults
    assert (fault.code, fault.hazard) == ("no-ball-to-add", "H15")
    assert fault.where == "marker_edits.added_lps_mm[0]"


@pytest.mark.parametrize("off_mm", [5.5, 7.0])
def test_a_ball_is_not_caught_from_outside_it(workbench, off_mm):
    """Of two clicks near one ball only that in it means the ball."""
    bench = workbench()
    bench.ball((0.0, 0.0, 0.0))
    volume = bench.volume()
    edits = MarkerEdits(added_lps_mm=[bench.lps((off_mm, 0.0, 0.0))])
    with pytest.raises(MarkersNotFound) as error:
        edited_balls(volume, BallSet(()), edits, ball_diameter_mm=10.0)
    assert "the nearest round thing lies" in str(error.value)
    inside = MarkerEdits(added_lps_mm=[bench.lps((4.0, 0.0, 0.0))])
    assert len(edited_balls(volume, BallSet(()), inside, ball_diameter_mm=10.0).balls) == 1


def test_a_marker_dragged_to_where_nothing_is_refuses(edit, found):
    ball = found.balls[2]
    with pytest.raises(MarkersNotFound):
        edit(removed=[ball.center_mm], added=[ball.center_mm + np.array([20.0, 20.0, 0.0])])


def test_nothing_is_removed_where_no_ball_is(edit, found):
    ball = found.balls[2].center_mm
    with pytest.raises(InputError) as error:
        edit(removed=[ball, ball])
    (fault,) = error.value.faults
    assert (fault.code, fault.where) == ("no-ball-to-remove", "marker_edits.removed_lps_mm[1]")
    with pytest.raises(InputError):
        edit(removed=[ball + np.array([3.1, 0.0, 0.0])])


def test_no_ball_is_added_twice(edit, found):
    with pytest.raises(InputError) as error:
        edit(added=[found.balls[2].center_mm])
    assert error.value.faults[0].code == "added-ball-twice"
    others = BallSet(found.balls[1:])
    with pytest.raises(InputError) as error:
        edit(added=[found.balls[0].center_mm, found.balls[0].center_mm + 1.0], balls=others)
    assert error.value.faults[0].where == "marker_edits.added_lps_mm[1]"


def test_no_ball_is_added_outside_the_image(edit, a_phantom):
    corner = a_phantom.volume.corners_mm()[0]
    with pytest.raises(InputError) as error:
        edit(added=[corner])
    assert error.value.faults[0].code == "added-ball-outside"
    with pytest.raises(InputError):
        edit(added=[corner - 5000.0])


def test_a_ball_that_failed_a_test_can_be_added_and_says_so(workbench):
    bench = workbench()
    bench.ball((-10.0, 0.0, 0.0))
    bench.ball((6.0, 0.0, 0.0))
    bench.rod((6.0, 0.0, 0.0), (24.0, 0.0, 0.0), 5.0, 2300.0)
    volume = bench.volume()
    found = find_balls(volume, ball_diameter_mm=10.0)
    assert len(found.balls) == 1
    place = bench.lps((6.0, 0.0, 0.0))
    edits = MarkerEdits(added_lps_mm=[place + 1.0])
    balls = edited_balls(volume, found, edits, ball_diameter_mm=10.0)
    (added,) = [ball for ball in balls.balls if ball.added]
    assert np.linalg.norm(added.center_mm - place) < 0.1
    (warning,) = [text for text in added.warnings if text.startswith("added by the user although")]
    assert "rod: a stem as dense as the ball" in warning
    assert all(np.linalg.norm(r.center_mm - place) > 4.0 for r in balls.rejected)


def test_an_added_ball_of_another_material_is_warned_about(workbench):
    bench = workbench(1, (34.0, 14.0, 14.0))
    for x in (-25.0, -8.0, 8.0):
        bench.ball((x, 0.0, 0.0))
    bench.ball((25.0, 0.0, 0.0), hu=1200.0)
    volume = bench.volume()
    found = find_balls(volume, ball_diameter_mm=10.0)
    place = bench.lps((25.0, 0.0, 0.0))
    balls = edited_balls(volume, found, MarkerEdits(added_lps_mm=[place]), ball_diameter_mm=10.0)
    (added,) = [ball for ball in balls.balls if ball.added]
    assert [w for w in added.warnings if w.startswith("added by the user although: core HU: 1")]


def cut_ball(workbench, at_mm):
    """A ball of which everything beyond a plane is missing: volume and the ball's place."""
    bench = workbench(3)
    bench.ball((0.0, 0.0, 0.0))
    bench.hu[bench.points[..., 0] > at_mm] = -1000.0
    return bench.volume(), bench.lps((0.0, 0.0, 0.0)), bench.lps((-1.0, 0.0, 0.0))


def test_most_of_a_ball_can_be_added_with_its_true_centre_and_what_it_lacks(workbench):
    volume, place, click = cut_ball(workbench, 0.5)
    assert find_balls(volume, ball_diameter_mm=10.0).balls == ()
    edits = MarkerEdits(added_lps_mm=[click])
    (ball,) = edited_balls(volume, BallSet(()), edits, ball_diameter_mm=10.0).balls
    assert np.linalg.norm(ball.center_mm - place) < 0.03
    assert any("although: edges: 5" in warning for warning in ball.warnings)


def test_the_cap_of_a_ball_is_nothing_to_add(workbench):
    volume, _, click = cut_ball(workbench, -2.0)
    edits = MarkerEdits(added_lps_mm=[click])
    with pytest.raises(MarkersNotFound):
        edited_balls(volume, BallSet(()), edits, ball_diameter_mm=10.0)


@pytest.mark.parametrize("points", [[[1.0, 2.0, np.nan]], [[1.0, 2.0, np.inf]]])
def test_an_edit_is_three_finite_numbers(points):
    with pytest.raises(InputError):
        MarkerEdits(added_lps_mm=points)
