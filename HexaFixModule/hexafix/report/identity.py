"""The patient's identity as an identified prescription prints it, on its pages and nowhere else."""

from __future__ import annotations

import re
import unicodedata
from datetime import date
from typing import TYPE_CHECKING

from hexafix.errors import InputError
from hexafix.paths import resources
from hexafix.report.patient import MONTHS

if TYPE_CHECKING:
    from hexafix.imaging.patient_identity import PatientIdentity, PatientName

NOT_STATED = "not stated"
LONGEST = 96
"""Characters that can be read in one line of the page's head; DICOM allows a name and an id 64."""

OTHER_SCRIPT = "(and in another script)"
"""Where the header has the name also in letters that no font of the prescription holds."""

# Control, format (bidirectional overrides, zero width), private, unassigned and surrogate
# characters, line and paragraph separators: invisible, or able to change what is read.
_HIDDEN = frozenset({"Cc", "Cf", "Co", "Cn", "Cs", "Zl", "Zp"})
_MOST_MARKS = 3
# Would read like a row of the patient's table.
_LIKE_A_ROW = re.compile(r"\d\s*of\s*\d")


def identity_content(identity: PatientIdentity) -> dict[str, str]:
    """Name, id, birth date and date of the CT, as words for the template.

    Raises
    ------
    InputError
        If the name is in no script that can be printed, or the id cannot be printed.
    """
    names = [visible(written(name)) for name in identity.names]
    printable = [name for name in names if _printable(name)]
    if names and not printable:
        raise _refused("no font of the prescription holds the letters of the patient's name")
    name = " / ".join(printable) or NOT_STATED
    patient_id = visible(identity.patient_id) or NOT_STATED
    if not _printable(patient_id):
        raise _refused("no font of the prescription holds the letters of the patient's id")
    for text in (name, patient_id):
        if len(text) > LONGEST:
            raise _refused("the patient's name or id is too long for a page's head")
        if _LIKE_A_ROW.search(text):
            raise _refused("the patient's name or id reads like a row of the table")
    if len(printable) < len(names):
        name += f" {OTHER_SCRIPT}"
    return {
        "name": name,
        "id": patient_id,
        "born": _day(identity.birth_date),
        "ct": _day(identity.study_date),
    }


def written(name: PatientName) -> str:
    """``Müller, Dr. Erika Maria, PhD``: family first, as on a clinic's labels."""
    rest = " ".join(filter(None, (name.prefix, name.given, name.middle)))
    return ", ".join(filter(None, (name.family, rest, name.suffix)))


def visible(text: str) -> str:
    """`text` on one line, every character that hides or reorders others as ``[U+202E]``."""
    shown, marks = [], 0
    for character in text:
        category = unicodedata.category(character)
        marks = marks + 1 if category in ("Mn", "Me") else 0
        if category in _HIDDEN or marks > _MOST_MARKS:
            shown.append(f"[U+{ord(character):04X}]")
        else:
            shown.append(" " if category == "Zs" else character)
    return " ".join("".join(shown).split())


def _day(day: date | None) -> str:
    return NOT_STATED if day is None else f"{day.day} {MONTHS[day.month - 1]} {day.year}"


def _printable(text: str) -> bool:
    """Whether the prescription's fonts hold every letter: typst refuses to drop one."""
    import typst

    folder = resources() / "Report"
    source = '#set document(title: "-")\n#set text(font: ("Roboto", "DejaVu Sans Mono"))\n'
    try:
        typst.compile(
            (source + "#sys.inputs.text").encode(),
            font_paths=typst.Fonts(include_system_fonts=False, font_paths=[str(folder / "fonts")]),
            sys_inputs={"text": text},
            pdf_standards=["a-3a", "ua-1"],
            format="pdf",
        )
    except typst.TypstError:
        return False
    return True


def _refused(what: str) -> InputError:
    return InputError.of(
        "identity-not-printable",
        what,
        where="--identified-pdf",
        next_step="plan without the option and write the patient's name on the paper",
        hazard="H38",
    )
