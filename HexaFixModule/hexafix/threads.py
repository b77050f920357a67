"""How many threads HexaFix's own pools use, and what only one thread may use at a time.

The number is one setting, and no result depends on it (H57).
"""

from __future__ import annotations

import os
import threading

from hexafix.errors import InputError

VARIABLE = "HEXAFIX_THREADS"
"""Environment variable with the number of threads."""

PDFIUM = threading.RLock()
"""To be held while PDFium works: it knows no threads, and a workstation shows pages while the next
prescription is read back."""

DEFAULT = 2
MOST = 64


def thread_count(default: int = DEFAULT) -> int:
    """Threads of a pool: the environment's number, else `default`.

    Raises
    ------
    InputError
        If the variable does not hold a whole number from 1 to `MOST`.
    """
    text = os.environ.get(VARIABLE, "").strip()
    if not text:
        return default
    if not (text.isascii() and text.isdigit() and 1 <= int(text[:3]) <= MOST and len(text) < 4):
        raise InputError.of(
            "thread-count",
            "the number of threads is not a whole number in its range",
            value=text[:20],
            limit=f"1 to {MOST}",
            where=VARIABLE,
            next_step=f"set {VARIABLE} to such a number, or unset it",
        )
    return int(text)
