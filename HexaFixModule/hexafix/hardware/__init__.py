"""Fixators, rings, struts and marker layouts: values, and their JSON definitions."""

from hexafix.hardware.fixator import Fixator, Ring, StrutType
from hexafix.hardware.layout import MarkerLayout, MarkerSite

__all__ = ["Fixator", "MarkerLayout", "MarkerSite", "Ring", "StrutType"]
