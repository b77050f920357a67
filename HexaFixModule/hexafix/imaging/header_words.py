"""Code strings of a header that may be shown: a closed vocabulary.

Vendors and sites write free text into these attributes too, and free text may name a patient (H51).
"""

from __future__ import annotations

from collections.abc import Iterable

from pydicom.uid import AllTransferSyntaxes

OTHER = "other"
"""Stands for every word that is not known."""

_MODALITIES = frozenset(
    (
        *("CT", "MR", "PT", "NM", "CR", "DX", "RG", "XA", "XC", "RF", "US", "MG", "OT", "SC", "SR"),
        *("SEG", "RTSTRUCT", "RTPLAN", "RTDOSE", "RTIMAGE", "RTRECORD", "REG", "PR", "KO", "DOC"),
        *("ES", "SM", "IO", "PX", "BI", "BMD", "OPT", "OP", "FID", "PLAN", "IVUS", "ECG"),
    )
)
_IMAGE_TYPES = frozenset(
    (
        *("ORIGINAL", "DERIVED", "MIXED", "PRIMARY", "SECONDARY", "AXIAL", "LOCALIZER", "SCOUT"),
        *("TOPOGRAM", "SURVIEW", "VOLUME", "MPR", "REFORMATTED", "RESAMPLED", "AVERAGE"),
        *("MAX_IP", "MIN_IP", "MIP", "MINIP", "PROJECTION", "FILTERED", "ENERGY", "DYNAMIC"),
        *("MONOENERGETIC", "VIRTUAL_MONOENERGETIC", "PERFUSION", "FLUOROSCOPY", "STANDARD"),
        *("CONSTANT_ANGLE", "STATIONARY", "HELIX", "SPIRAL", "SEQUENCE", "SCREEN_SAVE", "NONE"),
    )
)


def shown_transfer_syntax(uid: str) -> str:
    """A transfer syntax that the standard knows; of any other only that it is private."""
    return uid if uid in AllTransferSyntaxes else "a private one"


def shown_modality(modality: str) -> str:
    """A modality of PS3.3 C.7.3.1.1.1, empty where the header has none, ``other`` for any other."""
    return modality if modality in _MODALITIES or not modality else OTHER


def shown_image_type(words: Iterable[str]) -> tuple[str, ...]:
    """The words of ImageType, each unknown one as ``other``."""
    return tuple(word if word in _IMAGE_TYPES else OTHER for word in words if word)
