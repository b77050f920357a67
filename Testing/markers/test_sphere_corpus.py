"""Third-party sphere volumes, read where they lie beside the checkout, never committed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK
from hexafix.imaging import read_volume
from hexafix.markers import find_balls

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "ct-corpus" / "spheres_nrrd"


@pytest.mark.skipif(not FOLDER.is_dir(), reason="the third-party CT corpus is not here")
@pytest.mark.parametrize(
    ("name", "radius", "tolerance", "count"),
    [
        ("3mmFiducialTest", 3.0, 0.15, 15),
        ("4mmFiducialTest", 4.0, 0.10, 14),
        ("5mmFiducialTest", 5.0, 0.10, 15),
        ("10mmFiducialTest", 10.0, 0.10, 15),
    ],
)
def test_third_party_spheres_are_found_with_their_radius(name, radius, tolerance, count):
    volume = read_volume(FOLDER / f"{name}.nrrd")
    found = find_balls(volume, ball_diameter_mm=2.0 * radius)
    assert len(found.balls) == count
    for ball in found.balls:
        assert abs(0.5 * ball.diameter_mm - radius) <= tolerance
    # The 4 mm volume holds two spheres grown into one, which is reported, not averaged.
    assert len(found.balls) + len(found.rejected) == 15
    centroids = component_centroids(FOLDER / f"{name}.nrrd")
    apart = np.linalg.norm(found.centers_mm[:, None] - centroids[None], axis=-1)
    # A sphere's voxels have their centroid in its middle, to the roughness of a mask. Two spheres
    # that touch are one component: its centroid is the middle between the two balls found.
    nearest, part = apart.min(axis=1), apart.argmin(axis=1)
    pair = nearest > 0.15
    assert pair.sum() in {0, 2}
    assert len(set(part)) == count - pair.sum() // 2
    if pair.any():
        middle = found.centers_mm[pair].mean(axis=0)
        assert np.linalg.norm(middle - centroids[part[pair][0]]) < 0.25


def component_centroids(path):
    """Centroids of the connected masks by SimpleITK alone, LPS mm, shape (n, 3)."""
    image = SimpleITK.ReadImage(str(path))
    parts = SimpleITK.ConnectedComponent(image > 0.5)
    shapes = SimpleITK.LabelShapeStatisticsImageFilter()
    shapes.Execute(parts)
    return np.array([shapes.GetCentroid(label) for label in shapes.GetLabels()])
