import dataclasses

import numpy as np
import pytest
from hexafix.geometry import Pose
from hexafix.phantom import Phantom, PhantomSpec, make_phantom
from hexafix.phantom.scene import build_scene
from hexafix.phantom.solids import Grid


@pytest.fixture(scope="session")
def a_coarse_spec() -> PhantomSpec:
    """The whole frame in few voxels: oblique, anisotropic, off-origin, streaks."""
    return PhantomSpec(
        seed=11,
        size_ijk=(124, 126, 98),
        spacing_mm=(2.6, 2.5, 2.9),
        image_angles_rad=(0.09, -0.06, 0.11),
        psf_sigma_mm=1.0,
        streak_hu=150.0,
    )


@pytest.fixture(scope="session")
def a_coarse_phantom(a_coarse_spec: PhantomSpec) -> Phantom:
    return make_phantom(a_coarse_spec, workers=3)


@pytest.fixture
def a_crop():
    """Makes the spec of a small noise-free volume around one ball."""

    def build(number: int, half_mm: float = 9.0, **knobs) -> PhantomSpec:
        bare = {
            "noise_hu": 0.0,
            "limb": False,
            "decoys": False,
            "table": False,
            "partial_frame": True,
            "image_angles_rad": (0.4, -0.7, 2.1),
        }
        spec = PhantomSpec(**(bare | knobs))
        center = build_scene(spec).balls_mm[number] + np.array([0.21, -0.17, 0.13])
        size = tuple(int(np.ceil(2 * half_mm / s)) for s in spec.spacing_mm)
        return dataclasses.replace(spec, size_ijk=size, image_center_mm=tuple(center))

    return build


@pytest.fixture
def a_grid():
    """Makes a small grid of voxels around the origin, turned by three angles."""

    def build(
        spacing: tuple[float, float, float],
        half_mm: float,
        angles_rad: tuple[float, float, float] = (0.0, 0.0, 0.0),
        thickness_mm: float | None = None,
        sigma_mm: float = 0.5,
    ) -> Grid:
        size = tuple(int(2 * np.ceil(half_mm / s)) + 1 for s in spacing)
        pose = Pose.from_xyz_fixed(position_mm=(0, 0, 0), angles_rad=angles_rad)
        affine = np.eye(4)
        affine[:3, :3] = pose.rotation * np.array(spacing)
        affine[:3, 3] = -affine[:3, :3] @ ((np.array(size) - 1) / 2.0)
        return Grid(affine, size, thickness_mm or spacing[2], sigma_mm)

    return build
