"""SimpleITK's own reading of one image file; runs in the child process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def load_with_itk(path: Path, reader: str) -> tuple[dict[str, Any], NDArray]:
    """Voxels and what SimpleITK says about them.

    Parameters
    ----------
    path : Path
    reader : str
        Name of ITK's ImageIO.

    Returns
    -------
    about : dict
        ``affine`` (4 x 4, voxel to LPS as SimpleITK sees it), ``dimension``, ``components`` and
        ``warnings``, the number of texts that ITK wanted to be seen.
    voxels : ndarray, shape (K, J, I) for a volume
    """
    import SimpleITK as sitk  # noqa: N813  slow to import, and only the child needs it

    heard: list[str] = []

    class Listener(sitk.LoggerBase):
        def DisplayText(self, t: str) -> None:  # noqa: N802
            heard.append(t)

        DisplayErrorText = DisplayWarningText = DisplayText
        DisplayGenericOutputText = DisplayDebugText = DisplayText

    listener = Listener()
    before: Any = listener.SetAsGlobalITKLogger()
    try:
        source = sitk.ImageFileReader()
        source.SetImageIO(reader)
        source.SetFileName(str(path))
        image = source.Execute()
    finally:
        before.SetAsGlobalITKLogger()
    about: dict[str, Any] = {
        "dimension": image.GetDimension(),
        "components": image.GetNumberOfComponentsPerPixel(),
        "warnings": len(heard),
    }
    if image.GetDimension() == 3:
        affine = np.eye(4)
        affine[:3, :3] = np.reshape(image.GetDirection(), (3, 3)) * np.array(image.GetSpacing())
        affine[:3, 3] = image.GetOrigin()
        about["affine"] = affine.tolist()
    return about, sitk.GetArrayFromImage(image)
