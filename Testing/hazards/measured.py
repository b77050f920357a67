"""Section 2 of the hazards, measured: a fault on the balls or readings, and which gates turn red.

Only points are moved; the search for balls is replaced by their places, all else is the chain.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

import numpy as np
from hexafix import gates
from hexafix.case import Case, case_from_document
from hexafix.errors import Refused
from hexafix.geometry import Pose
from hexafix.imaging import ImageSource, Volume
from hexafix.kinematics import strut_lengths
from hexafix.markers import Ball, BallSet
from hexafix.pipeline import plan_correction, recognise
from hexafix.pipeline.strut_witness import compare_struts
from hexafix.recognition.rigid import kabsch, rigid_rms_mm

LAYOUTS = {
    "105/120/135": (0.0, 105.0, 225.0),
    "70/125/165": (15.0, 85.0, 210.0),
    "even": (0.0, 120.0, 240.0),
    "105/130/125": (0.0, 105.0, 235.0),
    "60/100/200": (0.0, 60.0, 160.0),
}
"""Included angles of a ring's three balls, and where they stand."""


@dataclass(frozen=True)
class Frame:
    """A frame on a leg: rings 165 mm apart, balls at 80 mm, 12 mm above the plate.

    Attributes
    ----------
    proximal, distal : str
        Keys of `LAYOUTS`.
    raised : bool
        A fourth ball each ring, 25 mm above the others.
    """

    proximal: str = "105/120/135"
    distal: str = "70/125/165"
    raised: bool = False
    height_mm: float = 12.0
    bone: str = "tibia"

    def markers(self) -> dict[str, list[dict[str, float]]]:
        """The layouts as the case file has them, numbers 1.. proximal, then distal."""
        rings: dict[str, list[dict[str, float]]] = {}
        number = 0
        for ring in ("proximal", "distal"):
            sweeps = LAYOUTS[getattr(self, ring)]
            heights = [self.height_mm] * 3
            if self.raised:
                # a fourth place in the widest gap, off its middle
                sweeps, heights = (*sweeps, sweeps[2] + 52.0), [*heights, self.height_mm + 25.0]
            rings[ring] = []
            for sweep, height in zip(sweeps, heights, strict=True):
                number += 1
                site = {"number": number, "radius_mm": 80.0, "sweep_deg": sweep}
                rings[ring].append({**site, "height_mm": height})
        return rings

    @property
    def distal_pose(self) -> Pose:
        return _pose((12.0, -20.0, 340.0), (3.0, -4.0, 5.0))

    @property
    def mechanism(self) -> Pose:
        return _pose((2.0, -3.0, 165.0), (4.0, -6.0, 8.0))

    def balls_mm(self) -> np.ndarray:
        """Ball centres by number, LPS mm."""
        poses = {"proximal": self.distal_pose @ self.mechanism, "distal": self.distal_pose}
        rings = self.markers()
        return np.vstack([poses[ring].apply(points_of(rings[ring])) for ring in rings])

    def document(self) -> dict:
        """The case, its readings exact, a small correction."""
        case: dict = {
            "schema_version": 1,
            "case_id": "section-2",
            "limb": {"side": "left", "bone": self.bone},
            "image": {"path": "ct"},
            "fixator": "generic-6sps-160",
            "markers": {"ball_diameter_mm": 10.0, **self.markers()},
            "strut_readings_mm": [190.0] * 6,
            "correction": {"kind": "target-pose"},
            "schedule": {"start_date": "2026-12-01"},
        }
        case["correction"] |= {"position_mm": [0, 0, 168], "angles_deg": [2, -3, 4]}
        fixator = read(case).fixator
        case["strut_readings_mm"] = strut_lengths(self.mechanism, fixator).tolist()
        return case


def _pose(position_mm: tuple[float, ...], angles_deg: tuple[float, ...]) -> Pose:
    return Pose.from_xyz_fixed(position_mm=position_mm, angles_rad=np.radians(angles_deg))


def points_of(ring: list[dict[str, float]]) -> np.ndarray:
    t, phi, h = (np.array([m[k] for m in ring]) for k in ("radius_mm", "sweep_deg", "height_mm"))
    phi = np.radians(phi)
    return np.stack([t * np.cos(phi), t * np.sin(phi), h], axis=-1)


def read(document: dict) -> Case:
    """The case of a document; no image is asked for."""
    raw = json.dumps(document).encode()
    return case_from_document(raw, folder=Path(), needs_image=False)


@dataclass(frozen=True)
class Measured:
    """What the gates' figures are under a fault, numbers taken as given."""

    rms_mm: tuple[float, float]
    z_mm: float
    r11: float
    r33: float
    strut_mm: float
    error_mm: float
    error_deg: float
    red: frozenset[str]


def measure(document: dict, balls_mm: np.ndarray, true: Pose) -> Measured:
    """Figures of the gates with every ball under its given number."""
    case = read(document)
    count = len(case.proximal)
    poses, rms = [], []
    for points, layout in ((balls_mm[:count], case.proximal), (balls_mm[count:], case.distal)):
        rotation, position = kabsch(points_mm=points, layout_mm=layout.points_mm)
        poses.append(Pose(rotation, position))
        rms.append(float(rigid_rms_mm(points_mm=points, layout_mm=layout.points_mm)))
    proximal, distal = poses
    mechanism = distal.inverse() @ proximal
    assert case.strut_readings_mm is not None
    witness = compare_struts(mechanism, case.fixator, lengths_mm=case.strut_readings_mm)
    found = [
        gates.ring_rms("proximal", rms[0]),
        gates.ring_rms("distal", rms[1]),
        gates.moving_ring_above(mechanism),
        gates.rings_face_each_other(proximal, distal),
        gates.towards_the_head(case.limb.bone, proximal, distal),
        gates.struts_agree(witness.differences_mm, better_order=witness.better_order),
    ]
    away, turned = mechanism.difference(true)
    return Measured(
        rms_mm=(rms[0], rms[1]),
        z_mm=float(mechanism.position_mm[2]),
        r11=float(proximal.rotation[0, 0]),
        r33=float(proximal.rotation[2, 2]),
        strut_mm=float(np.max(np.abs(witness.differences_mm))),
        error_mm=away,
        error_deg=float(np.degrees(turned)),
        red=frozenset(g.gate for g in found if g is not None and not g.passed),
    )


def verdict(
    document: dict, balls_mm: np.ndarray, *, source: ImageSource | None = None
) -> list[tuple[str | None, str]]:
    """Hazards and codes with which the chain refuses these balls; empty if it plans."""
    ball = {"diameter_mm": 10.0, "covariance_mm2": np.eye(3) * 0.03**2}
    ball |= {"rms_residual_mm": 0.02, "core_hu": 2300.0, "method": "gradient-rays"}
    order = np.random.default_rng(5).permutation(len(balls_mm))
    seen = BallSet(tuple(Ball(center_mm=balls_mm[k], **ball) for k in order))
    volume = Volume(np.zeros((2, 2, 2), np.int16), np.eye(4), source or ImageSource())
    home = sys.modules[recognise.__module__]
    try:
        with mock.patch.object(home, "case_balls", return_value=seen):
            plan_correction(read(document), volume=volume)
    except Refused as error:
        return [(fault.hazard, fault.code) for fault in error.faults]
    return []


@dataclass(frozen=True)
class Fault:
    """A row of section 2.

    Attributes
    ----------
    name : str
    frame : Frame
    move : callable
        Ball centres by number, shape (M, 3), LPS mm, to where the fault puts them.
    order : tuple of int or None
        Ball that each number is given, of three or four a ring; None as it is.
    readings : callable
        Readings to what is entered.
    red : frozenset of str
        Gates that must turn red; every one of them.
    """

    name: str
    frame: Frame
    red: frozenset[str]
    move: Callable[[np.ndarray], np.ndarray] = lambda balls: balls
    order: tuple[int, ...] | None = None
    readings: Callable[[list[float]], list[float]] = field(default=lambda given: given)

    def case(self) -> dict:
        """The case as it is entered; wrong numbers are the user's."""
        document = self.frame.document()
        document["strut_readings_mm"] = self.readings(document["strut_readings_mm"])
        if self.order is not None:
            balls = self.numbered()
            numbering = {str(k + 1): place.tolist() for k, place in enumerate(balls)}
            document["numbering"] = numbering
        return document

    def numbered(self) -> np.ndarray:
        """Where the fault puts the ball that bears each number."""
        balls = self.move(self.frame.balls_mm())
        return balls if self.order is None else balls[list(self.order)]


def _mirror(axis: int) -> Callable[[np.ndarray], np.ndarray]:
    signs = np.where(np.arange(3) == axis, -1.0, 1.0)
    return lambda balls: balls * signs


def _scaled(*factors: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda balls: balls * np.array(factors)


def _sheared(balls: np.ndarray) -> np.ndarray:
    return balls + np.tan(np.radians(16.5)) * balls[:, 2:] * np.array([0.0, 1.0, 0.0])


def _slice_lost(balls: np.ndarray) -> np.ndarray:
    above = balls[:, 2:] > balls[:, 2].mean()
    return balls - 5.0 * above * np.array([0.0, 0.0, 1.0])


def _typo(given: list[float]) -> list[float]:
    return [given[0] + 10.0, *given[1:]]


def _exchanged(given: list[float]) -> list[float]:
    return [*given[:2], given[3], given[2], *given[4:]]


PLAIN, RAISED = Frame(), Frame(raised=True)
EVEN, NEARLY, WIDE = Frame("even"), Frame("105/130/125"), Frame("60/100/200")
SAME = Frame("105/120/135", "105/120/135")
SWAP_RINGS = (3, 4, 5, 0, 1, 2)

FAULTS = [
    *(
        Fault(f"mirror {'xyz'[k]}, 3 coplanar balls", PLAIN, frozenset(red), _mirror(k))
        for k, red in ((0, {"G4", "G5", "G6"}), (1, {"G4", "G5", "G6"}), (2, {"G4", "G5", "G6"}))
    ),
    *(
        Fault(
            f"mirror {'xyz'[k]}, rings taken by height, one shape",
            SAME,
            frozenset(red),
            _mirror(k),
            SWAP_RINGS,
        )
        for k, red in ((0, {"G5", "G6"}), (1, {"G5", "G6"}), (2, {"G6"}))
    ),
    *(
        Fault(
            f"mirror {'xyz'[k]}, 3 coplanar balls and 1 raised 25 mm",
            RAISED,
            frozenset({"G2", "G4", "G5", "G6"}),
            _mirror(k),
        )
        for k in range(3)
    ),
    Fault("gantry tilt 16.5 deg uncorrected", PLAIN, frozenset({"G2", "G6"}), _sheared),
    Fault("slice spacing 2.5 for 2.397", PLAIN, frozenset({"G6"}), _scaled(1, 1, 2.5 / 2.397)),
    Fault("one 5 mm slice lost", PLAIN, frozenset({"G6"}), _slice_lost),
    Fault("PixelSpacing +1 %", PLAIN, frozenset({"G2"}), _scaled(1.01, 1.01, 1)),
    Fault("rings exchanged, one shape", SAME, frozenset({"G4", "G5", "G6"}),
          order=SWAP_RINGS),
    Fault("numbers turned by one, even", EVEN, frozenset({"G6"}), order=(1, 2, 0, 3, 4, 5)),
    Fault("numbers turned by one, 105/130/125", NEARLY, frozenset({"G2", "G6"}),
          order=(1, 2, 0, 3, 4, 5)),
    Fault("two numbers exchanged, even", EVEN, frozenset({"G5", "G6"}), order=(1, 0, 2, 3, 4, 5)),
    Fault("two numbers exchanged, 105/130/125", NEARLY, frozenset({"G2", "G5", "G6"}),
          order=(1, 0, 2, 3, 4, 5)),
    Fault("two numbers exchanged, 60/100/200", WIDE, frozenset({"G2", "G5", "G6"}),
          order=(1, 0, 2, 3, 4, 5)),
    Fault("reading of strut 1 +10 mm", PLAIN, frozenset({"G6"}), readings=_typo),
    Fault("readings 3 and 4 exchanged", PLAIN, frozenset({"G6"}), readings=_exchanged),
    Fault("readings in reverse order", PLAIN, frozenset({"G6"}), readings=lambda g: g[::-1]),
]  # fmt: skip
"""The rows of section 2; the wrong assembly mode is kinematics' own (G8)."""


def table() -> str:
    """The rows as a Markdown table."""
    lines = [
        "| fault | RMS A / B, mm | z of A in B, mm | R11, R33 of A | struts, mm | pose error |"
        " red | the chain refuses with |",
        "|" + "---|" * 8,
    ]
    for fault in FAULTS:
        document = fault.case()
        m = measure(document, fault.numbered(), fault.frame.mechanism)
        codes = ", ".join(
            dict.fromkeys(f"`{code}`" for _, code in verdict(document, fault.numbered()))
        )
        lines.append(
            f"| {fault.name} | {m.rms_mm[0]:.2f} / {m.rms_mm[1]:.2f} | {m.z_mm:.0f} |"
            f" {m.r11:+.2f}, {m.r33:+.2f} | {m.strut_mm:.1f} |"
            f" {m.error_mm:.1f} mm, {m.error_deg:.1f} deg | {', '.join(sorted(m.red))} | {codes} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    import hazard_table

    path = hazard_table.TOP / hazard_table.DOCUMENT
    text = hazard_table.document(path.read_text("utf-8"), {"section 2": table()})
    path.write_text(text, "utf-8")
