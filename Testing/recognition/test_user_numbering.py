import numpy as np
import pytest
from hexafix.errors import ImageRefused, InputError, Refused
from hexafix.hardware import MarkerLayout
from hexafix.recognition import RING_RMS_LIMIT_MM, check_user_numbering


@pytest.fixture
def a_picked_case(image_of_rings, a_proximal_layout, a_distal_layout):
    points, where, *_ = image_of_rings(a_proximal_layout, a_distal_layout, seed=21, extra=2)
    rings = {"proximal": a_proximal_layout, "distal": a_distal_layout}
    assigned = {k + 1: (points[where[k]] + [1.0, -1.0, 0.5]).tolist() for k in range(6)}
    return assigned, points, where, rings


def test_the_assigned_points_find_their_balls(a_picked_case):
    assigned, points, where, rings = a_picked_case
    found = check_user_numbering(assigned, points, **rings)
    assert found.ball_of_number == dict(zip(range(1, 7), map(int, where[:6]), strict=True))
    assert found.settled_by == "user"
    assert found.rms_mm < 0.3
    assert found.next_best_mm >= 5.0


def test_every_fault_of_an_assignment_is_named_at_once(a_picked_case):
    assigned, points, where, rings = a_picked_case
    del assigned[1]
    assigned[2] = (points[where[1]] + [8.0, 0.0, 0.0]).tolist()
    assigned[4] = assigned[3]
    assigned[9] = assigned[5]
    assigned[6] = [1.0, float("nan"), 2.0]
    with pytest.raises(InputError) as caught:
        check_user_numbering(assigned, points, **rings)
    assert {(f.where, f.code) for f in caught.value.faults} == {
        ("numbering.1", "number-missing"),
        ("numbering.2", "number-no-ball"),
        ("numbering.4", "ball-twice"),
        ("numbering.6", "number-not-a-point"),
        ("numbering.9", "number-unknown"),
    }


def test_exchanged_numbers_are_refused_naming_the_better_ones(a_picked_case):
    assigned, points, _, rings = a_picked_case
    assigned[1], assigned[2] = assigned[2], assigned[1]
    with pytest.raises(Refused) as caught:
        check_user_numbering(assigned, points, **rings)
    fault = caught.value.faults[0]
    assert (fault.code, fault.hazard) == ("numbering-does-not-fit", "H19")
    assert "proximal" in fault.message
    assert "1,2" in fault.message or "2,1" in fault.message


def test_exchanged_rings_are_refused(a_picked_case):
    assigned, points, _, rings = a_picked_case
    swapped = {k: assigned[(k + 2) % 6 + 1] for k in assigned}
    with pytest.raises(Refused, match="rings exchanged"):
        check_user_numbering(swapped, points, **rings)


def test_a_numbering_within_the_limit_that_another_beats_clearly_is_refused(
    image_of_rings, a_distal_layout
):
    near = MarkerLayout.of(radius_mm=[100] * 3, sweep_deg=[0, 120, 239.7], height_mm=[20] * 3)
    # Turned numbers miss this nearly even ring by less than the limit of G2, but clearly.
    points, where, *_ = image_of_rings(near, a_distal_layout, seed=22, noise_mm=0.0)
    assigned = {k + 1: points[where[[1, 2, 0, 3, 4, 5][k]]].tolist() for k in range(6)}
    with pytest.raises(Refused, match="clearly better") as caught:
        check_user_numbering(assigned, points, proximal=near, distal=a_distal_layout, noise_mm=0.02)
    assert 0.1 < float(caught.value.faults[0].value.split()[1]) < RING_RMS_LIMIT_MM


def test_a_symmetric_numbering_of_the_user_stands_with_its_alternatives(
    image_of_rings, a_distal_layout
):
    even = MarkerLayout.of(radius_mm=[100] * 3, sweep_deg=[0, 120, 240], height_mm=[20] * 3)
    points, where, *_ = image_of_rings(even, a_distal_layout, seed=23)
    assigned = {k + 1: points[where[[1, 2, 0, 3, 4, 5][k]]] for k in range(6)}
    found = check_user_numbering(assigned, points, proximal=even, distal=a_distal_layout)
    assert found.proximal.balls == tuple(where[[1, 2, 0]])
    assert any("turned to" in a.words and a.rms_mm < 0.3 for a in found.alternatives)
    assert found.margin_mm < 0.3


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mirrored_image_is_refused_under_the_users_numbers(
    image_of_rings, an_unequal_layout, axis
):
    distal = MarkerLayout.of(
        radius_mm=[100] * 3, sweep_deg=[15, 105, 230], height_mm=[-30] * 3, first_number=5
    )
    points, where, *_ = image_of_rings(an_unequal_layout, distal, seed=24)
    points[:, axis] *= -1
    assigned = {k + 1: points[where[k]] for k in range(7)}
    with pytest.raises(ImageRefused) as caught:
        check_user_numbering(assigned, points, proximal=an_unequal_layout, distal=distal)
    assert caught.value.faults[0].hazard == "H01"


def test_the_right_numbers_on_a_distorted_image_are_refused(a_picked_case):
    assigned, points, _, rings = a_picked_case
    scale = np.array([1.01, 1.01, 1.0])
    stretched = {number: np.array(place) * scale for number, place in assigned.items()}
    with pytest.raises(Refused) as caught:
        check_user_numbering(stretched, points * scale, **rings)
    assert caught.value.faults[0].code == "numbering-does-not-fit"
