"""Marker balls measured: accuracy, search, speed and memory, beside the paper's recipe.

`accuracy` fits rendered balls of known centre, `search` counts balls missed and invented in whole
phantoms, `speed_and_memory` races a plain SimpleITK pipeline in one child process.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import MissingLibrary
from hexafix.geometry import Pose
from hexafix.imaging import Volume
from hexafix.markers import find_balls
from hexafix.phantom import make_phantom
from hexafix.phantom.local import Scene, render_ball
from hexafix.phantom.spec import PhantomSpec

SITUATIONS: dict[str, tuple[Scene, float]] = {
    "noise 30 HU": (Scene(), 0.010),
    "noise 80 HU": (Scene(noise_hu=80.0), 0.015),
    "1.25 mm slices, tissue, streak 200 HU": (
        Scene(
            spacing_mm=(0.7, 0.7, 1.25),
            noise_hu=50.0,
            noise_correlation_mm=0.6,
            tissue_gap_mm=1.0,
            streak_hu=200.0,
        ),
        0.035,
    ),
    "steel ball clipped at 3071 HU": (Scene(ball_hu=8000.0), 0.015),
    "aluminium ring 0.7 mm away": (Scene(ring_gap_mm=0.7), 0.015),
    "2.5 mm slices": (Scene(spacing_mm=(0.7, 0.7, 2.5)), 0.050),
}
"""Scene and goal of the 3D RMS error, mm."""


def accuracy(placements: int = 100, seed: int = 0) -> list[dict[str, Any]]:
    """Errors of `find_balls` and of the paper's recipe over random sub-voxel placements.

    Parameters
    ----------
    placements : int
        For each situation.
    seed : int

    Returns
    -------
    list of dict
        One for each of `SITUATIONS`: ``name``, ``n``, ``missed``, ``rms_3d_mm``, ``p95_mm``,
        ``bias_along_rod_mm``, ``sigma_ratio`` (RMS of actual over stated error), ``goal_mm``,
        and the first errors again with ``paper_`` for isosurface and least squares.
    """
    return [
        _situation(name, scene, goal, placements, np.random.default_rng([seed, number]))
        for number, (name, (scene, goal)) in enumerate(SITUATIONS.items())
    ]


def _situation(
    name: str, scene: Scene, goal: float, placements: int, rng: np.random.Generator
) -> dict[str, Any]:
    """One row of `accuracy`."""
    errors, paper, along, paper_along, stated = [], [], [], [], []
    for _ in range(placements):
        volume, truth = render_ball(scene, rng)
        center = isosurface_center(volume, near_mm=truth.center_mm, diameter_mm=truth.diameter_mm)
        error = center - truth.center_mm
        paper.append(np.linalg.norm(error))
        paper_along.append(error @ truth.rod_direction)
        found = find_balls(volume, ball_diameter_mm=scene.ball_diameter_mm)
        if len(found.balls) != 1:
            continue
        error = found.balls[0].center_mm - truth.center_mm
        errors.append(np.linalg.norm(error))
        along.append(error @ truth.rod_direction)
        stated.append(np.trace(found.balls[0].covariance_mm2))
    rms = float(np.sqrt(np.mean(np.square(errors))))
    return {
        "name": name,
        "n": placements,
        "missed": placements - len(errors),
        "rms_3d_mm": rms,
        "p95_mm": float(np.quantile(errors, 0.95)),
        "bias_along_rod_mm": float(np.mean(along)),
        "sigma_ratio": rms / float(np.sqrt(np.mean(stated))),
        "goal_mm": goal,
        "paper_rms_3d_mm": float(np.sqrt(np.mean(np.square(paper)))),
        "paper_p95_mm": float(np.quantile(paper, 0.95)),
        "paper_bias_along_rod_mm": float(np.mean(paper_along)),
    }


def isosurface_center(
    volume: Volume,
    *,
    near_mm: NDArray[np.float64],
    diameter_mm: float,
    level_hu: float | None = None,
) -> NDArray[np.float64]:
    """Centre by isosurface at half height and least squares, the paper's recipe.

    Parameters
    ----------
    volume : Volume
        A crop: the surface is sought in all of it.
    near_mm : ndarray, shape (3,)
        A point inside the ball, LPS mm: it only picks the ball's surface out of the crop.
    diameter_mm : float
    level_hu : float, optional
        The isosurface; None: half-way between air and the value at `near_mm`.

    Returns
    -------
    ndarray, shape (3,)
        LPS mm.

    Notes
    -----
    Source: Section 2.1.
    """
    marching_cubes = isosurface_finder()
    values = np.asarray(volume.voxels, np.float32)
    if level_hu is None:
        place = np.rint(volume.ijk_from_lps(near_mm)).astype(int)
        level_hu = 0.5 * (float(values[place[2], place[1], place[0]]) - 1000.0)
    vertices = marching_cubes(values, level_hu)[0]
    points = volume.lps_from_ijk(vertices[:, ::-1])
    points = points[np.linalg.norm(points - near_mm, axis=1) < 0.75 * diameter_mm]
    return least_squares_sphere(points)


def isosurface_finder() -> Any:
    """Marching cubes of scikit-image.

    Raises
    ------
    MissingLibrary
        If it is not installed.
    """
    try:
        from skimage.measure import marching_cubes
    except ImportError as error:
        raise MissingLibrary.of(
            "library-missing",
            "the paper's recipe in the benchmark needs scikit-image",
            next_step="install hexafix[benchmark]",
        ) from error
    return marching_cubes


def least_squares_sphere(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centre of the algebraic least squares sphere of points, shape (n, 3)."""
    middle = points.mean(axis=0)
    local = points - middle
    rows = np.column_stack([2.0 * local, np.ones(len(local))])
    return middle + np.linalg.lstsq(rows, np.sum(local**2, axis=1), rcond=None)[0][:3]


def search(phantoms: int = 20, seed: int = 0) -> dict[str, Any]:
    """Balls missed and invented in whole phantoms with decoys.

    Parameters
    ----------
    phantoms : int
    seed : int

    Returns
    -------
    dict
        ``phantoms``, ``balls``, ``missed``, ``invented``, ``rejected`` (candidates listed) and
        ``worst_error_mm``.
    """
    rng = np.random.default_rng(seed)
    result = {"phantoms": phantoms, "balls": 0, "missed": 0, "invented": 0, "rejected": 0}
    worst = 0.0
    for number in range(phantoms):
        phantom = make_phantom(varied_spec(rng, number))
        true = np.array([ball["center_mm"] for ball in phantom.truth["balls"]])
        found = find_balls(phantom.volume, ball_diameter_mm=phantom.spec.ball_diameter_mm)
        apart = np.linalg.norm(found.centers_mm[:, None] - true, axis=2).reshape(-1, len(true))
        hit = apart < 0.5
        result["balls"] += len(true)
        result["missed"] += int((~hit.any(axis=0)).sum())
        result["invented"] += int((~hit.any(axis=1)).sum())
        result["rejected"] += len(found.rejected)
        worst = max([worst, *apart[hit].tolist()])
    return {**result, "worst_error_mm": worst}


def varied_spec(rng: np.random.Generator, seed: int) -> PhantomSpec:
    """A phantom of random voxels, noise, streaks, materials and poses; all balls inside."""
    plane, thick = float(rng.uniform(0.75, 1.0)), float(rng.choice([0.8, 1.0, 1.25, 1.5]))
    return PhantomSpec(
        seed=seed,
        size_ijk=(round(340 / plane), round(340 / plane), round(340 / thick)),
        spacing_mm=(plane, plane, thick),
        image_angles_rad=tuple(rng.uniform(-0.15, 0.15, 3)),
        mechanism_pose=Pose.from_xyz_fixed(
            position_mm=rng.uniform((-12, -12, 170), (12, 12, 190)),
            angles_rad=np.radians(rng.uniform(-7, 7, 3)),
        ),
        ball_diameter_mm=float(rng.choice([8.0, 10.0, 10.0])),
        ball_hu=float(rng.choice([1800.0, 2300.0, 2300.0, 8000.0])),
        rod_hu=float(rng.uniform(80, 160)),
        ring_material=str(rng.choice(["aluminium", "carbon"])),
        psf_sigma_mm=float(rng.uniform(0.45, 0.65)),
        noise_hu=float(rng.uniform(20, 80)),
        noise_correlation_mm=float(rng.choice([0.0, 0.6])),
        streak_hu=float(rng.choice([0.0, 100.0, 250.0])),
    )


def speed_and_memory(rounds: int = 3) -> dict[str, Any]:
    """Time and memory of `find_balls` beside a SimpleITK pipeline, volume in memory.

    Parameters
    ----------
    rounds : int
        Both run this often, in turn; the fastest of each counts.

    Returns
    -------
    dict
        ``balls``, ``seconds``, ``pipeline_seconds``, ``ratio``, ``extra_mb`` (greatest resident
        memory over the volume's, first call), ``traced_mb`` (peak of NumPy's allocations) and
        ``pipeline_extra_mb``.
    """
    spec = PhantomSpec(size_ijk=(512, 512, 600), spacing_mm=(0.7, 0.7, 0.625))
    spec = _six_balls(spec)
    with tempfile.TemporaryDirectory() as folder:
        voxels, affine = Path(folder, "voxels.npy"), Path(folder, "affine.npy")
        phantom = make_phantom(spec)
        np.save(voxels, phantom.volume.voxels)
        np.save(affine, phantom.volume.ijk_to_lps)
        del phantom
        command = [sys.executable, "-m", "hexafix.benchmark.balls", folder, str(rounds)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout)


def _six_balls(spec: PhantomSpec) -> PhantomSpec:
    """The phantom with three balls on each ring."""
    from dataclasses import replace

    from hexafix.hardware import MarkerLayout

    return replace(
        spec,
        proximal=MarkerLayout(spec.proximal.sites[:3]),
        distal=MarkerLayout(spec.distal.sites[:3]),
    )


def _race(folder: str, rounds: int) -> dict[str, Any]:
    """What the child process measures."""
    import psutil

    def peak_mb() -> float:
        # ru_maxrss is inherited from the parent, so Linux is asked for this program's own peak.
        status = Path("/proc/self/status")
        if status.exists():
            line = next(x for x in status.read_text().splitlines() if x.startswith("VmHWM"))
            return int(line.split()[1]) / 1024
        return psutil.Process().memory_info().rss / 2**20

    small, _ = render_ball(Scene(), np.random.default_rng(0))
    find_balls(small, ball_diameter_mm=10.0)
    volume = Volume(np.load(Path(folder, "voxels.npy")), np.load(Path(folder, "affine.npy")))
    before = peak_mb()
    found = find_balls(volume, ball_diameter_mm=10.0)
    extra = peak_mb() - before
    tracemalloc.start()
    find_balls(volume, ball_diameter_mm=10.0)
    traced = tracemalloc.get_traced_memory()[1] / 2**20
    tracemalloc.stop()
    ours, theirs, before = [], [], peak_mb()
    for _ in range(rounds):
        start = time.perf_counter()
        find_balls(volume, ball_diameter_mm=10.0)
        ours.append(time.perf_counter() - start)
        theirs.append(simpleitk_pipeline(volume, 10.0)[0])
    return {
        "balls": len(found.balls),
        "seconds": min(ours),
        "pipeline_seconds": min(theirs),
        "ratio": min(ours) / min(theirs),
        "extra_mb": extra,
        "traced_mb": traced,
        "pipeline_extra_mb": peak_mb() - before,
    }


def simpleitk_pipeline(
    volume: Volume, diameter_mm: float
) -> tuple[float, list[NDArray[np.float64]]]:
    """Seconds and centres of the plain pipeline, the making of its image not counted.

    Threshold, connected components, relabel, shape statistics, then marching cubes and least
    squares for each component of about the ball's volume.
    """
    import SimpleITK as sitk  # noqa: N813
    from skimage.measure import marching_cubes

    image = sitk.GetImageFromArray(volume.voxels)
    image.SetSpacing(volume.spacing_mm.tolist())
    start = time.perf_counter()
    metal = sitk.BinaryThreshold(image, 1000, 32767, 1, 0)
    labels = sitk.RelabelComponent(sitk.ConnectedComponent(metal), minimumObjectSize=100)
    shapes = sitk.LabelShapeStatisticsImageFilter()
    shapes.Execute(labels)
    centers = []
    for label in shapes.GetLabels():
        if not 0.6 < shapes.GetPhysicalSize(label) / (np.pi / 6.0 * diameter_mm**3) < 1.6:
            continue
        box = np.array(shapes.GetBoundingBox(label))
        low, high = np.maximum(box[:3] - 4, 0), box[:3] + box[3:] + 4
        crop = volume.voxels[low[2] : high[2], low[1] : high[1], low[0] : high[0]]
        vertices = marching_cubes(crop.astype(np.float32), 650.0)[0]
        centers.append(least_squares_sphere(volume.lps_from_ijk(vertices[:, ::-1] + low)))
    return time.perf_counter() - start, centers


if __name__ == "__main__":
    print(json.dumps(_race(sys.argv[1], int(sys.argv[2]))))
