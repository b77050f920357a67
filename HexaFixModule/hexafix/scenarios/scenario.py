"""One clinical case to be brought, planned and judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from hexafix.imaging import Volume
from hexafix.phantom import PhantomSpec, random_spec
from hexafix.phantom.scene import build_scene
from hexafix.phantom.spec import CORRECTIONS

VolumeChange = Callable[[Volume], Volume]
"""What a faulty reader or writer did to the image before it was stored."""

FolderChange = Callable[[Path], None]
"""What happened to the files of the DICOM folder."""

CaseChange = Callable[[dict[str, Any], Mapping[str, Any]], None]
"""What the user wrote into the case document, changed in place; the truth is for looking up."""

BASE: Mapping[str, Any] = MappingProxyType({"spacing_mm": (1.15, 1.1, 1.45), "noise_hu": 25.0})
"""Knobs of every scenario that does not vary them: coarse, so that a scenario takes seconds."""

MARGIN_MM = 14.0
"""From the outermost balls to the faces of the volume."""

FIRST_SEED = 300


@dataclass(frozen=True, eq=False)
class Refusal:
    """How HexaFix must refuse.

    Attributes
    ----------
    faults : mapping of str to str or None
        Every code that must be told, and its hazard; no other may be.
    exit_code : int
        3 for a safety gate, 2 for a wrong file or case.
    """

    faults: Mapping[str, str | None]
    exit_code: int = 3


@dataclass(frozen=True, eq=False, kw_only=True)
class Scenario:
    """A seeded phantom, how it is brought, and what must come of it.

    Attributes
    ----------
    number : int
        Stands in the id and decides the seed.
    theme, title : str
    phantom : mapping
        Knobs of `PhantomSpec` that are not drawn from the seed.
    margin_mm : float
        Room around the balls in the volume.
    image_format : str
    volume, folder, case : tuple of callables
        Changes, in order.
    accept_relaxed_layout : bool
    recognise_only : bool
        Ask for the poses alone, as ``hexafix recognise`` does.
    dates : tuple of str
        ISO dates that the schedule must hold.
    told : mapping of str to value
        Keys of the document that must have just this value.
    refusal : Refusal or None
        None: it must be planned.
    """

    number: int
    theme: str
    title: str
    phantom: Mapping[str, Any] = field(default_factory=dict)
    margin_mm: float = MARGIN_MM
    image_format: Literal["dicom", "nrrd", "nifti", "metaimage"] = "dicom"
    volume: tuple[VolumeChange, ...] = ()
    folder: tuple[FolderChange, ...] = ()
    case: tuple[CaseChange, ...] = ()
    accept_relaxed_layout: bool = False
    recognise_only: bool = False
    dates: tuple[str, ...] = ()
    told: Mapping[str, Any] = field(default_factory=dict)
    refusal: Refusal | None = None

    @property
    def id(self) -> str:
        """``S01`` and so on."""
        return f"S{self.number:02d}"

    @property
    def seed(self) -> int:
        """Seed of the phantom."""
        return FIRST_SEED + self.number

    def spec(self) -> PhantomSpec:
        """The phantom's spec: knobs, the rest drawn from the seed, the volume fitted to the balls.

        Raises
        ------
        InputError
            If the knobs do not make a frame that could be built.
        """
        given = {**BASE, "correction": CORRECTIONS[self.number % len(CORRECTIONS)], **self.phantom}
        given.setdefault("moving", ("proximal", "distal")[self.number // 4 % 2])
        drawn = random_spec(self.seed, **{**given, "partial_frame": True})
        partial = bool(given.get("partial_frame", False))
        if "size_ijk" in given:
            return replace(drawn, partial_frame=partial)
        return replace(fitted(drawn, self.margin_mm), partial_frame=partial)


def fitted(spec: PhantomSpec, margin_mm: float) -> PhantomSpec:
    """The spec with the smallest volume that holds all balls and a margin around them."""
    scene = build_scene(spec)
    grid = scene.grid.ijk_to_lps
    inverse = np.linalg.inv(grid[:3, :3])
    balls = np.array(list(scene.balls_mm.values())) @ inverse.T
    reach = (0.5 * spec.ball_diameter_mm + margin_mm) * np.linalg.norm(inverse, axis=1)
    size = np.ceil(np.ptp(balls, axis=0) + 2.0 * reach).astype(int)
    middle = grid[:3, :3] @ (0.5 * (balls.min(axis=0) + balls.max(axis=0)))
    center = (float(middle[0]), float(middle[1]), float(middle[2]))
    return replace(
        spec, size_ijk=(int(size[0]), int(size[1]), int(size[2])), image_center_mm=center
    )
