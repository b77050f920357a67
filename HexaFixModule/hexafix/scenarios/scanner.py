"""How the patient lies, how the slices run and how they are stored."""

from __future__ import annotations

from functools import partial

import numpy as np

from hexafix.scenarios import changes
from hexafix.scenarios.scenario import Scenario

_scenario = partial(Scenario, theme="scanner and storage")


def _lying(number: int, position: str, words: str, side: str) -> Scenario:
    return _scenario(
        number=number,
        title=f"{words} ({position})",
        phantom={"side": side, "bone": "tibia", "patient_position": position},
    )


def _leaning(number: int, tilt_deg: float, words: str, **phantom: object) -> Scenario:
    return _scenario(
        number=number,
        title=f"gantry tilted {tilt_deg:+g}°, {words}; the tilt tag has the other vendor's sign",
        phantom={
            "side": "left",
            "bone": "tibia",
            "gantry_tilt_rad": float(np.radians(tilt_deg)),
            **phantom,
        },
    )


SCENARIOS = (
    _lying(13, "HFP", "head first, prone", "left"),
    _lying(14, "FFS", "feet first, supine", "right"),
    _lying(15, "FFP", "feet first, prone", "left"),
    _lying(16, "HFDR", "head first, on the right side", "right"),
    _lying(17, "HFDL", "head first, on the left side", "left"),
    _lying(18, "FFDR", "feet first, on the right side", "right"),
    _lying(19, "FFDL", "feet first, on the left side", "left"),
    _scenario(
        number=20,
        title="slices stored from the head down",
        phantom={"side": "right", "bone": "tibia", "slices_reversed": True},
    ),
    _scenario(
        number=21,
        title="coronal reformation",
        phantom={"side": "left", "bone": "tibia", "slice_plane": "coronal"},
    ),
    _scenario(
        number=22,
        title="sagittal reformation, stored from left to right",
        phantom={
            "side": "right",
            "bone": "femur",
            "slice_plane": "sagittal",
            "slices_reversed": True,
        },
    ),
    _leaning(23, 12.0, "one of the usual frames", image_angles_rad=(0.0, 0.0, 0.0)),
    _leaning(24, -18.5, "feet first", patient_position="FFS"),
    _leaning(
        25,
        24.0,
        "slices stored from the head down",
        slices_reversed=True,
        image_angles_rad=(0.0, 0.0, 0.0),
    ),
    _scenario(
        number=26,
        title="NRRD file, left-handed stack",
        image_format="nrrd",
        phantom={"side": "left", "bone": "femur", "slices_reversed": True},
    ),
    _scenario(
        number=27,
        title="NIfTI file, feet first",
        image_format="nifti",
        phantom={"side": "right", "bone": "tibia", "patient_position": "FFS"},
    ),
    _scenario(
        number=28,
        title="MetaImage file, oblique",
        image_format="metaimage",
        phantom={"side": "left", "bone": "tibia", "image_angles_rad": (-0.15, 0.11, 0.3)},
    ),
    _scenario(
        number=29,
        title="scouts and a dose report in the folder",
        phantom={"side": "right", "bone": "tibia"},
        folder=(changes.localizer_and_dose_report,),
    ),
    _scenario(
        number=30,
        title="two series in the folder, the right one named by its UID",
        phantom={"side": "left", "bone": "tibia"},
        folder=(changes.second_series,),
        case=(changes.series_named,),
    ),
    _scenario(
        number=31,
        title="slices spread over subfolders without file endings",
        phantom={"side": "right", "bone": "femur"},
        folder=(changes.in_subfolders,),
    ),
    _scenario(
        number=32,
        title="one slice exported twice",
        phantom={"side": "left", "bone": "tibia"},
        folder=(changes.doubled_slice,),
    ),
    _scenario(
        number=33,
        title="RLE-compressed slices",
        phantom={"side": "right", "bone": "tibia"},
        folder=(changes.stored_as("rle"),),
    ),
    _scenario(
        number=34,
        title="deflated slices",
        phantom={"side": "left", "bone": "tibia"},
        folder=(changes.stored_as("deflated"),),
    ),
)
