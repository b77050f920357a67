"""The libraries whose fault could change a prescription: their versions, and doubt in one (H54)."""

from __future__ import annotations

import platform
import sys
from importlib.metadata import PackageNotFoundError, version

from hexafix.errors import Fault

LIBRARIES = (
    *("numpy", "scipy", "pydicom", "SimpleITK", "vtk", "typst", "pypdfium2", "pydantic"),
    *("pylibjpeg", "pylibjpeg-libjpeg", "pylibjpeg-openjpeg", "pillow"),
)
"""What reads the image, computes and prints; the last four decode compressed DICOM."""

NOT_INSTALLED = "not installed"

NEXT_STEP = (
    "install the library versions that HexaFix names again, then run `hexafix selftest`; if it "
    "still fails, report it"
)


def version_of(name: str) -> str:
    """The version of the library that is loaded, else of the one that is installed."""
    loaded = getattr(sys.modules.get(name), "__version__", None)
    if isinstance(loaded, str):
        return loaded
    try:
        return version(name)
    except PackageNotFoundError:
        return NOT_INSTALLED


def versions() -> dict[str, str]:
    """Versions of Python and of all `LIBRARIES`."""
    return {"python": platform.python_version(), **{name: version_of(name) for name in LIBRARIES}}


def named(library: str) -> str:
    """The library, or several joined by " + ", with version."""
    first, *rest = (f"{name} {version_of(name)}" for name in library.split(" + "))
    return f"{first} with {', '.join(rest)}" if rest else first


def untrusted(check: str, library: str, *, expected: str, found: str) -> Fault:
    """The fault of a library that does not give a known answer.

    Parameters
    ----------
    check : str
        Name of the self-test's check.
    library : str
        The library most likely at fault, or several joined by " + ".
    expected, found : str
        The known answer, and what came instead.
    """
    return Fault(
        "self-test",
        f"self-test {check}: {named(library)} does not give the known answer here",
        value=found,
        limit=expected,
        next_step=NEXT_STEP,
        hazard="H54",
    )
