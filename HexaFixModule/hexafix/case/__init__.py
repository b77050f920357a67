"""The case: everything the user says, read strictly, every fault named at once."""

from hexafix.case.case import Case, Limb, ScheduleRules
from hexafix.case.read import case_from_document, load_case, load_layouts
from hexafix.case.rings import Rings, load_rings

__all__ = [
    "Case",
    "Limb",
    "Rings",
    "ScheduleRules",
    "case_from_document",
    "load_case",
    "load_layouts",
    "load_rings",
]
