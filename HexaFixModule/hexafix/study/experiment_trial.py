"""One pose of the simulated model experiment: what is drawn at random, and from what."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import Fault, InputError
from hexafix.geometry import Pose
from hexafix.hardware import MarkerLayout
from hexafix.phantom import PhantomSpec
from hexafix.phantom.make import check_buildable
from hexafix.phantom.scene import Scene, bone_in_ring_b, build_scene

Array = NDArray[np.float64]

BEFORE_MM = ((-12.87, 9.78), (-13.19, 16.80), (6.18, 20.75))
BEFORE_DEG = ((-7.41, 6.76), (-8.32, 4.54), (-2.43, 3.55))
"""Ranges of the bones' relative pose before reduction. Source: Table 2."""

MECHANISM_MM, MECHANISM_RAD = 0.0574, float(np.radians(0.0294))
"""Residual error of the calibrated mechanism, taken per axis. Source: Section 5.2."""

VOXEL_MM = 0.8
"""Edge of the cubic voxels; the paper prints no voxel size."""

FRAME_MM = (258.0, 258.0, 258.0)
"""Size of the scan around the frame's middle."""

STREAK_HU = 100.0
"""Amplitude of the metal's streaks."""

REDUCED_MM = 142.0
"""Distance of the rings with the bones reduced; the paper prints none. In the CT it is 13 mm more,
where the installation error alone gives the floor that the goals assume (`experiment_floor`)."""

TARGET_MM, TARGET_DEG = (4.0, 4.0, 4.0), 3.0
"""How far the reduced mechanism stands from straight; else all struts would end equally long, and
luck would decide how well their scale fits that one length."""

SWEEP_DEG = (0.0, 120.0, 240.0)
"""The paper's even three markers, t = 100 mm, h = 20 mm. Source: Section 4.3.1."""

FOURTH_DEG = (60.0, 220.0)
"""Sweep angle of the proximal and the distal ring's fourth ball, 25 mm above the others and clear
of the struts, whose surface would run into the ball's isosurface."""

TRIES = 200


@dataclass(frozen=True)
class ExperimentSettings:
    """How the experiment is run.

    Attributes
    ----------
    poses : int
        Poses with a rendered CT.
    drawn : int
        Poses of the larger run, image errors drawn from what the rendered CTs show.
    seed : int
    voxel_mm : float
        Edge of the CT's cubic voxels.
    jobs : int or None
        Poses worked on at once; None: one a core. The result does not depend on it.

    Raises
    ------
    InputError
        Fewer than two poses, a negative seed, no job, or voxels that hold no ball.
    """

    poses: int = 10
    drawn: int = 200
    seed: int = 1
    voxel_mm: float = VOXEL_MM
    jobs: int | None = None

    def __post_init__(self) -> None:
        faults = [
            Fault("bad-study", f"{name} is out of range", value=str(value), limit=limit)
            for name, value, good, limit in (
                ("poses", self.poses, self.poses >= 2, "2 or more"),
                ("drawn", self.drawn, self.drawn >= 2, "2 or more"),
                ("seed", self.seed, self.seed >= 0, "0 or more"),
                ("jobs", self.jobs, self.jobs is None or self.jobs >= 1, "1 or more"),
                ("voxel_mm", self.voxel_mm, 0.4 <= self.voxel_mm <= 2.0, "0.4 to 2"),
            )
            if not good
        ]
        if faults:
            raise InputError(*faults)


@dataclass(frozen=True, eq=False)
class Trial:
    """A random pose of mechanism, bones and image, with the errors that will act on it.

    Attributes
    ----------
    number : int
        From 1.
    spec : PhantomSpec
        Its `mechanism_pose` is where {A} truly stands on {B} in the CT.
    rings : tuple of Pose
        True {A} and {B} in LPS.
    installation_mm : ndarray, shape (2, 4, 3)
        Error of each ball's place, proximal ring first, along the ring's axes.
    bone : Pose
        The reduced bone's frame in {B}: origin in the fracture, z up the bone.
    mechanism_twists : ndarray, shape (2, 6)
        Error of the mechanism against its nominal pose ξ, in the CT and at the end; mm, rad.
    image_z : ndarray, shape (2, 4, 3)
        Standard normal numbers for the balls' image errors where no CT is rendered.
    """

    number: int
    spec: PhantomSpec
    rings: tuple[Pose, Pose]
    installation_mm: Array
    bone: Pose
    mechanism_twists: Array
    image_z: Array

    @property
    def layouts(self) -> tuple[MarkerLayout, MarkerLayout]:
        """Of the proximal and the distal ring, four balls each."""
        return self.spec.proximal, self.spec.distal


def four_balls(ring: int) -> MarkerLayout:
    """The paper's even ring with a fourth ball out of its plane; ring 0 proximal, 1 distal.

    The three even balls cannot number themselves: the fourth one does that, and makes N = 4.
    """
    return MarkerLayout.of(
        radius_mm=(100.0,) * 4,
        sweep_deg=(*SWEEP_DEG, FOURTH_DEG[ring]),
        height_mm=(20.0, 20.0, 20.0, 45.0),
        first_number=1 + 4 * ring,
    )


def draw_trial(settings: ExperimentSettings, number: int, *, rendered: bool) -> Trial:
    """Draw pose `number` of the run with CTs, or of the larger run without.

    Every pose has its own random stream, so that the order of work changes nothing.
    """
    rng = np.random.default_rng([settings.seed, number, 5 if rendered else 6])
    spec, scene = _buildable(rng, settings)
    rings = (scene.ring_a, scene.ring_b)
    true = np.array(list(scene.balls_mm.values())).reshape(2, 4, 3)
    places = np.array([spec.proximal.points_mm, spec.distal.points_mm])
    seen = np.array([ring.inverse().apply(balls) for ring, balls in zip(rings, true, strict=True)])
    sigma = np.array([MECHANISM_MM] * 3 + [MECHANISM_RAD] * 3)
    return Trial(
        number=number,
        spec=spec,
        rings=rings,
        installation_mm=seen - places,
        bone=bone_in_ring_b(spec),
        mechanism_twists=rng.normal(size=(2, 6)) * sigma,
        image_z=rng.normal(size=(2, 4, 3)),
    )


def _buildable(rng: np.random.Generator, settings: ExperimentSettings) -> tuple[PhantomSpec, Scene]:
    """The first drawn frame whose struts reach and whose balls are free and in the scan."""
    attempt = 0
    while True:
        spec = _drawn_spec(rng, settings)
        scene = build_scene(spec)
        attempt += 1
        try:
            check_buildable(spec, scene)
        except InputError:
            if attempt == TRIES:
                raise
            continue
        return spec, scene


def _drawn_spec(rng: np.random.Generator, settings: ExperimentSettings) -> PhantomSpec:
    """A bare frame on the table at a random place, the bones displaced as in Table 2."""
    tilt, turn = rng.uniform(-0.07, 0.07, 2), rng.uniform(-0.6, 0.6)
    voxel = settings.voxel_mm
    size = [int(np.ceil(length / voxel)) for length in FRAME_MM]
    spec = PhantomSpec(
        seed=int(rng.integers(2**31)),
        size_ijk=(size[0], size[1], size[2]),
        spacing_mm=(voxel, voxel, voxel),
        image_angles_rad=(
            float(rng.uniform(-0.07, 0.07)),
            float(rng.uniform(-0.07, 0.07)),
            float(rng.uniform(-0.07, 0.07)),
        ),
        ring_b_pose=Pose.from_xyz_fixed(
            position_mm=rng.uniform(-300.0, 300.0, 3),
            angles_rad=[tilt[0], tilt[1], -np.pi / 2.0 + turn],
        ),
        proximal=four_balls(0),
        distal=four_balls(1),
        streak_hu=STREAK_HU,
        limb=False,
        decoys=False,
    )
    target = Pose.from_xyz_fixed(
        position_mm=np.array([0.0, 0.0, REDUCED_MM]) + rng.uniform(-1.0, 1.0, 3) * TARGET_MM,
        angles_rad=np.radians(rng.uniform(-TARGET_DEG, TARGET_DEG, 3)),
    )
    spec = replace(spec, target_pose=target)
    bone = bone_in_ring_b(spec)
    low, high = np.array(BEFORE_MM).T
    low_rad, high_rad = np.radians(BEFORE_DEG).T
    displaced = Pose.from_xyz_fixed(
        position_mm=rng.uniform(low, high), angles_rad=rng.uniform(low_rad, high_rad)
    )
    return replace(spec, mechanism_pose=bone @ displaced @ bone.inverse() @ target)
