"""From files to one `Volume`: HU voxels with their place in the DICOM patient frame, LPS mm."""

from hexafix.imaging.dicom_series import SeriesSummary, list_series
from hexafix.imaging.reading import read_volume
from hexafix.imaging.volume import ImageSource, Volume

__all__ = ["ImageSource", "SeriesSummary", "Volume", "list_series", "read_volume"]
