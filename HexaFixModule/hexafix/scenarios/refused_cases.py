"""Cases that contradict the image or themselves, and must be refused."""

from __future__ import annotations

from functools import partial

from hexafix.scenarios import changes, layouts
from hexafix.scenarios.refused_images import UPSIDE_DOWN
from hexafix.scenarios.scenario import Refusal, Scenario

_scenario = partial(Scenario, theme="case to be refused")

SCENARIOS = (
    _scenario(
        number=94,
        title="the two rings exchanged in the layout",
        phantom={"side": "left", "bone": "tibia"},
        case=(changes.rings_exchanged,),
        refusal=UPSIDE_DOWN,
    ),
    _scenario(
        number=95,
        title="the reading of strut 4 mistyped by 9 mm",
        phantom={"side": "right", "bone": "tibia"},
        case=(changes.reading(4, 9.0),),
        refusal=Refusal({"strut-reading": "H24"}),
    ),
    _scenario(
        number=96,
        title="two readings exchanged",
        phantom={"side": "left", "bone": "tibia"},
        case=(changes.readings(2, 1, 3, 4, 5, 6),),
        refusal=Refusal({"strut-order": "H25"}),
    ),
    _scenario(
        number=97,
        title="the readings in the reverse order",
        phantom={"side": "right", "bone": "tibia"},
        case=(changes.readings(6, 5, 4, 3, 2, 1),),
        refusal=Refusal({"strut-order": "H25"}),
    ),
    _scenario(
        number=98,
        title="the frame was turned after the scan: every reading 4 mm longer",
        phantom={"side": "left", "bone": "femur"},
        case=(changes.readings(*changes.IN_ORDER, plus_mm=4.0),),
        refusal=Refusal({"strut-reading": "H24"}),
    ),
    _scenario(
        number=99,
        title="readings in centimetres",
        phantom={"side": "right", "bone": "tibia"},
        case=(changes.readings(*changes.IN_ORDER, times=0.1),),
        refusal=Refusal({"strut-reading-out-of-range": "H26"}, exit_code=2),
    ),
    _scenario(
        number=100,
        title="balls of 10 mm written as 12 mm, the size of the struts' steel joints",
        phantom={"side": "left", "bone": "tibia"},
        case=(changes.merged(markers={"ball_diameter_mm": 12.0}),),
        refusal=Refusal({"ring-not-found": "H13"}),
    ),
    _scenario(
        number=101,
        title="balls of 10 mm written as 9.68 mm",
        phantom={"side": "right", "bone": "tibia"},
        case=(changes.merged(markers={"ball_diameter_mm": 9.68}),),
        refusal=Refusal({"ball-diameter": "H23"}),
    ),
    _scenario(
        number=102,
        title="a ball fell off: the layout tells five, the ring has four",
        phantom={"side": "left", "bone": "tibia", **layouts.balls(4, 4)},
        case=(
            changes.one_more_marker(
                "proximal", number=9, radius_mm=100.0, sweep_deg=300.0, height_mm=20.0
            ),
        ),
        refusal=Refusal({"ring-not-found": "H13"}),
    ),
    _scenario(
        number=103,
        title="a marker's radius written 5 mm too small",
        phantom={"side": "right", "bone": "tibia", **layouts.balls(4, 4)},
        case=(changes.marker(2, radius_mm=95.0),),
        refusal=Refusal({"ring-not-found": "H15"}),
    ),
    _scenario(
        number=104,
        title="a marker's height written with the wrong sign",
        phantom={"side": "left", "bone": "tibia", **layouts.balls(4, 4)},
        case=(changes.marker(2, height_mm=-45.0),),
        refusal=Refusal({"ring-not-found": "H15"}),
    ),
    _scenario(
        number=105,
        title="a layout of the relaxed angle rule, not accepted",
        phantom={"side": "right", "bone": "tibia", **layouts.relaxed()},
        refusal=Refusal({"angle-rule-relaxed": "H17"}),
    ),
    _scenario(
        number=106,
        title="even layout of 120° without strut readings",
        phantom={"side": "left", "bone": "tibia", **layouts.even()},
        case=(changes.merged(strut_readings_mm=None),),
        recognise_only=True,
        refusal=Refusal({"numbering-ambiguous": "H18"}),
    ),
    _scenario(
        number=107,
        title="two numbers exchanged by hand",
        phantom={"side": "right", "bone": "tibia", **layouts.balls(4, 4)},
        case=(changes.numbered_by_hand(1, 3),),
        refusal=Refusal({"numbering-does-not-fit": "H19"}),
    ),
    _scenario(
        number=108,
        title="a target that no strut can reach",
        phantom={"side": "left", "bone": "tibia", "correction": "target-pose"},
        case=(changes.merged(correction={"position_mm": [0.0, 0.0, 262.0]}),),
        refusal=Refusal({"strut-out-of-range": "H27"}),
    ),
    _scenario(
        number=109,
        title="the case says right, the image's header says left",
        phantom={"side": "left", "bone": "tibia"},
        case=(changes.merged(limb={"side": "right"}),),
        refusal=Refusal({"wrong-side": "H37"}),
    ),
    _scenario(
        number=110,
        title="a direction of the deformity left out",
        phantom={"side": "right", "bone": "tibia", "correction": "deformity"},
        case=(changes.merged(correction={"axial_rotation": None}),),
        refusal=Refusal({"deformity-parameter": "H42"}, exit_code=2),
    ),
    _scenario(
        number=111,
        title="both rings built alike, and the image mirrored",
        phantom={"side": "left", "bone": "tibia", **layouts.alike()},
        volume=(changes.mirrored("i"),),
        refusal=Refusal({"numbering-not-settled": "H18"}),
    ),
)
