"""Balls of a phantom found and fitted: centre errors, missed and invented, time and memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.benchmark import comparison_finders as finders
from hexafix.benchmark.balls import SITUATIONS, varied_spec
from hexafix.benchmark.comparison_race import Raced, Tool
from hexafix.imaging import Volume
from hexafix.phantom import make_phantom
from hexafix.phantom.local import render_ball
from hexafix.phantom.spec import PhantomSpec

DIAMETER_MM = 10.0
NEAR_MM = 0.25 * DIAMETER_MM
"""A centre within this of a true ball's has found that ball; any other is invented."""

QUALITIES = {
    "fine": "noise 30 HU",
    "clinical": "1.25 mm slices, tissue, streak 200 HU",
    "thick": "2.5 mm slices",
}
"""Image qualities: key in documents, and which of `hexafix.benchmark.balls.SITUATIONS`."""

_ITK, _SKIMAGE = ("SimpleITK", "SimpleITK"), ("skimage", "scikit-image")


@dataclass(frozen=True)
class _Finder:
    """A finder of `comparison_finders` and how it holds a volume."""

    find: finders.Finder
    hold: Any = lambda volume: volume


FINDERS: dict[str, _Finder] = {
    "hexafix": _Finder(finders.by_hexafix),
    "simpleitk-centroid": _Finder(finders.by_simpleitk_centroid, finders.simpleitk_image),
    "simpleitk-isosurface": _Finder(finders.by_simpleitk_isosurface, finders.simpleitk_image),
    "vtk-isosurface": _Finder(finders.by_vtk, finders.vtk_image),
    "skimage-centroid": _Finder(finders.by_skimage_centroid),
    "skimage-isosurface": _Finder(finders.by_skimage_isosurface),
    "cc3d-centroid": _Finder(finders.by_cc3d_centroid),
    "careless": _Finder(finders.by_careless_hexafix),
}


def _tool(name: str, words: str, *libraries: tuple[str, str], control: bool = False) -> Tool:
    finder = FINDERS[name]

    def prepare(folder: Path) -> Any:
        small, _ = render_ball(SITUATIONS["noise 30 HU"][0], np.random.default_rng(0))
        finder.find(finder.hold(small), DIAMETER_MM)  # imports and compilation apart
        voxels, affine = np.load(folder / "voxels.npy"), np.load(folder / "affine.npy")
        return finder.hold(Volume(voxels, affine))

    return Tool(
        name=name,
        words=words,
        against="hexafix",
        run=lambda held: finder.find(held, DIAMETER_MM),
        digest=lambda centers: np.asarray(centers, float).reshape(-1, 3),
        prepare=prepare,
        libraries=libraries,
        control=control,
    )


TOOLS = (
    _tool("hexafix", "HexaFix: find_balls"),
    _tool("simpleitk-centroid", "SimpleITK: threshold, components, centroid", _ITK),
    _tool(
        "simpleitk-isosurface",
        "SimpleITK: the same, marching cubes, least-squares sphere (the paper's recipe)",
        _ITK,
        _SKIMAGE,
    ),
    _tool(
        "vtk-isosurface",
        "VTK: flying edges, connectivity, least-squares sphere",
        ("vtkmodules", "vtk"),
    ),
    _tool("skimage-centroid", "scikit-image: label, regionprops, weighted centroid", _SKIMAGE),
    _tool(
        "skimage-isosurface",
        "scikit-image: label, marching cubes, least-squares sphere",
        _SKIMAGE,
    ),
    _tool("cc3d-centroid", "cc3d: components, centroid", ("cc3d", "connected-components-3d")),
    _tool("careless", "control: HexaFix made careless on purpose", control=True),
)


def write_data(folder: Path, *, quick: bool, seed: int) -> dict[str, Any]:
    """Render the phantom of the race into a folder; return its settings."""
    spec = quick_spec(seed) if quick else PhantomSpec(seed=seed)
    phantom = make_phantom(spec)
    np.save(folder / "voxels.npy", phantom.volume.voxels)
    np.save(folder / "affine.npy", phantom.volume.ijk_to_lps)
    np.save(folder / "truth.npy", _whole_balls(phantom))
    return {
        "size_ijk": list(spec.size_ijk),
        "spacing_mm": list(spec.spacing_mm),
        "balls": len(np.load(folder / "truth.npy")),
        "voxels_mb": phantom.volume.voxels.nbytes / 2**20,
    }


def quick_spec(seed: int) -> PhantomSpec:
    """A crop of the phantom about its first ball, part of the ring and its neighbours."""
    spec = PhantomSpec(seed=seed)
    ring_a = spec.ring_b_pose @ spec.mechanism_pose
    first = ring_a.apply(spec.proximal.points_mm[0])
    return replace(
        spec,
        size_ijk=(96, 90, 80),
        spacing_mm=(0.9, 0.9, 1.0),
        image_center_mm=(float(first[0]), float(first[1]), float(first[2])),
        partial_frame=True,
    )


def _whole_balls(phantom: Any) -> NDArray[np.float64]:
    return np.array(
        [ball["center_mm"] for ball in phantom.truth["balls"] if ball["whole_in_image"]]
    ).reshape(-1, 3)


def compared(centers: NDArray[np.float64], truth: NDArray[np.float64]) -> dict[str, Any]:
    """Centres found against true ones.

    Parameters
    ----------
    centers, truth : ndarray, shape (n, 3) and (m, 3)
        LPS mm.

    Returns
    -------
    dict
        ``balls``, ``missed``, ``invented`` and ``rms_3d_mm`` (of those found; None without any).
    """
    apart = np.linalg.norm(centers[:, None] - truth, axis=2).reshape(len(centers), len(truth))
    near = apart < NEAR_MM
    best = apart.min(axis=0)[near.any(axis=0)] if len(centers) else np.zeros(0)
    return {
        "balls": len(truth),
        "missed": int((~near.any(axis=0)).sum()),
        "invented": int((~near.any(axis=1)).sum()),
        "rms_3d_mm": float(np.sqrt(np.mean(best**2))) if len(best) else None,
    }


def judge(raced: dict[str, Raced], folder: Path) -> dict[str, list[dict[str, Any]]]:
    """Each tool's result of the race against the truth."""
    truth = np.load(folder / "truth.npy")
    return {name: [{"case": "raced", **compared(one.result, truth)}] for name, one in raced.items()}


def centre_errors(
    names: Sequence[str], *, placements: int, seed: int
) -> dict[str, list[dict[str, Any]]]:
    """Errors over seeded sub-voxel placements in every image quality; all tools see the same.

    Parameters
    ----------
    names : sequence of str
        Of `FINDERS`.
    placements : int
        For each quality.
    seed : int

    Returns
    -------
    dict
        For each name one dict a quality: ``case``, ``balls``, ``missed``, ``invented``,
        ``rms_3d_mm``, ``p95_mm``, ``bias_along_rod_mm`` (None where no ball was found).
    """
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
    for number, (quality, situation) in enumerate(QUALITIES.items()):
        rng = np.random.default_rng([seed, number])
        errors: dict[str, list[NDArray[np.float64]]] = {name: [] for name in names}
        invented = dict.fromkeys(names, 0)
        for _ in range(placements):
            volume, truth = render_ball(SITUATIONS[situation][0], rng)
            for name in names:
                finder = FINDERS[name]
                away = finder.find(finder.hold(volume), DIAMETER_MM) - truth.center_mm
                near = np.linalg.norm(away, axis=1) < NEAR_MM
                invented[name] += int((~near).sum())
                if near.any():
                    error = away[np.argmin(np.linalg.norm(away, axis=1))]
                    errors[name].append(np.append(error, error @ truth.rod_direction))
        for name in names:
            rows[name].append(
                {
                    "case": quality,
                    "balls": placements,
                    "missed": placements - len(errors[name]),
                    "invented": invented[name],
                    **_statistics(errors[name]),
                }
            )
    return rows


def searched(names: Sequence[str], *, phantoms: int, seed: int) -> dict[str, list[dict[str, Any]]]:
    """Balls missed and invented in whole phantoms of varied voxels, materials and decoys.

    Parameters
    ----------
    names : sequence of str
        Of `FINDERS`.
    phantoms : int
    seed : int

    Returns
    -------
    dict
        For each name a list of one dict as of `compared`, summed; empty without phantoms.
    """
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
    rng = np.random.default_rng([seed, 9])
    for number in range(phantoms):
        phantom = make_phantom(varied_spec(rng, number))
        truth = _whole_balls(phantom)
        for name in names:
            finder = FINDERS[name]
            held = finder.hold(phantom.volume)
            found[name].append(compared(finder.find(held, phantom.spec.ball_diameter_mm), truth))
    return {name: [_summed(rows)] if rows else [] for name, rows in found.items()}


def _summed(rows: list[dict[str, Any]]) -> dict[str, Any]:
    squares = [
        (row["rms_3d_mm"] ** 2, row["balls"] - row["missed"])
        for row in rows
        if row["rms_3d_mm"] is not None
    ]
    hits = sum(count for _, count in squares)
    return {
        "case": "varied",
        "phantoms": len(rows),
        **{key: sum(row[key] for row in rows) for key in ("balls", "missed", "invented")},
        "rms_3d_mm": float(np.sqrt(sum(s * n for s, n in squares) / hits)) if hits else None,
    }


def _statistics(errors: list[NDArray[np.float64]]) -> dict[str, float | None]:
    """Of errors (x, y, z, along the rod), mm."""
    if not errors:
        return {"rms_3d_mm": None, "p95_mm": None, "bias_along_rod_mm": None}
    each = np.array(errors)
    length = np.linalg.norm(each[:, :3], axis=1)
    return {
        "rms_3d_mm": float(np.sqrt(np.mean(length**2))),
        "p95_mm": float(np.quantile(length, 0.95)),
        "bias_along_rod_mm": float(each[:, 3].mean()),
    }
