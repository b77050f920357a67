"""What a phantom holds: every knob of the synthetic CT."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hexafix.errors import Fault, InputError
from hexafix.geometry import Pose
from hexafix.hardware import Fixator, MarkerLayout, shipped_fixator
from hexafix.phantom.posture import PATIENT_POSITIONS, SLICE_PLANES

CORRECTIONS = ("target-pose", "fragment-motion", "landmarks", "deformity")
INSTALLATION_SIGMA_MM = 0.4 / 6
"""Manufacturing tolerance of a marker per axis. Source: Section 4.2.1 (three-sigma rule)."""
AIR_HU = -1000.0
LOWEST_HU = -1024
ALUMINIUM_HU, CARBON_HU, STEEL_HU = 2300.0, 150.0, 8000.0
RING_HU = {"aluminium": ALUMINIUM_HU, "carbon": CARBON_HU}
STEEPEST_TILT_RAD = 0.6
"""No gantry leans further."""


def _pose(*numbers: float) -> Pose:
    """Pose of x, y, z in mm and α, β, γ in degrees."""
    return Pose.from_xyz_fixed(position_mm=numbers[:3], angles_rad=np.radians(numbers[3:]))


def _proximal() -> MarkerLayout:
    return MarkerLayout.of(
        radius_mm=(100.0,) * 4, sweep_deg=(0.0, 105.0, 225.0, 300.0), height_mm=(20, 20, 20, 45)
    )


def _distal() -> MarkerLayout:
    return MarkerLayout.of(
        radius_mm=(100.0,) * 4,
        sweep_deg=(20.0, 120.0, 240.0, 180.0),
        height_mm=(20, 20, 20, 45),
        first_number=5,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class PhantomSpec:
    """A synthetic CT: image, fixator, limb and imperfections. The same spec gives the same bytes.

    Attributes
    ----------
    seed : int
        Decides noise, installation errors and UIDs.
    size_ijk : tuple of int
        Number of voxels along i (columns), j (rows) and k (slices).
    spacing_mm : tuple of float
        Voxel pitch along i, j, k.
    slice_thickness_mm : float or None
        Width of the slice profile (box); None: the pitch along k.
    image_angles_rad : tuple of float
        X-Y-Z fixed angles of the axes i, j, k in LPS; a turn on top of what `patient_position`
        and `slice_plane` say.
    patient_position : str
        DICOM's PatientPosition, ``HFS`` to ``FFDL``; decides where the table is too.
    slice_plane : str
        ``axial`` as scanned, or reformatted ``coronal`` or ``sagittal``.
    slices_reversed : bool
        Whether the slices are stored against the direction of rows × columns.
    gantry_tilt_rad : float
        Slices turned about their rows while the table moves on straight, so that each is shifted
        against the one before; the pitch along k is that of the slice planes.
    image_center_mm : tuple of float or None
        LPS point in the middle of the volume; None: in the middle of the frame.
    fixator : Fixator
    ring_b_pose : Pose
        {B}, the distal ring, in LPS.
    mechanism_pose : Pose
        True pose of {A} in {B} while the CT was taken.
    target_pose : Pose
        {A} in {B} with the fracture reduced; its difference to `mechanism_pose` is the
        deformity, as each fragment is fixed to its ring.
    proximal, distal : MarkerLayout
        Nominal layouts on {A} and {B}; numbers must differ.
    ball_diameter_mm, ball_hu : float
        Marker balls; 2300 HU is aluminium, 8000 HU steel.
    rod_diameter_mm, rod_hu : float
        Resin connection rods; diameter 0: none.
    ring_material : str
        ``aluminium`` or ``carbon``.
    installation_sigma_mm : float
        Error of each ball's place on its ring, per axis.
    strut_reading_step_mm : float
        Readings are rounded to it; 0: exact.
    strut_typo : tuple (int, float) or None
        Strut 1 to 6 and the error added to its reading, mm.
    psf_sigma_mm : float
        Isotropic Gaussian blur.
    noise_hu, noise_correlation_mm : float
        Standard deviation, and length of a reconstruction kernel's correlation; 0: white.
    streak_hu : float
        Amplitude of dark and bright bands between metal parts; 0: none.
    clip_hu : int or None
        Largest HU the scanner stores; None: no limit but 16 bits.
    side, bone : str
        The limb in the case.
    limb, decoys, table : bool
        Whether they are there.
    fracture_gap_mm : float
        Bone missing between the fragments once reduced.
    correction : str
        The case's `correction.kind`.
    moving : str
        The fragment the correction moves, ``proximal`` or ``distal``.
    partial_frame : bool
        Whether balls may lie outside the volume (crops for tests); else they are refused.
    """

    seed: int = 0
    size_ijk: tuple[int, int, int] = (512, 512, 400)
    spacing_mm: tuple[float, float, float] = (0.65, 0.65, 0.7)
    slice_thickness_mm: float | None = None
    image_angles_rad: tuple[float, float, float] = (0.03, -0.02, 0.05)
    image_center_mm: tuple[float, float, float] | None = None
    patient_position: str = "HFS"
    slice_plane: str = "axial"
    slices_reversed: bool = False
    gantry_tilt_rad: float = 0.0
    fixator: Fixator = field(default_factory=shipped_fixator)
    ring_b_pose: Pose = field(default_factory=lambda: _pose(31.7, -212.4, 846.3, 2.5, -3.5, -84.0))
    mechanism_pose: Pose = field(default_factory=lambda: _pose(6.5, -5.2, 180.5, 4.0, -5.5, 6.0))
    target_pose: Pose = field(default_factory=lambda: _pose(0.0, 0.0, 178.0, 0.0, 0.0, 0.0))
    proximal: MarkerLayout = field(default_factory=_proximal)
    distal: MarkerLayout = field(default_factory=_distal)
    ball_diameter_mm: float = 10.0
    ball_hu: float = ALUMINIUM_HU
    rod_diameter_mm: float = 5.0
    rod_hu: float = 120.0
    ring_material: str = "aluminium"
    installation_sigma_mm: float = INSTALLATION_SIGMA_MM
    strut_reading_step_mm: float = 0.5
    strut_typo: tuple[int, float] | None = None
    psf_sigma_mm: float = 0.5
    noise_hu: float = 30.0
    noise_correlation_mm: float = 0.6
    streak_hu: float = 0.0
    clip_hu: int | None = 3071
    side: str = "left"
    bone: str = "tibia"
    limb: bool = True
    decoys: bool = True
    table: bool = True
    fracture_gap_mm: float = 1.0
    correction: str = "target-pose"
    moving: str = "proximal"
    partial_frame: bool = False

    def __post_init__(self) -> None:
        faults = [Fault("phantom-spec", *fault) for fault in _faults(self)]
        if faults:
            raise InputError(*faults)

    @property
    def thickness_mm(self) -> float:
        """Width of the slice profile, mm."""
        return self.spacing_mm[2] if self.slice_thickness_mm is None else self.slice_thickness_mm


def _faults(spec: PhantomSpec) -> list[tuple[str, str, str]]:
    """What is wrong with the knobs: what, value, limit."""
    found = []
    words = {
        "ring_material": tuple(RING_HU),
        "correction": CORRECTIONS,
        "moving": ("proximal", "distal"),
        "side": ("left", "right"),
        "patient_position": PATIENT_POSITIONS,
        "slice_plane": SLICE_PLANES,
    }
    for name, allowed in words.items():
        if getattr(spec, name) not in allowed:
            found.append((f"{name} is unknown", repr(getattr(spec, name)), ", ".join(allowed)))
    positive = ("ball_diameter_mm", "psf_sigma_mm", "thickness_mm")
    for name in positive:
        if not 0.0 < getattr(spec, name) < 1e3:
            found.append((f"{name} is out of range", str(getattr(spec, name)), "> 0"))
    for name in ("rod_diameter_mm", "installation_sigma_mm", "strut_reading_step_mm", "noise_hu"):
        if not 0.0 <= getattr(spec, name) < 1e4:
            found.append((f"{name} is out of range", str(getattr(spec, name)), "≥ 0"))
    for name in ("noise_correlation_mm", "streak_hu", "fracture_gap_mm"):
        if not 0.0 <= getattr(spec, name) < 1e4:
            found.append((f"{name} is out of range", str(getattr(spec, name)), "≥ 0"))
    if len(spec.size_ijk) != 3 or min(spec.size_ijk) < 1 or max(spec.size_ijk) > 4096:
        found.append(("size_ijk is out of range", str(spec.size_ijk), "three of 1 to 4096"))
    if len(spec.spacing_mm) != 3 or not all(0.05 <= s <= 20.0 for s in spec.spacing_mm):
        found.append(("spacing_mm is out of range", str(spec.spacing_mm), "three of 0.05 to 20"))
    if spec.clip_hu is not None and not 0 < spec.clip_hu <= 31743:
        found.append(("clip_hu is out of range", str(spec.clip_hu), "1 to 31743"))
    if spec.strut_typo is not None and spec.strut_typo[0] not in range(1, 7):
        found.append(("strut_typo names no strut", str(spec.strut_typo[0]), "1 to 6"))
    if set(spec.proximal.numbers) & set(spec.distal.numbers):
        found.append(("a ball number is on both rings", "numbers", "each number once"))
    if not abs(spec.gantry_tilt_rad) <= STEEPEST_TILT_RAD:
        value = f"{np.degrees(spec.gantry_tilt_rad):.1f} deg"
        found.append(("the gantry leans too far", value, f"{np.degrees(STEEPEST_TILT_RAD):.1f}"))
    if spec.gantry_tilt_rad and spec.slice_plane != "axial":
        found.append(("a reformatted stack has no gantry tilt", spec.slice_plane, "axial"))
    if spec.seed < 0:
        found.append(("seed is negative", str(spec.seed), "≥ 0"))
    return found
