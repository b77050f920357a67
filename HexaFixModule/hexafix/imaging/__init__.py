"""From files to one `Volume`: HU voxels with their place in the DICOM patient frame, LPS mm."""

from hexafix.imaging.volume import ImageSource, Volume

__all__ = ["ImageSource", "Volume"]
