"""A tiny DICOM writer: every voxel's value tells which voxel it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.errors import ImageRefused
from hexafix.imaging import itk_file
from hexafix.imaging.itk_reader import load_with_itk
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import (
    DeflatedExplicitVRLittleEndian,
    ExplicitVRBigEndian,
    ExplicitVRLittleEndian,
    ImplicitVRLittleEndian,
    generate_uid,
)

CT_STORAGE = "1.2.840.10008.5.1.4.1.1.2"
ENHANCED_CT = "1.2.840.10008.5.1.4.1.1.2.1"
INTERCEPT = -1024
SECRET = "Secretname"


@dataclass(frozen=True, eq=False)
class Grid:
    """What a synthetic series claims: direction of rows, of columns, and the slice origins."""

    row: tuple[float, ...] = (1.0, 0.0, 0.0)
    column: tuple[float, ...] = (0.0, 1.0, 0.0)
    origin: tuple[float, ...] = (-30.0, 12.5, 400.0)
    between_rows: float = 0.7
    between_columns: float = 0.45
    step: float = 1.25
    size: tuple[int, int, int] = (7, 6, 5)
    step_direction: tuple[float, ...] | None = field(default=None)

    def slice_origin(self, k: float) -> np.ndarray:
        direction = self.step_direction
        if direction is None:
            direction = np.cross(self.row, self.column)
        return np.array(self.origin) + k * self.step * np.asarray(direction)

    def place(self, i: float, j: float, k: float) -> np.ndarray:
        """Centre of a voxel by the DICOM standard's formula (PS3.3 C.7.6.2.1-1)."""
        return (
            self.slice_origin(k)
            + np.array(self.row) * self.between_columns * i
            + np.array(self.column) * self.between_rows * j
        )


def code_of(i: int, j: int, k: int) -> int:
    return 1000 * k + 10 * j + i


def coded_slice(grid: Grid, k: int) -> np.ndarray:
    i, j, _ = grid.size
    return (1000 * k + 10 * np.arange(j)[:, None] + np.arange(i)).astype(np.uint16)


class DicomWriter:
    """Builds the slices of a series; a test spoils them before they are saved."""

    grid = Grid

    def __init__(self) -> None:
        self.frame = generate_uid()

    def slices(self, grid: Grid, *, series_uid: str | None = None) -> list[Dataset]:
        uid = series_uid or generate_uid()
        return [self.one(grid, k, uid) for k in range(grid.size[2])]

    def one(self, grid: Grid, k: int, uid: str) -> Dataset:
        item = self._header(grid, uid)
        item.SOPClassUID = CT_STORAGE
        item.InstanceNumber = k + 1
        item.ImagePositionPatient = [f"{v:.10g}"[:16] for v in grid.slice_origin(k)]
        item.ImageOrientationPatient = [f"{v:.12f}"[:16] for v in (*grid.row, *grid.column)]
        item.PixelSpacing = [str(grid.between_rows), str(grid.between_columns)]
        item.RescaleSlope, item.RescaleIntercept = "1", str(INTERCEPT)
        item.SliceThickness = str(grid.step)
        self.set_pixels(item, coded_slice(grid, k))
        return item

    def _header(self, grid: Grid, uid: str) -> Dataset:
        item = Dataset()
        item.PatientName = f"{SECRET}^Jane"
        item.PatientID = f"ID-{SECRET}"
        item.InstitutionName = f"{SECRET} Hospital"
        item.SOPInstanceUID = generate_uid()
        item.SeriesInstanceUID = uid
        item.StudyInstanceUID = generate_uid()
        item.FrameOfReferenceUID = self.frame
        item.Modality = "CT"
        item.ImageType = ["ORIGINAL", "PRIMARY", "AXIAL"]
        item.PatientPosition = "HFS"
        item.BodyPartExamined = "TIBIA"
        item.Laterality = "L"
        item.SamplesPerPixel = 1
        item.PhotometricInterpretation = "MONOCHROME2"
        item.Columns, item.Rows = grid.size[:2]
        item.BitsAllocated = item.BitsStored = 16
        item.HighBit = 15
        item.PixelRepresentation = 0
        return item

    def enhanced(self, grid: Grid) -> Dataset:
        """The whole grid as one multi-frame object, geometry in the functional groups."""
        item = self._header(grid, generate_uid())
        item.SOPClassUID = ENHANCED_CT
        item.NumberOfFrames = grid.size[2]
        measures, plane, values = Dataset(), Dataset(), Dataset()
        measures.PixelSpacing = [grid.between_rows, grid.between_columns]
        measures.SliceThickness = grid.step
        plane.ImageOrientationPatient = [f"{v:.12f}"[:16] for v in (*grid.row, *grid.column)]
        values.RescaleSlope, values.RescaleIntercept, values.RescaleType = 1, INTERCEPT, "HU"
        shared = Dataset()
        shared.PixelMeasuresSequence = [measures]
        shared.PlaneOrientationSequence = [plane]
        shared.PixelValueTransformationSequence = [values]
        item.SharedFunctionalGroupsSequence = [shared]
        frames = []
        for k in range(grid.size[2]):
            position, frame = Dataset(), Dataset()
            position.ImagePositionPatient = [f"{v:.10g}"[:16] for v in grid.slice_origin(k)]
            frame.PlanePositionSequence = [position]
            frames.append(frame)
        item.PerFrameFunctionalGroupsSequence = frames
        item.PixelData = b"".join(coded_slice(grid, k).tobytes() for k in range(grid.size[2]))
        item["PixelData"].VR = "OW"
        return item

    @staticmethod
    def set_pixels(item: Dataset, pixels: np.ndarray, *, bits_stored: int | None = None) -> None:
        bits = pixels.dtype.itemsize * 8
        item.Rows, item.Columns = pixels.shape
        item.BitsAllocated = bits
        item.BitsStored = bits_stored or bits
        item.HighBit = item.BitsStored - 1
        item.PixelRepresentation = int(pixels.dtype.kind == "i")
        data = pixels.tobytes()
        item.PixelData = data + b"\0" * (len(data) % 2)
        item["PixelData"].VR = "OW"

    @staticmethod
    def save(
        folder: Path,
        items: list[Dataset],
        *,
        names: Callable[[int], str] = "{:04d}.dcm".format,
        syntax: str = ExplicitVRLittleEndian,
    ) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        for index, item in enumerate(items):
            item.file_meta = FileMetaDataset()
            item.file_meta.TransferSyntaxUID = syntax
            item.file_meta.MediaStorageSOPClassUID = item.SOPClassUID
            item.file_meta.MediaStorageSOPInstanceUID = item.SOPInstanceUID
            item.save_as(
                folder / names(index),
                enforce_file_format=True,
                implicit_vr=syntax == ImplicitVRLittleEndian,
                little_endian=syntax != ExplicitVRBigEndian,
            )
        return folder


@pytest.fixture
def writer() -> DicomWriter:
    return DicomWriter()


@pytest.fixture
def grid() -> Grid:
    """An ordinary axial grid, off the origin, anisotropic."""
    return Grid()


@pytest.fixture
def syntaxes() -> dict[str, str]:
    return {
        "implicit": ImplicitVRLittleEndian,
        "explicit": ExplicitVRLittleEndian,
        "big-endian": ExplicitVRBigEndian,
        "deflated": DeflatedExplicitVRLittleEndian,
    }


@pytest.fixture
def assert_coded() -> Callable[..., None]:
    """Checks that the volume has the value of voxel (i, j, k) where the header puts that voxel."""

    def check(volume, grid: Grid, *, offset: float = INTERCEPT) -> None:
        assert sorted(volume.size_ijk[:2]) == sorted(grid.size[:2])
        for i in range(grid.size[0]):
            for j in range(grid.size[1]):
                for k in range(grid.size[2]):
                    index = volume.ijk_from_lps(grid.place(i, j, k))
                    nearest = np.rint(index).astype(int)
                    np.testing.assert_allclose(index, nearest, atol=1e-5)
                    value = volume.voxels[nearest[2], nearest[1], nearest[0]]
                    assert value == code_of(i, j, k) + offset

    return check


@pytest.fixture
def coded_image() -> Callable[..., sitk.Image]:
    """An ITK image in which every voxel's value tells which voxel it is, HU from -1024."""

    def build(grid: Grid, direction=None, dtype=np.int16) -> sitk.Image:
        k, j, i = np.meshgrid(*(np.arange(n) for n in grid.size[::-1]), indexing="ij")
        image = sitk.GetImageFromArray((1000 * k + 10 * j + i + INTERCEPT).astype(dtype))
        frame = np.column_stack([grid.row, grid.column, np.cross(grid.row, grid.column)])
        image.SetDirection((frame if direction is None else direction).ravel())
        image.SetOrigin(grid.origin)
        image.SetSpacing((grid.between_columns, grid.between_rows, grid.step))
        return image

    return build


@pytest.fixture
def itk_in_process(monkeypatch) -> None:
    """Saves the start of a child process for each of very many small files."""

    def load(path, reader, geometry):
        try:
            return load_with_itk(path, reader)
        except RuntimeError as error:
            raise ImageRefused.of("corrupt-pixel-data", "unreadable", hazard="H09") from error

    monkeypatch.setattr(itk_file, "load_isolated", load)


@pytest.fixture(scope="session")
def ct_corpus() -> Path:
    """Real files beside the checkout; the tests that need them are skipped without."""
    corpus = Path(__file__).resolve().parents[3] / "shared" / "ct-corpus"
    if not corpus.is_dir():
        pytest.skip("the corpus of real CT files does not lie beside this checkout")
    return corpus


@pytest.fixture(scope="session")
def secret() -> str:
    return SECRET
