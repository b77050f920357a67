"""The catalogue is large, numbered, buildable and covers every axis and every refusal asked for."""

import numpy as np
import pytest
from hexafix.errors import InputError
from hexafix.phantom.make import check_buildable
from hexafix.phantom.scene import build_scene
from hexafix.phantom.truth import in_image
from hexafix.scenarios.axes import AXES, coverage
from hexafix.scenarios.catalogue import CATALOGUE
from hexafix.scenarios.run import chosen


@pytest.fixture(scope="module")
def a_coverage():
    return coverage(CATALOGUE)


def test_there_are_at_least_sixty_scenarios_with_consecutive_numbers_and_own_titles():
    assert len(CATALOGUE) >= 60
    assert [scenario.number for scenario in CATALOGUE] == list(range(1, len(CATALOGUE) + 1))
    assert len({scenario.title for scenario in CATALOGUE}) == len(CATALOGUE)
    assert len({scenario.seed for scenario in CATALOGUE}) == len(CATALOGUE)
    assert [scenario.id for scenario in CATALOGUE[:2]] == ["S01", "S02"]


@pytest.mark.parametrize("axis", AXES)
def test_every_value_of_the_axis_occurs(a_coverage, axis):
    missing = [value for value, having in a_coverage[axis].items() if not having]
    assert not missing


def test_at_least_sixty_scenarios_are_planned_and_thirty_refused():
    refused = [scenario for scenario in CATALOGUE if scenario.refusal]
    assert len(refused) >= 30
    assert len(CATALOGUE) - len(refused) >= 60


@pytest.mark.parametrize(
    ("code", "hazard"),
    [
        ("mirrored-balls", "H01"),
        ("rings-swapped", "H20"),
        ("ring-axis", "H21"),
        ("missing-slice", "H03"),
        ("uneven-spacing", "H03"),
        ("gantry-tilt", "H02"),
        ("no-geometry", "H07"),
        ("mixed-frame-of-reference", "H05"),
        ("several-series", "H05"),
        ("ring-not-found", "H12"),
        ("ring-not-found", "H13"),
        ("ring-not-found", "H15"),
        ("ball-diameter", "H23"),
        ("strut-reading", "H24"),
        ("strut-order", "H25"),
        ("strut-reading-out-of-range", "H26"),
        ("strut-out-of-range", "H27"),
        ("angle-rule-relaxed", "H17"),
        ("numbering-ambiguous", "H18"),
        ("numbering-not-settled", "H18"),
        ("numbering-does-not-fit", "H19"),
        ("wrong-side", "H37"),
    ],
)
def test_the_refusal_is_due_in_a_scenario(code, hazard):
    due = {pair for s in CATALOGUE if s.refusal for pair in s.refusal.faults.items()}
    assert (code, hazard) in due


def test_every_frame_can_be_built_and_only_the_cut_ones_leave_the_volume():
    outside = set()
    for scenario in CATALOGUE:
        spec = scenario.spec()
        scene = build_scene(spec)
        check_buildable(spec, scene)
        radius = spec.ball_diameter_mm / 2.0
        if not all(in_image(center, radius, scene) for center in scene.balls_mm.values()):
            outside.add(scenario.id)
        assert np.prod(spec.size_ijk) < 60e6, "a scenario takes seconds, not minutes"
    assert outside == {"S92", "S93"}


def test_scenarios_are_chosen_by_id_and_an_unknown_one_is_refused_by_name():
    assert [s.id for s in chosen(["S12", "S07"])] == ["S07", "S12"]
    assert chosen() == CATALOGUE
    with pytest.raises(InputError, match="S999") as error:
        chosen(["S01", "S999"])
    assert error.value.faults[0].code == "scenario-unknown"
