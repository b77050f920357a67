"""Typed numbers, strictly: no locale, no comma, no unit, nothing guessed (H26)."""

from __future__ import annotations

import html
import re
from collections.abc import Mapping, Sequence
from typing import Any

from hexafix.errors import Fault, InputError

NUMBER = re.compile(r"[+-]?[0-9]{1,6}(\.[0-9]{1,15})?")


def number_of(text: str, name: str) -> float:
    """The number that `text` holds.

    Parameters
    ----------
    text : str
        Digits with a decimal point; a true minus sign is taken as a minus.
    name : str
        What the number is, for the message.

    Raises
    ------
    InputError
        For anything else, empty text too.
    """
    plain = text.strip().replace("\N{MINUS SIGN}", "-")
    if not NUMBER.fullmatch(plain):
        raise InputError(_not_a_number(text.strip(), name))
    return float(plain)


def whole_of(text: str, name: str) -> int:
    """The whole number that `text` holds."""
    if not re.fullmatch(r"[0-9]{1,4}", text.strip()):
        raise InputError(_not_a_number(text.strip(), name, kind="whole number"))
    return int(text)


def maybe_number_of(text: str, name: str) -> float | None:
    """The number, or None for an empty field."""
    return number_of(text, name) if text.strip() else None


def numbers_of(texts: Sequence[str], name: str) -> list[float]:
    """Several numbers, none missing."""
    return [number_of(text, name) for text in texts]


def _not_a_number(text: str, name: str, kind: str = "number") -> Fault:
    return Fault(
        "not-a-number",
        f"{name} is not a plain {kind}" if text else f"{name} is missing",
        value=repr(text) if text else None,
        next_step="type digits with a decimal point, without unit: 12.5",
        hazard="H26",
    )


def text_of(value: Any) -> str:
    """A number of the document as typed: the shortest text that gives it back."""
    if value is None:
        return ""
    if isinstance(value, float):
        plain = f"{value:.15f}".rstrip("0").rstrip(".")
        short = repr(value)
        return plain if "e" in short else short.removesuffix(".0")
    return str(value)


def rounded(value: float, digits: int = 3) -> str:
    """A computed number for a field."""
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def at(document: Mapping[str, Any], *keys: str) -> Any:
    """The value under nested keys, or None where one is missing."""
    value: Any = document
    for key in keys:
        if not isinstance(value, Mapping) or key not in value:
            return None
        value = value[key]
    return value


def escaped(text: str) -> str:
    """Text that a label shows as it is."""
    return html.escape(text)
