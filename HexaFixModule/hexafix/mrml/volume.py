"""A CT as a volume node and back, exactly; where it came from stays with it as long as it is true.

A volume node holds one number a voxel and the matrix from voxel indices to RAS. Attributes keep
what the reader knew, under a hash of voxels and geometry: as soon as one of them is changed by
whomever, what the reader said is no longer believed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import Fault, ImageRefused, InputError
from hexafix.imaging.file_geometry import FileGeometry, corners_mm, faults_of_grid
from hexafix.imaging.fingerprint import fingerprint
from hexafix.imaging.volume import Acquisition, ImageSource, Volume
from hexafix.mrml.geometry import FLIP, array4, vtk4
from hexafix.mrml.nodes import NAME, PREFIX, ROLE, nodes_of, slicer_core
from hexafix.strict_json import parse_json_object

CONTENT = f"{PREFIX}content_sha256"
AFFINE = f"{PREFIX}ijk_to_lps"
SOURCE = f"{PREFIX}source"

KINDS = ("dicom", "nrrd", "nifti", "metaimage", "memory")
"""Where a CT can have come from."""

SAME_PLACE_MM = 1e-6
"""A matrix rounded by a file's text moves no corner further than this."""

WINDOW_HU, LEVEL_HU = 2500.0, 900.0
"""Shows soft tissue dark, bone grey and metal white."""

VOLUME_ROLE, NAME_OF_VOLUME = "volume", "CT"

CHANGED = (
    "the volume was changed in the scene after it was read; what the reader checked and warned of "
    "no longer holds"
)
FOREIGN = (
    "the volume was not read by HexaFix: slice distances and gantry tilt of its files were not "
    "checked"
)


def add_volume(scene: Any, volume: Volume, name: str = NAME_OF_VOLUME) -> Any:
    """A new scalar volume node with the voxels of `volume`.

    Parameters
    ----------
    scene : vtkMRMLScene
    volume : Volume
        HU, [k, j, i], with its affine to LPS mm.
    name : str
        Shown to the user; it must not name the patient.
    """
    from vtkmodules.util.numpy_support import get_vtk_array_type, numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData

    image = vtkImageData()
    image.SetDimensions(*volume.size_ijk)
    flat = np.ascontiguousarray(volume.voxels).ravel()
    scalars = numpy_to_vtk(flat, deep=True, array_type=get_vtk_array_type(flat.dtype))
    image.GetPointData().SetScalars(scalars)
    node = slicer_core().vtkMRMLScalarVolumeNode()
    node.SetName(name)
    node.SetAttribute(ROLE, VOLUME_ROLE)
    node.SetAttribute(NAME, NAME_OF_VOLUME)
    node.SetIJKToRASMatrix(vtk4(FLIP @ volume.ijk_to_lps))
    node.SetAndObserveImageData(image)
    node.SetAttribute(AFFINE, json.dumps(volume.ijk_to_lps.tolist()))
    node.SetAttribute(SOURCE, json.dumps(_source_document(volume.source)))
    node.SetAttribute(CONTENT, fingerprint(volume.voxels, volume.ijk_to_lps))
    scene.AddNode(node)
    _show_grey(scene, node)
    return node


def _show_grey(scene: Any, node: Any) -> None:
    """A display node of our own window: the default one counts all voxels first, for a second."""
    display = slicer_core().vtkMRMLScalarVolumeDisplayNode()
    display.AutoWindowLevelOff()
    display.SetWindowLevel(WINDOW_HU, LEVEL_HU)
    display.SetAndObserveColorNodeID("vtkMRMLColorTableNodeGrey")
    scene.AddNode(display)
    node.SetAndObserveDisplayNodeID(display.GetID())


def adopt(scene: Any, node: Any) -> None:
    """Make a volume of somebody else ours, to be saved in a bundle; its doubts stay with it."""
    if node.GetAttribute(ROLE) == VOLUME_ROLE:
        return
    for other in nodes_of(scene, VOLUME_ROLE):
        other.RemoveAttribute(ROLE)
    node.SetAttribute(ROLE, VOLUME_ROLE)
    node.SetAttribute(NAME, NAME_OF_VOLUME)
    node.SetAttribute(AFFINE, json.dumps((FLIP @ _index_matrix(node)).tolist()))


def set_window(node: Any, *, window_hu: float, level_hu: float) -> None:
    """Show the grey values from level - window/2 to level + window/2, HU."""
    display = node.GetDisplayNode()
    display.AutoWindowLevelOff()
    display.SetWindowLevel(window_hu, level_hu)


def volume_of(node: Any) -> Volume:
    """The volume of a scalar volume node, with its own copy of the voxels.

    Raises
    ------
    ImageRefused
        If the node holds no CT of one finite number a voxel on a rectangular grid, or stands
        under a transform (H36).
    """
    _require_scalar(node)
    voxels = _voxels(node)
    affine = FLIP @ _index_matrix(node)
    faults = faults_of_grid(FileGeometry(_size(voxels), affine), "volume node")
    if not faults and not np.all(np.isfinite(voxels)):
        faults = [_fault("values-not-finite", "the volume holds values that are no numbers", "H55")]
    if faults:
        raise ImageRefused(*faults)
    stored = _stored_affine(node.GetAttribute(AFFINE), affine, _size(voxels))
    # The matrix as it was read, not as the node's direction cosines and spacings rebuild it.
    affine = affine if stored is None else stored
    found = fingerprint(voxels, affine)
    untouched = stored is not None and node.GetAttribute(CONTENT) == found
    source = _source(node.GetAttribute(SOURCE)) if untouched else None
    if source is None:
        known = node.GetAttribute(CONTENT) is not None
        source = ImageSource(sha256=found, warnings=(CHANGED if known else FOREIGN,))
    return Volume(voxels, affine, source)


def volume_as_saved(read: Volume, attributes: Mapping[str, str]) -> Volume:
    """The CT of a scene's file exactly as it was when HexaFix read it.

    Parameters
    ----------
    read : Volume
        What the scene's image file holds.
    attributes : mapping of str
        Those of the volume's node.

    Raises
    ------
    ImageRefused
        If voxels, place or what the reader knew are not as they were (H01), or HexaFix did not
        read the CT (H07).
    """
    if CONTENT not in attributes:
        raise ImageRefused(
            _fault(
                "scene-volume-foreign",
                f"the scene cannot be opened with its CT: {FOREIGN}",
                "H07",
                next_step="load the CT from its own files",
            )
        )
    affine = _stored_affine(attributes.get(AFFINE), read.ijk_to_lps, read.size_ijk)
    source = _source(attributes.get(SOURCE))
    found = None if affine is None else fingerprint(read.voxels, affine)
    same = found is not None and attributes[CONTENT] == found
    # Slices of a tilted gantry were hashed before they were moved.
    named = source is not None and (source.acquisition is not None or source.sha256 == found)
    if affine is None or source is None or not same or not named:
        raise ImageRefused(
            _fault(
                "scene-volume-changed",
                "the scene's CT is not the one that was saved: its values, its place or what is "
                "known of it were changed",
                "H01",
                next_step="save the scene again where it was planned, or load the CT from its own "
                "files",
            )
        )
    return Volume(read.voxels, affine, source)


def _source_document(source: ImageSource) -> dict[str, Any]:
    document = asdict(source)
    if source.acquisition is not None:
        document["acquisition"]["ijk_to_lps"] = source.acquisition.ijk_to_lps.tolist()
    return document


def _source(text: str | None) -> ImageSource | None:
    """What the reader knew; None where the attribute's text does not hold it, value by value."""
    try:
        document = parse_json_object((text or "").encode(), what="source", where="volume node")
        acquired = document.pop("acquisition")
        warnings = document.pop("warnings")
        source = ImageSource(**document, warnings=tuple(warnings))
        _require_source(source, warnings)
        if acquired is None:
            return source
        i, j, k = (int(n) for n in acquired["size_ijk"])
        affine = np.array(acquired["ijk_to_lps"], float).reshape(4, 4)
        acquisition = Acquisition(affine, (i, j, k), float(acquired["tilt_deg"]))
        if min(i, j, k) < 1 or not np.isfinite([*affine.ravel(), acquisition.tilt_deg]).all():
            return None
        return replace(source, acquisition=acquisition)
    except (InputError, ValueError, TypeError, KeyError):
        return None


def _require_source(source: ImageSource, warnings: Any) -> None:
    """ValueError unless every value is of its kind: a file may hold anything in their places."""
    words = (source.laterality, source.body_part, source.patient_position)
    thick = source.slice_thickness_mm
    texts = [source.sha256, *warnings, *(word for word in words if word is not None)]
    if not isinstance(warnings, list) or not all(isinstance(text, str) for text in texts):
        raise ValueError
    if source.kind not in KINDS or not (thick is None or isinstance(thick, (int, float))):
        raise ValueError


def _require_scalar(node: Any) -> None:
    """Refuse what is no volume of one number a voxel in its own place."""
    if node is None or not node.IsA("vtkMRMLScalarVolumeNode") or node.GetImageData() is None:
        raise ImageRefused(_fault("not-a-volume", "no volume is loaded", "H08"))
    if node.GetParentTransformNode() is not None:
        raise ImageRefused(
            _fault(
                "volume-transformed",
                "the volume stands under a transform: its place in the patient was changed",
                "H36",
                next_step="take the volume out from under its transform, without hardening it",
            )
        )
    image = node.GetImageData()
    plain = image.GetNumberOfScalarComponents() == 1 and image.GetPointData().GetScalars()
    if not plain or node.IsA("vtkMRMLLabelMapVolumeNode"):
        raise ImageRefused(
            _fault("not-a-volume", "the volume does not hold one grey value a voxel", "H08")
        )
    if image.GetSpacing() != (1.0, 1.0, 1.0) or image.GetOrigin() != (0.0, 0.0, 0.0):
        # MRML keeps the geometry in the node; both at once would count twice.
        raise ImageRefused(
            _fault("no-geometry", "the volume's geometry stands in two places", "H07")
        )


def _fault(code: str, what: str, hazard: str, next_step: str | None = None) -> Fault:
    step = next_step or "load the CT by HexaFix"
    return Fault(code, what, hazard=hazard, where="volume node", next_step=step)


def _voxels(node: Any) -> NDArray:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    image = node.GetImageData()
    i, j, k = image.GetDimensions()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(k, j, i).copy()


def _size(voxels: NDArray) -> tuple[int, int, int]:
    k, j, i = voxels.shape
    return i, j, k


def _index_matrix(node: Any) -> NDArray[np.float64]:
    """Voxel indices (i, j, k, 1) to RAS mm, shape (4, 4)."""
    matrix = vtk4(np.eye(4))
    node.GetIJKToRASMatrix(matrix)
    return array4(matrix)


def _stored_affine(
    text: str | None, affine: NDArray[np.float64], size_ijk: tuple[int, int, int]
) -> NDArray[np.float64] | None:
    """The affine as it was read, if `affine` puts every corner at the same place."""
    try:
        stored = np.array(json.loads(text or ""), float).reshape(4, 4)
    except (ValueError, TypeError):
        return None
    apart = np.abs(corners_mm(size_ijk, stored) - corners_mm(size_ijk, affine)).max()
    return stored if apart <= SAME_PLACE_MM else None
