"""Fixators, rings, struts and marker layouts: values, and their JSON definitions."""

from hexafix.hardware.definition import (
    fixator_from_document,
    read_fixator,
    shipped_fixator,
    shipped_fixator_names,
    shipped_fixators,
)
from hexafix.hardware.fixator import Fixator, Ring, StrutType
from hexafix.hardware.holes import HoleCircle, Places, SiteList, places_from_document
from hexafix.hardware.layout import MarkerLayout, MarkerSite

__all__ = [
    "Fixator",
    "HoleCircle",
    "MarkerLayout",
    "MarkerSite",
    "Places",
    "Ring",
    "SiteList",
    "StrutType",
    "fixator_from_document",
    "places_from_document",
    "read_fixator",
    "shipped_fixator",
    "shipped_fixator_names",
    "shipped_fixators",
]
