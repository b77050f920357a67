"""Ring poses from ball centres: weighted least squares beside SciPy's and NumPy's closed forms."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.benchmark.comparison_race import Raced, Tool
from hexafix.benchmark.recognition import random_pose
from hexafix.hardware import MarkerLayout
from hexafix.phantom.spec import INSTALLATION_SIGMA_MM, PhantomSpec
from hexafix.recognition import ring_pose, ring_poses

Array = NDArray[np.float64]

SCENES: dict[str, tuple[tuple[float, float, float], ...]] = {
    "equal": ((0.02, 0.02, 0.02),) * 4,
    "streak": ((0.02, 0.02, 0.02),) * 3 + ((0.4, 0.4, 0.4),),
    "thick": ((0.05, 0.05, 0.3),) * 4,
}
"""σ of each ball's centre along x, y, z of the image, mm; installation errors come on top."""


def _layout() -> MarkerLayout:
    return PhantomSpec().proximal


def write_data(folder: Path, *, quick: bool, seed: int) -> dict[str, Any]:
    """Draw ring poses and erroneous ball centres into a folder; return the settings."""
    count = 20 if quick else 500
    rng = np.random.default_rng(seed)
    poses = [random_pose(rng) for _ in range(count)]
    places = _layout().points_mm
    points = []
    for sigma in SCENES.values():
        built = places + INSTALLATION_SIGMA_MM * rng.normal(size=(count, *places.shape))
        seen = np.array([pose.apply(one) for pose, one in zip(poses, built, strict=True)])
        points.append(seen + np.array(sigma) * rng.normal(size=seen.shape))
    np.savez(
        folder / "rings.npz",
        points=np.array(points),
        rotations=np.array([pose.rotation for pose in poses]),
        positions=np.array([pose.position_mm for pose in poses]),
    )
    return {
        "rings_of_each_scene": count,
        "balls": len(places),
        "installation_sigma_mm": INSTALLATION_SIGMA_MM,
        "image_sigma_mm": {name: [list(ball) for ball in s] for name, s in SCENES.items()},
    }


def judge(raced: dict[str, Raced], folder: Path) -> dict[str, list[dict[str, Any]]]:
    """RMS errors of the ring's origin and orientation in each scene."""
    truth = np.load(folder / "rings.npz")
    return {name: _scene_errors(one.result, truth) for name, one in raced.items()}


def _scene_errors(found: Array, truth: Any) -> list[dict[str, Any]]:
    rows = []
    for scene, poses in zip(SCENES, found.reshape(len(SCENES), -1, 12), strict=True):
        turn = np.linalg.norm(poses[:, :9].reshape(-1, 3, 3) - truth["rotations"], axis=(1, 2))
        away = np.linalg.norm(poses[:, 9:] - truth["positions"], axis=1)
        rows.append(
            {
                "case": scene,
                "rings": len(poses),
                "rms_mm": float(np.sqrt(np.mean(away**2))),
                "rms_deg": float(np.degrees(np.sqrt(np.mean(turn**2) / 2.0))),
            }
        )
    return rows


def _prepare(folder: Path) -> list[tuple[Array, Array]]:
    """Each scene's centres, (K, N, 3), and their covariances, (N, 3, 3)."""
    with np.load(folder / "rings.npz") as data:
        points = data["points"]
    covariances = [np.array([np.diag(np.square(ball)) for ball in s]) for s in SCENES.values()]
    return list(zip(points, covariances, strict=True))


def _hexafix(held: list[tuple[Array, Array]]) -> Array:
    layout, found = _layout(), []
    for points, covariances in held:
        for centers in points:
            pose = ring_pose(centers, layout, covariances_mm2=covariances).pose
            found.append(np.append(pose.rotation.ravel(), pose.position_mm))
    return np.array(found)


def _hexafix_batch(held: list[tuple[Array, Array]]) -> Array:
    found = []
    for points, covariances in held:
        rotation, position, _, _ = ring_poses(points, _layout(), covariances_mm2=covariances)
        found.append(np.concatenate([rotation.reshape(-1, 9), position], axis=1))
    return np.concatenate(found)


def _align(held: list[tuple[Array, Array]], *, weighted: bool) -> Array:
    """Rotation.align_vectors about the (weighted) middles, ring by ring."""
    from scipy.spatial.transform import Rotation

    places, found = _layout().points_mm, []
    for points, covariances in held:
        variance = np.trace(covariances, axis1=1, axis2=2) / 3.0 + INSTALLATION_SIGMA_MM**2
        weights = 1.0 / variance if weighted else np.ones(len(places))
        middle = np.average(places, axis=0, weights=weights)
        for centers in points:
            seen = np.average(centers, axis=0, weights=weights)
            turn, _ = Rotation.align_vectors(centers - seen, places - middle, weights=weights)
            matrix = turn.as_matrix()
            found.append(np.append(matrix.ravel(), seen - matrix @ middle))
    return np.array(found)


def _plain_kabsch(held: list[tuple[Array, Array]]) -> Array:
    """Kabsch by NumPy's batched singular values, every ball alike."""
    places, found = _layout().points_mm, []
    middle = places.mean(axis=0)
    for points, _ in held:
        seen = points.mean(axis=1)
        u, _, vt = np.linalg.svd(np.swapaxes(points - seen[:, None], 1, 2) @ (places - middle))
        u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
        rotation = u @ vt
        position = seen - rotation @ middle
        found.append(np.concatenate([rotation.reshape(-1, 9), position], axis=1))
    return np.concatenate(found)


def _tool(name: str, words: str, run: Callable[[Any], Array], against: str = "hexafix") -> Tool:
    scipy = (("scipy", "scipy"),) if name.startswith("align") else ()
    return Tool(name, words, against, run, np.asarray, _prepare, scipy)


TOOLS = (
    _tool("hexafix", "HexaFix: ring_pose", _hexafix),
    _tool("align", "scipy Rotation.align_vectors, unweighted", lambda h: _align(h, weighted=False)),
    _tool(
        "align-weighted",
        "scipy Rotation.align_vectors, a weight a ball",
        lambda h: _align(h, weighted=True),
    ),
    _tool("hexafix-batch", "HexaFix: ring_poses, all at once", _hexafix_batch, "hexafix-batch"),
    _tool("kabsch-batch", "NumPy: Kabsch, all at once", _plain_kabsch, "hexafix-batch"),
)
