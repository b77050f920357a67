"""From a spec to a phantom: voxels, truth and case."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hexafix.errors import Fault, InputError
from hexafix.imaging import ImageSource, Volume
from hexafix.imaging.fingerprint import fingerprint
from hexafix.kinematics import strut_lengths
from hexafix.phantom.balls import ExactBall
from hexafix.phantom.decoys import decoys_of
from hexafix.phantom.hardware import STRUT_RADIUS_MM, frame_solids
from hexafix.phantom.limb import limb_solids
from hexafix.phantom.render import render
from hexafix.phantom.scene import Scene, build_scene, distance_to_struts_mm
from hexafix.phantom.spec import PhantomSpec
from hexafix.phantom.streaks import streaks_of
from hexafix.phantom.truth import case_document, in_image, truth_document
from hexafix.progress import Progress, silent


@dataclass(frozen=True, eq=False)
class Phantom:
    """A synthetic CT with its exact truth.

    Attributes
    ----------
    spec : PhantomSpec
    volume : Volume
        int16 HU.
    truth : dict
        JSON-able: ball centres by number, ring matrices, mechanism pose, struts, decoys,
        fracture, and what the correction should reach; LPS mm.
    case : dict
        JSON-able case document of the contract's schema; `image.path` is ``ct``.
    """

    spec: PhantomSpec
    volume: Volume
    truth: dict[str, Any]
    case: dict[str, Any]


def make_phantom(
    spec: PhantomSpec | None = None, *, progress: Progress = silent, workers: int | None = None
) -> Phantom:
    """A synthetic CT of a fixator on a limb.

    Parameters
    ----------
    spec : PhantomSpec or None
        None: the default one.
    progress : Progress
    workers : int or None
        Threads, None: as many as there are cores; the result does not depend on it.

    Raises
    ------
    InputError
        If a strut of the pose leaves its stroke or a ball lies outside the volume.
    """
    spec = spec or PhantomSpec()
    scene = build_scene(spec)
    loose, other_balls, listed = decoys_of(spec, scene)
    truth = truth_document(spec, scene, listed)
    check_buildable(spec, scene)
    solids = limb_solids(spec, scene) + frame_solids(spec, scene) + loose
    balls = other_balls + [
        ExactBall(center, spec.ball_diameter_mm / 2.0, spec.ball_hu)
        for center in scene.balls_mm.values()
    ]
    voxels = render(
        spec,
        scene.grid,
        solids,
        balls,
        streaks_of(spec, scene),
        progress=progress,
        workers=workers,
    )
    source = ImageSource(
        kind="memory",
        sha256=fingerprint(voxels, scene.grid.ijk_to_lps),
        slice_thickness_mm=spec.thickness_mm,
        laterality=spec.side[0].upper(),
        body_part=BODY_PART.get(spec.bone, "EXTREMITY"),
        patient_position=spec.patient_position,
    )
    volume = Volume(voxels, scene.grid.ijk_to_lps, source)
    return Phantom(spec, volume, truth, case_document(spec, scene, "ct"))


BODY_PART = {"tibia": "LEG", "femur": "LEG", "humerus": "ARM", "forearm": "ARM", "foot": "FOOT"}
"""BodyPartExamined by bone."""


def check_buildable(spec: PhantomSpec, scene: Scene) -> None:
    """Refuse a frame that could not be built or that the scan would miss.

    Raises
    ------
    InputError
        Naming every strut out of its stroke, now or at the target, and every ball that sits in a
        strut or lies outside the volume.
    """
    faults = []
    stroke = spec.fixator.strut
    target = strut_lengths(spec.target_pose, spec.fixator)
    for when, lengths in (("now", scene.strut_lengths_mm), ("at the target", target)):
        for number, length in enumerate(lengths, start=1):
            if not stroke.min_mm <= length <= stroke.max_mm:
                what = f"strut {number} would be out of its stroke {when}"
                limit = f"{stroke.min_mm} to {stroke.max_mm} mm"
                step = "choose another pose"
                faults.append(Fault("phantom-strut", what, f"{length:.2f} mm", limit, step))
    centers = np.array(list(scene.balls_mm.values()))
    least = spec.ball_diameter_mm / 2.0 + STRUT_RADIUS_MM
    room = distance_to_struts_mm(scene, centers)
    for number, center, gap in zip(scene.balls_mm, centers, room, strict=True):
        if gap < least:
            what, value = f"ball {number} would sit in a strut", f"{gap:.1f} mm from its axis"
            step = "give this marker another sweep angle"
            faults.append(Fault("phantom-collision", what, value, f"at least {least:.1f} mm", step))
        if not spec.partial_frame and not in_image(center, spec.ball_diameter_mm / 2.0, scene):
            what = f"ball {number} does not lie wholly in the volume"
            value = f"{np.round(center, 1).tolist()} mm LPS"
            step = "choose more or larger voxels, or ask for a partial frame"
            faults.append(Fault("phantom-ball-outside", what, value, "inside with its blur", step))
    if faults:
        raise InputError(*faults)
