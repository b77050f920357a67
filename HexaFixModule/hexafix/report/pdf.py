"""The prescription as PDF/A-3a and PDF/UA-1, by typst."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from hexafix.errors import HexaFixError, InputError
from hexafix.paths import resources
from hexafix.report import figures, words
from hexafix.report.format import parse_date
from hexafix.report.identity import identity_content
from hexafix.report.patient import patient_content
from hexafix.report.picture import ScenePictures, draw_pictures
from hexafix.report.scene import SceneGeometry
from hexafix.report.surgeon import plan_fingerprint, surgeon_tables

if TYPE_CHECKING:
    from hexafix.imaging.patient_identity import PatientIdentity

LANGUAGES = ("en",)
"""Languages the prescription can be printed in."""


def _picture_content(scene: SceneGeometry, pictures: ScenePictures) -> dict[str, Any]:
    numbers = {
        ring: ", ".join(str(b.number) for b in scene.balls if b.ring == ring)
        for ring in ("proximal", "distal")
    }
    said = (
        f"proximal ring above with balls {numbers['proximal']}, distal ring below with balls "
        f"{numbers['distal']}, struts 1 to 6 between them"
    )
    return {
        "note": pictures.note,
        "views": {
            view.name: {"title": view.title, "svg": view.svg, "alt": f"{view.title}: {said}."}
            for view in pictures.views
        },
        "map": {
            "svg": figures.strut_map(scene),
            "alt": "The six numbered struts between the rings, seen from above.",
        },
    }


def _figure_content(document: Mapping[str, Any]) -> dict[str, Any]:
    roses = {
        ring: {
            "svg": figures.layout_rose(document, ring),
            "alt": f"Angles between the balls of the {ring} ring; the numbers stand in the table.",
        }
        for ring in ("proximal", "distal")
    }
    curves = {
        "svg": figures.strut_curves(document),
        "alt": "Scale value of each strut over the days, beside its stroke; first, last, smallest "
        "and largest values stand in the table.",
    }
    return {"roses": roses, "curves": curves}


def _warnings(document: Mapping[str, Any]) -> list[str]:
    """What the reader of the image and the search for balls want the surgeon to see."""
    balls = (
        f"Ball {ball['number']}: {warning}"
        for ball in document["balls"]
        for warning in ball.get("warnings") or ()
    )
    return [*(document["image"].get("warnings") or ()), *balls]


def prescription_content(
    document: Mapping[str, Any],
    *,
    pictures: ScenePictures | None = None,
    identity: PatientIdentity | None = None,
) -> dict[str, Any]:
    """All that the prescription shows, as strings; ``identity`` is null on a pseudonymous one."""
    plan = dict(document)
    scene = SceneGeometry.from_document(plan)
    if pictures is None:
        pictures = draw_pictures(scene, why="no rendered picture was made")
    limb = document["limb"]
    tables = surgeon_tables(plan)
    start = parse_date(document["schedule"]["start_date"])
    return {
        "case_id": document["case_id"],
        "limb": f"{limb['side']} {limb['bone']}".upper(),
        "approval": document["approval"].upper(),
        "notice": document["notice"],
        "fingerprint": plan_fingerprint(plan)[:16],
        "version": document["hexafix_version"],
        "date": [start.year, start.month, start.day],
        "patient": patient_content(plan),
        "tables": {name: table and table.as_strings() for name, table in tables.items()},
        "pictures": _picture_content(scene, pictures),
        "figures": _figure_content(plan),
        "warnings": _warnings(document),
        "conventions": words.FRAME_CONVENTIONS,
        "identity": None if identity is None else identity_content(identity),
        "handling": words.PSEUDONYMOUS if identity is None else words.IDENTIFIED,
    }


def prescription_pdf(
    document: Mapping[str, Any],
    *,
    pictures: ScenePictures | None = None,
    language: str = "en",
    identity: PatientIdentity | None = None,
) -> bytes:
    """The prescription for patient and surgeon.

    Parameters
    ----------
    document : mapping
        The finished plan, ``plan.json``.
    pictures : ScenePictures or None
        From `hexafix.report.start_scene_render`; without them rings, struts and balls are drawn
        by lines.
    language : str
        ``en``.
    identity : PatientIdentity, optional
        Printed at the head of each page, by the user's explicit choice only; title and other
        metadata stay pseudonymous.

    Returns
    -------
    bytes
        The same for the same input: all dates in the file are the schedule's first day.

    Raises
    ------
    InputError
        If a word cannot be printed, e.g. a case id with a character that no font holds (a PDF
        that silently drops it would name another case).
    """
    if language not in LANGUAGES:
        raise InputError.of(
            "language-unknown",
            "the prescription is not available in this language",
            value=language,
            limit=", ".join(LANGUAGES),
            next_step="choose one of these",
        )
    return _compile(prescription_content(document, pictures=pictures, identity=identity))


def _compile(content: dict[str, Any]) -> bytes:
    import typst

    year, month, day = content["date"]
    folder = resources() / "Report"
    try:
        return typst.compile(
            str(folder / "prescription.typ"),
            root=str(folder),
            font_paths=[str(folder / "fonts")],
            ignore_system_fonts=True,
            sys_inputs={"content": json.dumps(content, ensure_ascii=False)},
            pdf_standards=["a-3a", "ua-1"],
            timestamp=int(datetime(year, month, day, tzinfo=UTC).timestamp()),
            format="pdf",
        )
    except typst.TypstError as error:
        raise _explained(error, content) from error


def _explained(error: Exception, content: dict[str, Any]) -> HexaFixError:
    text = str(error).strip()
    if "could not be displayed" in text or "glyph" in text:
        return InputError.of(
            "character-not-printable",
            "a character cannot be printed: no font of the prescription holds it",
            value=next((line for line in text.splitlines() if line.strip()), text),
            limit="Latin, Greek and Cyrillic letters",
            where="case_id" if not content["case_id"].isascii() else None,
            next_step="use Latin letters and digits",
            hazard="H41",
        )
    return HexaFixError.of("pdf-failed", "the prescription could not be set", value=text)
