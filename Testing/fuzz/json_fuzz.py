"""Case, layout and fixator JSON: spoiled in structure, values and bytes, and what must hold."""

from __future__ import annotations

import copy
import json
import math
import random
from pathlib import Path
from typing import Any

import numpy as np
from hexafix.case import case_from_document, load_layouts
from hexafix.hardware.definition import fixator_from_document, read_fixator, shipped_fixator
from hexafix.paths import resources
from hexafix.strict_json import parse_json_object

_STRANGE: list[Any] = [
    None, True, False, 0, -1, 1, 1e308, -1e308, 1e-308, 5e-324, 10**400, 2**63, "", " ", "1", "1.5",
    "190,2", "nan", "left", "proximal", "../../etc/passwd", "\0", "\u202e", "x" * 5000, [], {},
    [[]],
    [1, 2, 3], {"kind": "target-pose"}, 360.0, -360.0, 5000.0, 5000.1, 0.1 + 0.2,
]  # fmt: skip


def _markers() -> dict[str, Any]:
    ring = [(1, 0.0), (2, 105.0), (3, 225.0)], [(4, 15.0), (5, 110.0), (6, 250.0)]
    rows = [
        [{"number": n, "radius_mm": 100.0, "sweep_deg": phi, "height_mm": 20.0} for n, phi in part]
        for part in ring
    ]
    return {"ball_diameter_mm": 10.0, "proximal": rows[0], "distal": rows[1]}


def _case(correction: dict[str, Any], **changes: Any) -> dict[str, Any]:
    return {
        "schema_version": 1, "case_id": "left-tibia-01", "limb": {"side": "left", "bone": "tibia"},
        "image": {"path": "ct", "series_instance_uid": None}, "fixator": "generic-6sps-160",
        "markers": _markers(), "numbering": None, "strut_readings_mm": [190.2] * 6,
        "correction": correction,
        "schedule": {"start_date": "2026-12-01", "adjustments_per_day": 4, "strut_step_mm": 0.5,
                     "max_rate_mm_per_day": 1.0, "max_rate_deg_per_day": 1.0,
                     "compensation": "fused", "structures_at_risk_lps_mm": [[1.0, 2.0, 3.0]]},
        **changes,
    }  # fmt: skip


def json_seeds() -> dict[str, tuple[str, dict[str, Any]]]:
    """Name of the seed to its kind (``case``, ``layout``, ``fixator``) and content."""
    points = [[0.0, 0.0, 0.0], [50.0, 0.0, 1.0], [0.0, 40.0, 5.0]]
    turned = [[0.8, -0.6, 0.0, 5.0], [0.6, 0.8, 0.0, -3.0], [0, 0, 1, 1.0], [0, 0, 0, 1]]
    fixator = json.loads((resources() / "Hardware/Frames/generic-6sps-160.json").read_text())
    numbering = {str(n): [10.0 * n, 5.0, -3.0 * n] for n in range(1, 7)}
    return {
        "target-pose": ("case", _case({"kind": "target-pose", "position_mm": [0, 0, 185],
                                       "angles_deg": [1, 0, 0]})),
        "fragment-motion": ("case", _case({"kind": "fragment-motion", "moving": "distal",
                                           "matrix_lps": turned}, numbering=numbering)),
        "landmarks": ("case", _case({"kind": "landmarks", "moving": "proximal",
                                     "moving_points_lps_mm": points,
                                     "fixed_points_lps_mm": points}, fixator=fixator)),
        "deformity": ("case", _case({"kind": "deformity", "moving": "distal",
                                     "origin_lps_mm": [1.0, 2.0, 3.0], "ap_angulation_deg": 12.0,
                                     "ap_angulation": "varus", "axial_translation_mm": 10.0,
                                     "axial_translation": "short"})),
        "layout": ("layout", {"schema_version": 1, **_markers()}),
        "fixator": ("fixator", fixator),
    }  # fmt: skip


# spoiling ---------------------------------------------------------------------------------


def spoil(content: dict[str, Any], rng: random.Random, did: list[str]) -> bytes:
    """The bytes of a spoiled document."""
    content = copy.deepcopy(content)
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        if rng.random() < 0.85:
            _spoil_value(content, rng, did)
    text = json.dumps(content, ensure_ascii=rng.random() < 0.5)
    if rng.random() < 0.25:
        text = _spoil_text(text, rng, did)
    raw = text.encode("utf-8", "surrogatepass")
    if rng.random() < 0.15:
        did.append("bytes")
        data = bytearray(raw)
        for _ in range(rng.choice([1, 2, 8])):
            data[rng.randrange(len(data))] = rng.randrange(256)
        if rng.random() < 0.3:
            del data[rng.randrange(len(data)) :]
        raw = bytes(data)
    return raw


def _places(node: Any) -> list[tuple[Any, Any]]:
    """Every container and key within a document."""
    keys: Any = ()
    if isinstance(node, dict | list):
        keys = node.keys() if isinstance(node, dict) else range(len(node))
    return [place for key in keys for place in [(node, key), *_places(node[key])]]


def _spoil_value(content: dict[str, Any], rng: random.Random, did: list[str]) -> None:
    places = _places(content)
    if not places:
        return
    node, key = rng.choice(places)
    way = rng.choice(["strange", "strange", "drop", "add", "other", "number", "number", "number"])
    did.append(f"{way} {key}")
    if way == "strange":
        node[key] = copy.deepcopy(rng.choice(_STRANGE))
    elif way == "drop":
        del node[key]
    elif way == "add":
        if isinstance(node, dict):
            node[str(key) + rng.choice(["", "_", " ", "s"])] = rng.choice(_STRANGE)
        else:
            node.insert(key, copy.deepcopy(rng.choice([node[key], *_STRANGE])))
    elif way == "other":
        other, name = rng.choice(places)
        node[key] = copy.deepcopy(other[name])
    else:
        numbers = [(n, k) for n, k in places if isinstance(n[k], int | float) and abs(n[k]) < 1e300]
        if numbers:
            node, key = rng.choice(numbers)
            node[key] = rng.choice([
                node[key] * rng.choice([-1, 0, 0.1, 1.001, 10, 1e6]), node[key] + rng.gauss(0, 5),
                str(node[key]), int(node[key]) if abs(node[key]) < 1e9 else 7,
                rng.uniform(-400, 400),
            ])  # fmt: skip


def _spoil_text(text: str, rng: random.Random, did: list[str]) -> str:
    way = rng.choice(["nan", "key", "deep", "tail", "comment", "number", "mark"])
    did.append(f"text {way}")
    at = rng.randrange(len(text))
    if way == "nan":
        return text.replace("1.0", rng.choice(["NaN", "Infinity", "-Infinity", "1e999"]), 1)
    if way == "key":
        quote = text.find('"', at)
        pair = '"case_id": "x", ' if quote < 0 else '"number": 1, '
        brace = text.find("{", at)
        return text[: brace + 1] + pair + text[brace + 1 :]
    if way == "deep":
        return text[:at] + "[" * rng.choice([10, 2000, 200_000]) + text[at:]
    if way == "tail":
        return text + rng.choice(["{}", "x", "\0", " " * 1000])
    if way == "comment":
        return text[:at] + "/* */" + text[at:]
    if way == "mark":
        return "\ufeff" + text
    return text.replace("1", rng.choice(["0x1", "01", "1_0", "+1", "1.", "１", "9" * 6000]), 1)


# what must hold ---------------------------------------------------------------------------


def read(kind: str, raw: bytes, folder: Path) -> str | None:
    """Read spoiled bytes as HexaFix does, and say what is wrong with what was accepted.

    HexaFix's refusals pass through as exceptions.
    """
    if kind == "case":
        case = case_from_document(raw, folder=folder, needs_image=False, plannable=False)
        return _why_case_wrong(case, raw, folder)
    path = folder / f"{kind}.json"
    path.write_bytes(raw)
    if kind == "layout":
        rings = load_layouts(path)
        return _why_rings_wrong(*rings)
    fixator = read_fixator(path)
    again = fixator_from_document(parse_json_object(raw, what="definition", where="file"))
    same = np.array_equal(again.proximal.joints_mm, fixator.proximal.joints_mm)
    return _why_fixator_wrong(fixator) or (None if same else "another fixator when read again")


def _why_fixator_wrong(fixator) -> str | None:
    strut = fixator.strut
    rings = (fixator.proximal, fixator.distal)
    numbers = [strut.min_mm, strut.max_mm, strut.scale_offset_mm]
    numbers += [x for ring in rings for x in (ring.thickness_mm, ring.outer_radius_mm)]
    joints = [ring.joints_mm for ring in rings]
    if not np.isfinite(numbers).all() or not np.isfinite(joints).all():
        return "a fixator with numbers that are not finite"
    if not 0 < strut.min_mm < strut.max_mm or min(r.outer_radius_mm for r in rings) <= 0:
        return "a fixator with impossible lengths"
    return None if all(j.shape == (6, 3) for j in joints) else "a fixator without six joints"


def _why_rings_wrong(proximal, distal) -> str | None:
    sites = [*proximal.sites, *distal.sites]
    numbers = [site.number for site in sites]
    if len(set(numbers)) != len(numbers) or min(len(proximal), len(distal)) < 3:
        return "marker numbers twice, or fewer than three on a ring"
    for site in sites:
        values = (site.radius_mm, site.sweep_rad, site.height_mm)
        if not np.isfinite(values).all() or not 0 < site.radius_mm <= 5000:
            return "a marker that is nowhere"
        if abs(site.sweep_rad) > 2 * math.pi + 1e-9 or not isinstance(site.number, int):
            return "a marker with an impossible angle or number"
    return None


def _why_case_wrong(case, raw: bytes, folder: Path) -> str | None:
    given = json.loads(raw.decode())
    wrong = _why_fixator_wrong(case.fixator) or _why_rings_wrong(case.proximal, case.distal)
    if wrong:
        return wrong
    try:
        written = json.dumps(dict(case.document), allow_nan=False)
    except ValueError:
        return "a case that cannot be written again"
    if case.limb.side not in ("left", "right") or case.limb.side != given["limb"]["side"]:
        return "another side than given"
    if case.ball_diameter_mm != given["markers"]["ball_diameter_mm"]:
        return "another diameter than given"
    for site in (*case.proximal.sites, *case.distal.sites):
        rows = given["markers"]["proximal"] + given["markers"]["distal"]
        (row,) = [row for row in rows if row["number"] == site.number]
        if not math.isclose(math.degrees(site.sweep_rad), row["sweep_deg"], abs_tol=1e-9):
            return "another sweep angle than given"
    if case.strut_readings_mm is not None:
        strut = case.fixator.strut
        lengths = case.strut_readings_mm + strut.scale_offset_mm
        if case.strut_readings_mm.tolist() != given["strut_readings_mm"]:
            return "other readings than given"
        if not ((lengths >= strut.min_mm - 1e-9) & (lengths <= strut.max_mm + 1e-9)).all():
            return "readings outside the stroke"
    wrong = _why_schedule_wrong(case) or _why_correction_wrong(case)
    if wrong:
        return wrong
    document = json.loads(written)
    document["image"] = {"path": "x", "series_instance_uid": None}
    again = case_from_document(
        json.dumps(document).encode(), folder=folder, needs_image=False, plannable=False
    )
    same = dict(again.document) == dict(case.document)
    return None if same else "a case that reads differently when written again"


def _why_schedule_wrong(case) -> str | None:
    rules = case.schedule
    if rules is None:
        return None
    turn = math.degrees(rules.max_rate_rad_per_day)
    if not 0 < rules.max_rate_mm_per_day <= 3 or not 0 < turn <= 5.0001:
        return "a rate beyond the hard limit"
    if not 1 <= rules.adjustments_per_day <= 8 or not 0.01 <= rules.strut_step_mm <= 2:
        return "an impossible step"
    points = rules.structures_at_risk_mm
    if points is not None and (points.ndim != 2 or not np.isfinite(points).all()):
        return "a structure at risk that is nowhere"
    return None


def _why_correction_wrong(case) -> str | None:
    correction = case.correction
    poses = [getattr(correction, name) for name in ("pose", "motion") if hasattr(correction, name)]
    for pose in poses:
        matrix = pose.matrix
        turn = matrix[:3, :3]
        if not np.isfinite(matrix).all() or np.abs(turn @ turn.T - np.eye(3)).max() > 1e-6:
            return "a correction that is no rigid motion"
        if np.linalg.det(turn) < 0:
            return "a correction that mirrors"
    for name in ("moving_points_mm", "fixed_points_mm"):
        points = getattr(correction, name, None)
        if points is not None and (points.shape[1] != 3 or not np.isfinite(points).all()):
            return "landmarks that are nowhere"
    if hasattr(correction, "moving") and correction.moving not in ("proximal", "distal"):
        return "a fragment that does not exist"
    return None


def shipped() -> Any:
    """The fixator that the seeds name, read once so that its files are known to be good."""
    return shipped_fixator("generic-6sps-160")
