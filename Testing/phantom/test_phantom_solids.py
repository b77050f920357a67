"""Painted solids have the volume and the place that geometry gives them."""

import numpy as np
import pytest
from hexafix.geometry import Pose
from hexafix.hardware import Ring
from hexafix.phantom.balls import ExactBall, paint_ball
from hexafix.phantom.hardware import HOLE_RADIUS_MM, HOLES, PLATE_WIDTH_MM, plate
from hexafix.phantom.solids import (
    Solid,
    cylinder,
    ellipsoid,
    half_ball,
    hex_prism,
    paint,
    rod,
    slab_box,
)

POSE = Pose.from_xyz_fixed(position_mm=(0.4, -1.3, 0.8), angles_rad=(0.5, -0.4, 1.1))
ONE = ((0.0, 1.0),)


def painted(solid: Solid, grid, slices: int = 6) -> np.ndarray:
    i, j, k = grid.size_ijk
    image = np.zeros((k, j, i), np.float32)
    for first in range(0, k, slices):
        paint(image[first : first + slices], first, solid, grid)
    return image


@pytest.mark.parametrize(
    ("solid", "expected_mm3", "tolerance"),
    [
        (cylinder(POSE, -7.0, 5.0, 6.0, ONE), np.pi * 36 * 12, 0.01),
        (hex_prism(POSE, -4.0, 4.0, 12.0, 1.0), np.sqrt(3) / 2 * 144 * 8, 0.015),
        (ellipsoid(POSE, (6.0, 8.0, 7.0), 1.0), 4 / 3 * np.pi * 336, 0.02),
        (half_ball(POSE, 8.0, 1.0), 2 / 3 * np.pi * 512, 0.02),
        (slab_box(POSE, (5.0, 6.0, 7.0), ONE), 8 * 210, 0.01),
        (rod(np.array([-6.0, -5, -4]), np.array([6.0, 5, 4]), 8.0, 1.0), 16 * np.pi * 17.55, 0.02),
        (plate(POSE, Ring(np.zeros((6, 3)), 8.0, 40.0), 1.0), None, 0.03),
    ],
    ids=["cylinder", "hex", "ellipsoid", "dome", "box", "rod", "plate"],
)
def test_a_solid_has_its_volume(a_grid, solid, expected_mm3, tolerance) -> None:
    if expected_mm3 is None:
        # at 40 mm the holes of 36 would touch: their number is the frame's, so use a wide ring
        solid = plate(POSE, Ring(np.zeros((6, 3)), 8.0, 60.0), 1.0)
        area = np.pi * (60.0**2 - (60.0 - PLATE_WIDTH_MM) ** 2)
        expected_mm3 = 8.0 * (area - HOLES * np.pi * HOLE_RADIUS_MM**2)
        grid = a_grid((1.0, 1.0, 1.0), 64.0, sigma_mm=0.3)
    else:
        grid = a_grid((0.5, 0.6, 0.7), 16.0, (0.2, 0.1, -0.3), sigma_mm=0.4)
    mass = painted(solid, grid).sum() * np.prod(grid.spacing_mm)
    assert mass == pytest.approx(expected_mm3, rel=tolerance)


@pytest.mark.parametrize("slices", [1, 4, 50])
def test_slabs_do_not_show_in_the_image(a_grid, slices: int) -> None:
    grid = a_grid((0.8, 0.7, 0.9), 20.0, (0.3, 0.1, 0.2), thickness_mm=1.8)
    bar = rod(np.array([-15.0, -12, -14]), np.array([14.0, 9, 16]), 5.0, 1000.0)
    whole = painted(bar, grid, slices=1000)
    np.testing.assert_array_equal(painted(bar, grid, slices), whole)
    ball = ExactBall(np.array([1.0, 2.0, 3.0]), 5.0, 2300.0)
    parts, at_once = np.zeros_like(whole), np.zeros_like(whole)
    paint_ball(at_once, 0, ball, grid)
    for first in range(0, len(parts), slices):
        paint_ball(parts[first : first + slices], first, ball, grid)
    np.testing.assert_array_equal(parts, at_once)


def test_layers_lie_inside_one_another(a_grid) -> None:
    grid = a_grid((0.5, 0.5, 0.5), 14.0, sigma_mm=0.3)
    tube = cylinder(Pose.identity(), -10.0, 10.0, 9.0, ((0.0, 1000.0), (3.0, -500.0), (6.0, 40.0)))
    image = painted(tube, grid)
    middle = (np.array(grid.size_ijk) - 1) // 2

    def at(x: float) -> float:
        return float(image[middle[2], middle[1], middle[0] + round(x / 0.5)])

    assert at(0.0) == pytest.approx(40.0, abs=5)
    assert at(4.5) == pytest.approx(-500.0, abs=5)
    assert at(7.5) == pytest.approx(1000.0, abs=5)
    assert at(12.0) == 0.0


def test_thick_slices_smear_along_the_slice_normal_only(a_grid) -> None:
    wall = slab_box(Pose.identity(), (30.0, 30.0, 4.0), ((0.0, 1000.0),))
    column = slab_box(Pose.identity(), (4.0, 30.0, 30.0), ((0.0, 1000.0),))
    thin, thick = (a_grid((0.5, 0.5, 0.5), 8.0, thickness_mm=t) for t in (0.5, 4.0))
    middle = (np.array(thin.size_ijk) - 1) // 2

    def width(image: np.ndarray) -> float:
        edge = np.abs(np.gradient(image.astype(float)))[: len(image) // 2]
        place = np.arange(len(edge)) * 0.5
        mean = np.average(place, weights=edge)
        return float(np.sqrt(np.average((place - mean) ** 2, weights=edge)))

    down = [painted(wall, g)[:, middle[1], middle[0]] for g in (thin, thick)]
    across = [painted(column, g)[middle[2], middle[1], :] for g in (thin, thick)]
    assert width(down[1]) > 1.8 * width(down[0])
    assert width(across[1]) == pytest.approx(width(across[0]), rel=0.02)
