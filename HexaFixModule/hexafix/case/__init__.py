"""The case: everything the user says, read strictly, every fault named at once."""

from hexafix.case.case import Case, Limb, ScheduleRules
from hexafix.case.draft import CaseParts, partial_case, parts_of
from hexafix.case.read import (
    case_from_document,
    draft_faults,
    load_case,
    load_layouts,
    load_raw_case,
)
from hexafix.case.rings import Rings, load_rings
from hexafix.hardware.definition import shipped_fixator_names

__all__ = [
    "Case",
    "CaseParts",
    "Limb",
    "Rings",
    "ScheduleRules",
    "case_from_document",
    "draft_faults",
    "load_case",
    "load_layouts",
    "load_raw_case",
    "load_rings",
    "partial_case",
    "parts_of",
    "shipped_fixator_names",
]
