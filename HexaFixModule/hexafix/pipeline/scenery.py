"""What is shown of a case: the scene with its bone, the fragments, and the small pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.case import Case
from hexafix.errors import InputError
from hexafix.hardware import MarkerLayout
from hexafix.pipeline.document import recognition
from hexafix.pipeline.recognised import Recognised
from hexafix.report import figures
from hexafix.report.pages import pdf_pages
from hexafix.report.scene import BoneSample, SceneGeometry, sample_bone

AIR_HU = -1024
"""Brightness of what is cut away."""


def scene_of(case: Case, recognised: Recognised, *, bone: bool = True) -> SceneGeometry:
    """Rings, struts, numbered balls and, if asked for, the bone, as the CT shows them.

    Parameters
    ----------
    case : Case
    recognised : Recognised
    bone : bool
        Whether a coarse piece of the CT is taken along for the picture of the bone.
    """
    seen = {**recognition(case, recognised), "case": dict(case.document)}
    scene = SceneGeometry.from_document(seen)
    return replace(scene, bone=sample_bone(recognised.volume, scene)) if bone else scene


def split_point(recognised: Recognised, fraction: float = 0.5) -> list[float]:
    """The point between the rings where the picture parts the fragments, LPS mm.

    Parameters
    ----------
    recognised : Recognised
    fraction : float
        From the distal ring's origin (0) to the proximal one's (1).
    """
    if not 0.0 <= fraction <= 1.0:
        raise InputError.of(
            "split-fraction",
            "the fragments are parted between the rings",
            value=f"{fraction:g}",
            limit="0 (distal ring) to 1 (proximal ring)",
        )
    low, high = _ring_origins(recognised)
    return (low + fraction * (high - low)).tolist()


def bone_fragments(recognised: Recognised, *, split_fraction: float = 0.5) -> dict[str, BoneSample]:
    """The bone inside the rings, parted by a plane between them; for the picture only.

    Parameters
    ----------
    recognised : Recognised
    split_fraction : float
        As in `split_point`; the plane is square to the line between the rings' origins.

    Returns
    -------
    dict
        ``proximal`` and ``distal``, each air beyond the plane.
    """
    point = np.array(split_point(recognised, split_fraction))
    low, high = _ring_origins(recognised)
    axis = (high - low) / np.linalg.norm(high - low)
    scene = SceneGeometry(
        recognised.proximal.pose.matrix,
        recognised.distal.pose.matrix,
        recognised.fixator,
        balls=(),
        side="left",
    )
    whole = sample_bone(recognised.volume, scene)
    return {
        "proximal": _beyond(whole, point, axis),
        "distal": _beyond(whole, point, -axis),
    }


def pictures(document: Mapping[str, Any]) -> dict[str, str]:
    """The small figures of a plan document as SVG.

    Returns
    -------
    dict
        ``layout_proximal``, ``layout_distal``, ``strut_curves``, ``strut_map``.
    """
    return {
        **_roses(document["case"]["markers"]),
        "strut_curves": figures.strut_curves(document),
        "strut_map": figures.strut_map(SceneGeometry.from_document(document)),
    }


def strut_curves_at(document: Mapping[str, Any], row: int) -> str:
    """The struts' curves of a plan document as SVG, a row of the schedule marked."""
    return figures.strut_curves(document, row=row)


def layout_pictures(proximal: MarkerLayout, distal: MarkerLayout) -> dict[str, str]:
    """The layout roses as SVG, before there is a plan: ``layout_proximal``, ``layout_distal``."""
    return _roses({"proximal": _sites(proximal), "distal": _sites(distal)})


def prescription_pages(pdf: bytes, *, dpi: float = 110.0) -> list[bytes]:
    """The pages of a prescription as PNG pictures; see `hexafix.report.pages.pdf_pages`."""
    return pdf_pages(pdf, dpi=dpi)


def _roses(markers: Mapping[str, Any]) -> dict[str, str]:
    document = {"case": {"markers": markers}}
    return {
        f"layout_{ring}": figures.layout_rose(document, ring) for ring in ("proximal", "distal")
    }


def _sites(layout: MarkerLayout) -> list[dict[str, float]]:
    """A layout as the case file has it."""
    return [
        {
            "number": site.number,
            "radius_mm": site.radius_mm,
            "sweep_deg": round(float(np.degrees(site.sweep_rad)), 9),
            "height_mm": site.height_mm,
        }
        for site in layout.sites
    ]


def _ring_origins(recognised: Recognised) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origins of the distal and of the proximal ring, LPS mm."""
    return recognised.distal.pose.position_mm, recognised.proximal.pose.position_mm


def _beyond(
    sample: BoneSample, point_mm: NDArray[np.float64], normal: NDArray[np.float64]
) -> BoneSample:
    """The sample with air on the near side of a plane, LPS mm; `normal` points to what stays."""
    affine = sample.ijk_to_lps
    k, j, i = (np.arange(n, dtype=np.float32) for n in sample.hu.shape)
    a, b, c = (affine[:3, :3].T @ normal).tolist()
    height = float((affine[:3, 3] - point_mm) @ normal)
    distance = a * i[None, None, :] + b * j[None, :, None] + c * k[:, None, None] + height
    hu = np.where(distance >= 0.0, sample.hu, np.int16(AIR_HU))
    hu.setflags(write=False)
    return BoneSample(hu, affine)
