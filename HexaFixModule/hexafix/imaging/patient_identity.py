"""Who the patient of a series is: read only where the user asks for an identified prescription."""

from __future__ import annotations

import re
import unicodedata
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any, cast

from pydicom import dcmread
from pydicom.charset import convert_encodings, decode_bytes, python_encoding
from pydicom.tag import Tag
from pydicom.valuerep import TEXT_VR_DELIMS, PersonName

from hexafix.errors import HexaFixError, ImageRefused, InputError
from hexafix.imaging.dicom_series import choose, scan
from hexafix.imaging.image_path import require_path
from hexafix.imaging.itk_file import format_of
from hexafix.progress import Progress, silent

_TAGS = {
    keyword: Tag(keyword)
    for keyword in (
        *("SpecificCharacterSet", "PatientName", "PatientID", "PatientBirthDate", "StudyDate"),
    )
}
_OPTION = "--identified-pdf"
# Headers spell the standard's terms with hyphens and underscores in the wrong places.
_TERMS = {re.sub(r"[^A-Z0-9]", "", term): term for term in python_encoding}
_DATE = re.compile(r"(\d{4})\.?(\d{2})\.?(\d{2})")


@dataclass(frozen=True, slots=True)
class PatientName:
    """A person's name in one script.

    Attributes
    ----------
    family, given, middle, prefix, suffix : str
        The five components of VR PN (PS3.5, 6.2.1), empty where the header has none.
    """

    family: str = ""
    given: str = ""
    middle: str = ""
    prefix: str = ""
    suffix: str = ""


@dataclass(frozen=True, slots=True)
class PatientIdentity:
    """What an identified prescription prints. Never logged, never part of a plan.

    Attributes
    ----------
    names : tuple of PatientName
        The same name as the header has it: alphabetic, ideographic, phonetic.
    patient_id : str
        Empty where the header has none.
    birth_date, study_date : datetime.date or None
    """

    names: tuple[PatientName, ...]
    patient_id: str
    birth_date: date | None
    study_date: date | None

    def __repr__(self) -> str:
        """Without any value: a traceback must not name the patient."""
        return "PatientIdentity(...)"


def read_patient_identity(
    path: str | Path, *, series_instance_uid: str | None = None, progress: Progress = silent
) -> PatientIdentity:
    """The identity in the headers of the one series that would be read.

    Parameters
    ----------
    path : str or Path
        A DICOM folder or file.
    series_instance_uid : str, optional
    progress : Progress, optional

    Raises
    ------
    InputError
        If the image holds no identity, or one that cannot be read faithfully.
    ImageRefused
        If slices disagree on it (H38), or on which series is meant.
    """
    path = require_path(Path(path))
    if path.is_file() and format_of(path):
        raise _not_identified("this kind of image file holds no identity")
    chosen = choose(scan(path, progress), series_instance_uid)
    files = sorted({item.path for item in chosen})
    found: set[tuple[bytes, ...]] = set()
    for index, file in enumerate(files):
        if index % 32 == 0:
            progress("read the identity", index / len(files))
        found.add(_raw(file))
    progress("read the identity", 1.0)
    identities = {_decoded(values) for values in sorted(found)}
    if len(identities) > 1:
        raise ImageRefused.of(
            "mixed-patient",
            "the slices of the series disagree on the patient's identity or on the study's date",
            value=f"{len(identities)} identities",
            limit="1",
            next_step="export the series of one patient alone, from the archive",
            hazard="H38",
        )
    (identity,) = identities
    if not identity.names and not identity.patient_id:
        raise _not_identified("the headers name no patient")
    return identity


def _raw(file: Path) -> tuple[bytes, ...]:
    """The bytes of the identity in the order of `_TAGS`."""
    try:
        with warnings.catch_warnings():
            # pydicom quotes header values in its warnings, and those may name the patient.
            warnings.simplefilter("ignore")
            dataset = dcmread(file, stop_before_pixels=True, specific_tags=list(_TAGS.values()))
            values = [cast(Any, dataset.get_item(tag)) for tag in _TAGS.values()]
        return tuple(_bytes(None if item is None else item.value) for item in values)
    except (OSError, ValueError, TypeError, KeyError, AttributeError, IndexError):
        # The libraries' texts may quote what they could not read.
        raise _not_identified("a header cannot be read again") from None


def _bytes(value: Any) -> bytes:
    if isinstance(value, bytes):
        return value
    if value is None:
        return b""
    # Only the character set is converted by pydicom while it reads.
    return (value if isinstance(value, str) else "\\".join(map(str, value))).encode()


def _decoded(values: tuple[bytes, ...]) -> PatientIdentity:
    charset, name, patient_id, birth, study = values
    encodings = _encodings(charset, (name, patient_id))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        groups = cast(Any, PersonName)(name.strip(b" \0"), encodings).components
        text = decode_bytes(patient_id.strip(b" \0"), encodings, TEXT_VR_DELIMS)
    if "\ufffd" in "".join([*groups, text]):
        raise _not_identified("name or id do not follow the header's character set")
    return PatientIdentity(
        names=tuple(_name(group) for group in groups if group.strip(" ^")),
        patient_id=_clean(text),
        birth_date=_date(birth),
        study_date=_date(study),
    )


def _encodings(charset: bytes, texts: Iterable[bytes]) -> list[str]:
    """Python's codecs for a SpecificCharacterSet; nothing is guessed."""
    given = charset.decode("ascii", "replace").strip(" \0").upper()
    terms = [_TERMS.get(re.sub(r"[^A-Z0-9]", "", term)) for term in given.split("\\")]
    if None in terms:
        raise _not_identified("the header's character set is not one of the standard")
    if not given and not all(text.isascii() for text in texts):
        raise _not_identified("name or id are not ASCII, and the header states no character set")
    return convert_encodings([term or "" for term in terms])


def _name(group: str) -> PatientName:
    parts: Sequence[str] = [_clean(part) for part in group.split("^")]
    return PatientName(*(list(parts) + [""] * 5)[:5])


def _clean(text: str) -> str:
    return unicodedata.normalize("NFC", text).strip(" \0")


def _date(raw: bytes) -> date | None:
    text = raw.decode("ascii", "replace").strip(" \0")
    if not text:
        return None
    match = _DATE.fullmatch(text)
    try:
        return date(*map(int, match.groups())) if match else _wrong_date()
    except ValueError:
        return _wrong_date()


def _wrong_date() -> date:
    raise _not_identified("a date in the header is no date") from None


def _not_identified(what: str) -> HexaFixError:
    return InputError.of(
        "no-identity",
        f"an identified prescription is not possible: {what}",
        where=_OPTION,
        next_step="plan without the option and write the patient's name on the paper",
        hazard="H38",
    )
