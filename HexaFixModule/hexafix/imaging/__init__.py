"""From files to one `Volume`: HU voxels with their place in the DICOM patient frame, LPS mm.

The readers come into memory when they are first used: pydicom takes half a second to import, which
neither the command line's help nor a child process that only needs ITK should pay.
"""

from typing import TYPE_CHECKING, Any

from hexafix.imaging.volume import ImageSource, Volume

if TYPE_CHECKING:
    from hexafix.imaging.dicom_series import SeriesSummary, list_series
    from hexafix.imaging.reading import read_volume

__all__ = ["ImageSource", "SeriesSummary", "Volume", "list_series", "read_volume"]

_HOMES = {
    "SeriesSummary": "dicom_series",
    "list_series": "dicom_series",
    "read_volume": "reading",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
