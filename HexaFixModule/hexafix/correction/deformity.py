"""A correction from the six clinical parameters of a deformity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from hexafix.correction.fragment import FragmentMotion, Moving
from hexafix.errors import Fault, InputError
from hexafix.geometry import Pose

Side = Literal["left", "right"]

MAX_ANGLE_DEG = 60.0
"""Largest angle taken as a deformity parameter; more is a typing error."""

MAX_TRANSLATION_MM = 150.0
"""Largest translation taken as a deformity parameter."""

_WORDS = {
    "ap_angulation": ("varus", "valgus"),
    "lateral_angulation": ("apex-anterior", "apex-posterior"),
    "axial_rotation": ("internal", "external"),
    "ap_translation": ("medial", "lateral"),
    "lateral_translation": ("anterior", "posterior"),
    "axial_translation": ("short", "long"),
}


@dataclass(frozen=True, eq=False)
class Deformity:
    """The deformity that the moving fragment has; its correction is the inverse.

    Attributes
    ----------
    moving : {'proximal', 'distal'}
        Field practice: distal, with the proximal fragment as reference.
    origin_lps_mm : ndarray, shape (3,)
        The origin: a point of the reference fragment, LPS, mm, read-only. The moving fragment's
        corresponding point belongs there and lies displaced by the three translations.
    ap_angulation_deg : float
        Angle between the fragments' axes in the AP view, ≥ 0, degrees as in the case file.
    ap_angulation : {'varus', 'valgus', None}
    lateral_angulation_deg : float
        Angle between the fragments' axes in the lateral view.
    lateral_angulation : {'apex-anterior', 'apex-posterior', None}
    axial_rotation_deg : float
        Turn of the moving fragment about its axis.
    axial_rotation : {'internal', 'external', None}
    ap_translation_mm : float
        Displacement of the corresponding point in the AP view, ≥ 0.
    ap_translation : {'medial', 'lateral', None}
    lateral_translation_mm : float
    lateral_translation : {'anterior', 'posterior', None}
    axial_translation_mm : float
    axial_translation : {'short', 'long', None}
        Every sign stands in its word; a word may be None where the value is 0.

    Raises
    ------
    InputError
        For every value that is negative, absurd or without its word, all at once.

    Notes
    -----
    The anatomical axes are those of the patient frame LPS, so the limb must lie along the
    patient's long axis, patella (or palm) to the front: anterior −y, posterior +y, proximal +z,
    distal −z; lateral +x and medial −x on a left limb, the reverse on a right one.

    With u the direction from the origin along the moving fragment (−z distal, +z proximal):

    ===============  =========================================================================
    word             the moving fragment, against the reference
    ===============  =========================================================================
    varus            its far end (u) leans to medial, apex lateral
    valgus           its far end leans to lateral, apex medial
    apex-anterior    its far end leans to posterior (procurvatum)
    apex-posterior   its far end leans to anterior (recurvatum)
    internal         its anterior surface has turned towards medial
    external         its anterior surface has turned towards lateral
    medial, lateral, anterior, posterior
                     its corresponding point lies that way from the origin
    short            it has moved towards the reference fragment, −u
    long             it has moved away from it, +u
    ===============  =========================================================================

    The angulations are those seen in two orthogonal views: the axis u leans to
    u + tan(AP) e + tan(lateral) f, by the smallest turn S that does it. The deformity is
    D p = S A (p − o) + o + t with A the axial rotation about z; it took the moving fragment from
    where it belongs to where it is. The correction is M = D⁻¹.
    """

    moving: Moving
    origin_lps_mm: NDArray[np.float64]
    ap_angulation_deg: float = 0.0
    ap_angulation: Literal["varus", "valgus"] | None = None
    lateral_angulation_deg: float = 0.0
    lateral_angulation: Literal["apex-anterior", "apex-posterior"] | None = None
    axial_rotation_deg: float = 0.0
    axial_rotation: Literal["internal", "external"] | None = None
    ap_translation_mm: float = 0.0
    ap_translation: Literal["medial", "lateral"] | None = None
    lateral_translation_mm: float = 0.0
    lateral_translation: Literal["anterior", "posterior"] | None = None
    axial_translation_mm: float = 0.0
    axial_translation: Literal["short", "long"] | None = None

    def __post_init__(self) -> None:
        origin = np.array(self.origin_lps_mm, float)
        origin.setflags(write=False)
        object.__setattr__(self, "origin_lps_mm", origin)
        faults = [fault for name in _WORDS if (fault := _parameter_fault(self, name))]
        if origin.shape != (3,) or not np.all(np.isfinite(origin)):
            faults.append(
                _fault("origin_lps_mm", "three finite coordinates in LPS are needed", str(origin))
            )
        if self.moving not in ("proximal", "distal"):
            faults.append(_fault("moving", "the fragment is proximal or distal", self.moving))
        if faults:
            raise InputError(*faults)

    def translation_lps_mm(self, *, side: Side) -> NDArray[np.float64]:
        """Displacement t of the corresponding point from the origin, LPS, shape (3,), mm."""
        x = self._signed("ap_translation", "lateral") * _lateral(side)
        y = self._signed("lateral_translation", "posterior")
        z = self._signed("axial_translation", "long") * self._outward
        return np.array([x, y, z])

    def corresponding_point_lps_mm(self, *, side: Side) -> NDArray[np.float64]:
        """Where the moving fragment's point that belongs at the origin lies now, shape (3,)."""
        return self.origin_lps_mm + self.translation_lps_mm(side=side)

    def displacement(self, *, side: Side) -> Pose:
        """D in LPS: from where the moving fragment belongs to where it is."""
        tilt_x = np.radians(self._signed("ap_angulation", "valgus")) * _lateral(side)
        tilt_y = np.radians(self._signed("lateral_angulation", "apex-anterior"))
        lean = np.array([np.tan(tilt_x), np.tan(tilt_y), 0.0])
        size = float(np.linalg.norm(lean))
        # u × lean is the axis of the smallest turn from u to u + lean
        axis = np.cross([0.0, 0.0, self._outward], lean) / (size or 1.0)
        # external turns the front (−y) towards lateral: about +z on a left limb
        about_z = np.radians(self._signed("axial_rotation", "external")) * _lateral(side)
        turn = scipy.spatial.transform.Rotation.from_rotvec
        rotation = (turn(np.arctan(size) * axis) * turn([0.0, 0.0, about_z])).as_matrix()
        there = self.corresponding_point_lps_mm(side=side)
        return Pose(rotation, there - rotation @ self.origin_lps_mm)

    def correction(self, *, side: Side) -> FragmentMotion:
        """The motion M = D⁻¹ of the moving fragment that undoes the deformity."""
        return FragmentMotion(self.moving, self.displacement(side=side).inverse())

    @property
    def _outward(self) -> float:
        """Sign of z from the origin along the moving fragment."""
        return -1.0 if self.moving == "distal" else 1.0

    def _signed(self, name: str, positive: str) -> float:
        """Value of a parameter, positive for one of its two words."""
        value = float(getattr(self, _value_key(name)))
        return value if getattr(self, name) == positive else -value


def _lateral(side: Side) -> float:
    """Sign of x towards lateral in LPS."""
    if side not in ("left", "right"):
        raise InputError.of(
            "limb-side",
            "the limb's side is left or right",
            value=str(side),
            where="limb.side",
            hazard="H37",
        )
    return 1.0 if side == "left" else -1.0


def _value_key(name: str) -> str:
    return name + ("_mm" if name.endswith("translation") else "_deg")


def _fault(name: str, what: str, value: object = None, limit: str | None = None) -> Fault:
    return Fault(
        "deformity-parameter",
        what,
        value=None if value is None else str(value),
        limit=limit,
        where=f"correction.{name}",
        hazard="H42",
        next_step="enter the parameter again; the direction stands in the word, not in a sign",
    )


def _parameter_fault(deformity: Deformity, name: str) -> Fault | None:
    """What is wrong with one of the six parameters."""
    key, words = _value_key(name), _WORDS[name]
    value, word = float(getattr(deformity, key)), getattr(deformity, name)
    most, unit = (MAX_ANGLE_DEG, "degrees") if key.endswith("_deg") else (MAX_TRANSLATION_MM, "mm")
    if not 0.0 <= value <= most:
        what = "the amount is not plausible"
        return _fault(key, what, f"{value:g} {unit}", f"0 to {most:g} {unit}")
    if word not in words and not (word is None and value == 0.0):
        return _fault(name, f"the direction must be {words[0]} or {words[1]}", word)
    return None
