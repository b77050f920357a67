"""What makes a start quick, and lets its other threads work meanwhile."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("vtkmodules", "slicer_core", "slicer_layer_dm")
"""In the order in which they need each other."""

SWITCH_S = 2e-4
"""How long a thread may keep the interpreter lock that another one wants, during a start."""


def link_libraries() -> None:
    """Bring the libraries of VTK and Slicer into memory, without the interpreter's lock.

    Two hundred shared libraries take a second and more. An import would hold the lock all that
    time, and the CT would not be read; it finds ready what was linked here. Where this cannot be
    done, nothing is lost but time.
    """
    if not sys.platform.startswith("linux"):
        return
    try:
        dlopen = ctypes.CDLL(None).dlopen
    except (OSError, AttributeError):
        return
    dlopen.restype = ctypes.c_void_p
    dlopen.argtypes = [ctypes.c_char_p, ctypes.c_int]
    for package in PACKAGES:
        for file in extension_files(package):
            dlopen(os.fsencode(file), os.RTLD_LAZY)


def extension_files(package: str) -> list[Path]:
    """The extension modules of an installed package, without importing it."""
    spec = None
    with suppress(ImportError, ValueError):
        spec = find_spec(package)
    folders = spec.submodule_search_locations if spec is not None else None
    found = (
        file
        for folder in folders or ()
        for file in Path(folder).glob("*.so")
        if file.name[:3] != "lib"
    )
    return sorted(found)


def hurry() -> Callable[[], None]:
    """Set the interpreter up for a start; what is returned takes it back.

    Thousands of modules' objects live to the end: looking for garbage among them costs a tenth of
    the start. And its threads wait for each other's lock all the time.
    """
    patience_s = sys.getswitchinterval()
    gc.disable()
    sys.setswitchinterval(SWITCH_S)

    def has_started() -> None:
        sys.setswitchinterval(patience_s)
        gc.freeze()
        gc.enable()

    return has_started
