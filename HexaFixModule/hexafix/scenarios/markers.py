"""How many balls, of which size, in which layout, and who numbers them."""

from __future__ import annotations

from functools import partial

from hexafix.phantom.spec import INSTALLATION_SIGMA_MM
from hexafix.scenarios import changes, layouts
from hexafix.scenarios.scenario import Scenario

_scenario = partial(Scenario, theme="markers")


def _counts(number: int, proximal: int, distal: int, words: str = "") -> Scenario:
    return _scenario(
        number=number,
        title=f"{proximal} balls on the proximal and {distal} on the distal ring{words}",
        phantom={
            "side": ("left", "right")[number % 2],
            "bone": "tibia",
            **layouts.balls(proximal, distal),
        },
    )


SCENARIOS = (
    _counts(50, 3, 3, ", all in one plane"),
    _counts(51, 3, 4),
    _counts(52, 5, 3),
    _counts(53, 5, 5),
    _counts(54, 6, 4),
    _counts(55, 6, 6, ", below the plate"),
    _counts(56, 7, 7, ", in four heights"),
    _scenario(
        number=57,
        title="balls close to the limb (radius 82 mm)",
        phantom={"side": "left", "bone": "forearm", **layouts.balls(5, 5, radius_mm=82.0)},
    ),
    _scenario(
        number=58,
        title="balls far out (radius 118 mm)",
        phantom={"side": "right", "bone": "femur", **layouts.balls(4, 5, radius_mm=118.0)},
    ),
    _scenario(
        number=59,
        title="small balls of 8 mm on thin rods",
        phantom={
            "side": "left",
            "bone": "tibia",
            "ball_diameter_mm": 8.0,
            "rod_diameter_mm": 3.0,
            "spacing_mm": (0.9, 0.9, 1.1),
        },
    ),
    _scenario(
        number=60,
        title="large balls of 14 mm, placed to 0.15 mm only",
        phantom={
            "side": "right",
            "bone": "tibia",
            "ball_diameter_mm": 14.0,
            "installation_sigma_mm": 0.15,
            **layouts.balls(4, 5),
        },
    ),
    _scenario(
        number=61,
        title="a layout of the relaxed angle rule, accepted",
        phantom={"side": "left", "bone": "tibia", **layouts.relaxed()},
        accept_relaxed_layout=True,
    ),
    _scenario(
        number=62,
        title="even layout of 120°, settled by the strut readings",
        phantom={"side": "right", "bone": "tibia", **layouts.even()},
        told={"numbering_settled_by": "strut-readings"},
    ),
    _scenario(
        number=63,
        title="numbers assigned by hand",
        phantom={"side": "left", "bone": "tibia", **layouts.balls(4, 4)},
        case=(changes.numbered_by_hand(),),
        told={"numbering_settled_by": "user"},
    ),
    _scenario(
        number=64,
        title="exactly placed balls without rods",
        phantom={
            "side": "right",
            "bone": "tibia",
            "rod_diameter_mm": 0.0,
            "installation_sigma_mm": 0.25 * INSTALLATION_SIGMA_MM,
        },
    ),
)
