"""Third-party sphere volumes, read where they lie beside the checkout, never committed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK
from hexafix.imaging.volume import Volume
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
    image = SimpleITK.ReadImage(str(FOLDER / f"{name}.nrrd"))
    affine = np.eye(4)
    affine[:3, :3] = np.reshape(image.GetDirection(), (3, 3)) * np.array(image.GetSpacing())
    affine[:3, 3] = image.GetOrigin()
    found = find_balls(
        Volume(SimpleITK.GetArrayFromImage(image), affine), ball_diameter_mm=2.0 * radius
    )
    assert len(found.balls) == count
    for ball in found.balls:
        assert abs(0.5 * ball.diameter_mm - radius) <= tolerance
    # The 4 mm volume holds two spheres grown into one, which is reported, not averaged.
    assert len(found.balls) + len(found.rejected) == 15
