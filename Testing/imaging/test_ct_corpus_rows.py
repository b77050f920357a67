"""Every row of the corpus's README ends as it must: refused for its reason, or every corner right.

Corners are taken from the files' own headers, read by pydicom alone; a single slice is refused, and
shown to be right by three copies of it that are a series.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pydicom
import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.errors import HexaFixError
from hexafix.imaging import list_series, read_volume
from pydicom.uid import generate_uid

pytestmark = pytest.mark.usefixtures("itk_in_process")


@dataclass(frozen=True)
class Refused:
    """The codes of all faults, and words that one of their messages holds."""

    codes: frozenset[str]
    says: str = ""


@dataclass(frozen=True)
class Accepted:
    """Read, with this tilt and these beginnings of warnings."""

    tilt_deg: float | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class OneSlice:
    """Too few slices by itself. As a series, its copies following each other along the table
    (`table`: patient z) or along their normal, it is read."""

    series: Accepted = Accepted()
    table: bool = False


def refused(*codes: str, says: str = "") -> Refused:
    return Refused(frozenset(codes), says)


LOSSY, THICK = "lossy (H10)", "thick slices"
NO_IMAGE = refused("no-dicom-image")
CORNERSTONE = "cornerstone_transfer_syntaxes/"
CT_IMAGE = CORNERSTONE + "CTImage.dcm"
SPHERES = "spheres_nrrd/"

ROWS: dict[str, dict[str, Refused | Accepted | OneSlice]] = {
    "dcm_qa_ct/GE_tilt_varspacing (28 files, 14.7 MB)": {
        "dcm_qa_ct/GE_tilt_varspacing": refused("uneven-spacing", "gantry-tilt", says="1.081 mm at")
    },
    "dcm_qa_ct/Philips_tilt_m18.5 (12 of 54 slices)": {
        "dcm_qa_ct/Philips_tilt_m18.5": Accepted(-18.5, ("gantry tilt (H02)", THICK))
    },
    "dcm_qa_ct/Philips_tilt_p16.5 (12 of 58)": {
        "dcm_qa_ct/Philips_tilt_p16.5": Accepted(16.5, ("gantry tilt (H02)", THICK))
    },
    "dcm_qa_ct/Philips_plain5mm (8)": {"dcm_qa_ct/Philips_plain5mm": Accepted(None, (THICK,))},
    "dcm_qa_ct/Philips_mixed_extra (4)": {
        "dcm_qa_ct/Philips_mixed_extra": refused(
            "no-usable-series", "no-geometry", says="1 x localizer, 2 x secondary capture"
        )
    },
    "dicom2nifti_failing/gantrytilting/001": {
        "dicom2nifti_failing/gantrytilting/001": Accepted(-14.0, ("gantry tilt (H02)", THICK))
    },
    "dicom2nifti_failing/sliceincrement/001": {
        "dicom2nifti_failing/sliceincrement/001": refused(
            "missing-slice", says="10.000 mm at 28.107..38.107"
        )
    },
    "dicom2nifti_failing/sliceincrement/002": {
        "dicom2nifti_failing/sliceincrement/002": refused(
            "missing-slice", "gantry-tilt", says="-15.50 deg"
        )
    },
    "dicom2nifti_failing/sliceorientation/001": {
        "dicom2nifti_failing/sliceorientation/001": refused(
            "mixed-orientation", "mixed-spacing", "duplicate-slice"
        )
    },
    "dicom2nifti_failing/notavolume/001": {
        "dicom2nifti_failing/notavolume/001": refused("too-few-slices", "duplicate-slice")
    },
    "dicom2nifti_failing/slicecount/001": {
        "dicom2nifti_failing/slicecount/001": refused("too-few-slices")
    },
    "dicom2nifti_failing/non_isotropic_oblique (4)": {
        "dicom2nifti_failing/non_isotropic_oblique": Accepted(None, ("modality MR (H10)",))
    },
    "cornerstone_transfer_syntaxes/CTImage.dcm* (14 files)": {
        CT_IMAGE: OneSlice(),
        CT_IMAGE + "_BigEndianExplicitTransferSyntax_1.2.840.10008.1.2.2.dcm": OneSlice(),
        CT_IMAGE
        + "_DeflatedExplicitVRLittleEndianTransferSyntax_1.2.840.10008.1.2.1.99.dcm": OneSlice(),
        CT_IMAGE + "_JPEG2000LosslessOnlyTransferSyntax_1.2.840.10008.1.2.4.90.dcm": OneSlice(),
        CT_IMAGE + "_JPEG2000TransferSyntax_1.2.840.10008.1.2.4.91.dcm": OneSlice(
            Accepted(None, (LOSSY,))
        ),
        CT_IMAGE + "_JPEGLSLosslessTransferSyntax_1.2.840.10008.1.2.4.80.dcm": OneSlice(),
        CT_IMAGE + "_JPEGLSLossyTransferSyntax_1.2.840.10008.1.2.4.81.dcm": OneSlice(
            Accepted(None, (LOSSY,))
        ),
        CT_IMAGE + "_JPEGProcess14SV1TransferSyntax_1.2.840.10008.1.2.4.70.dcm": OneSlice(),
        CT_IMAGE + "_JPEGProcess14TransferSyntax_1.2.840.10008.1.2.4.57.dcm": OneSlice(),
        CT_IMAGE + "_JPEGProcess1TransferSyntax_1.2.840.10008.1.2.4.50.dcm": OneSlice(
            Accepted(None, (LOSSY,))
        ),
        CT_IMAGE + "_JPEGProcess2_4TransferSyntax_1.2.840.10008.1.2.4.51.dcm": OneSlice(
            Accepted(None, (LOSSY,))
        ),
        CT_IMAGE + "_JPEGProcess6_8TransferSyntax_1.2.840.10008.1.2.4.53.dcm": refused(
            "too-few-slices", "transfer-syntax"
        ),
        CT_IMAGE + "_LittleEndianExplicitTransferSyntax_1.2.840.10008.1.2.1.dcm": OneSlice(),
        CT_IMAGE + "_RLELosslessTransferSyntax_1.2.840.10008.1.2.5.dcm": OneSlice(),
    },
    "cornerstone_transfer_syntaxes/no-pixel-data.dcm, CT1_J2KR, CT2_J2KR": {
        CORNERSTONE + "no-pixel-data.dcm": refused("no-dicom-image", says="without an image"),
        CORNERSTONE + "CT1_J2KR": OneSlice(),
        CORNERSTONE + "CT2_J2KR": OneSlice(),
    },
    "pydicom/CT_small.dcm": {"pydicom/CT_small.dcm": OneSlice()},
    # One slice has no tilt by positions: its plane may lean because the patient's axes do. What
    # the header's tag says is never believed, so the tilt shows with the next slice only.
    "pydicom/693_J2KI.dcm, J2K_pixelrep_mismatch.dcm": {
        "pydicom/693_J2KI.dcm": OneSlice(Accepted(None, (LOSSY,))),
        "pydicom/J2K_pixelrep_mismatch.dcm": OneSlice(Accepted(-22.0), table=True),
    },
    "pydicom/MR_truncated.dcm": {
        "pydicom/MR_truncated.dcm": refused(
            "too-few-slices", "truncated-pixel-data", says="8130 of 8192 bytes"
        )
    },
    "pydicom/no_meta, no_meta_group_length, meta_missing_tsyntax, badVR, ExplVR_BigEnd, "
    "UN_sequence, nested_priv_SQ, rtplan (.dcm)": {
        "pydicom/no_meta.dcm": refused("no-dicom-image", says="no preamble"),
        "pydicom/no_meta_group_length.dcm": NO_IMAGE,
        "pydicom/meta_missing_tsyntax.dcm": refused("no-dicom-image", says="transfer syntax"),
        "pydicom/badVR.dcm": NO_IMAGE,
        "pydicom/ExplVR_BigEnd.dcm": refused(
            "no-usable-series", "no-geometry", says="colour image"
        ),
        "pydicom/UN_sequence.dcm": refused("no-dicom-image", says="without an image"),
        "pydicom/nested_priv_SQ.dcm": refused("no-dicom-image", says="without an image"),
        "pydicom/rtplan.dcm": refused("no-dicom-image", says="without an image"),
    },
    "pydicom/dicomdirtests_77654033_CT2 (4)": {
        "pydicom/dicomdirtests_77654033_CT2": refused("missing-slice", says="202.500 mm")
    },
    "pydicom/dicomdirtests_98892001_CT5N (5)": {
        "pydicom/dicomdirtests_98892001_CT5N": Accepted(None, (THICK,))
    },
    "pydicom-data/eCT_Supplemental.dcm": {
        "pydicom-data/eCT_Supplemental.dcm": Accepted(None, (THICK,))
    },
    "pydicom-data/explicit_VR-UN.dcm": {"pydicom-data/explicit_VR-UN.dcm": OneSlice()},
    "pydicom-data/bad_sequence, emri_small_big_endian, emri_small_jpeg_2k_lossless_too_short, "
    "mlut_18 (.dcm)": {
        "pydicom-data/bad_sequence.dcm": refused("too-few-slices"),
        "pydicom-data/emri_small_big_endian.dcm": refused("no-geometry"),
        "pydicom-data/emri_small_jpeg_2k_lossless_too_short.dcm": refused(
            "no-geometry", "bad-codestream"
        ),
        "pydicom-data/mlut_18.dcm": refused("no-usable-series", "no-geometry", "modality-lut"),
    },
    "fo-dicom/CT-MONO2-16-ankle": {
        "fo-dicom/CT-MONO2-16-ankle": refused("no-usable-series", "no-geometry")
    },
    "fo-dicom/GH355.dcm": {"fo-dicom/GH355.dcm": refused("no-geometry")},
    "fo-dicom/GH1308.dcm": {"fo-dicom/GH1308.dcm": OneSlice(Accepted(-5.5), table=True)},
    "fo-dicom/GH342.dcm": {"fo-dicom/GH342.dcm": refused("no-usable-series", says="localizer")},
    "fo-dicom/GH1376.dcm (1.3 MB)": {
        "fo-dicom/GH1376.dcm": refused(
            "too-few-slices", "truncated-pixel-data", says="of 9287460 bytes"
        )
    },
    "fo-dicom/GH1728.dcm, D_CLUNIE_CT1_RLE_FRAGS.dcm, "
    "GH177_D_CLUNIE_CT1_IVRLE_BigEndian_undefined_length.dcm, CT1_J2KI, IM-0001-0001-0001.dcm, "
    "CR-MONO1-10-chest": {
        "fo-dicom/GH1728.dcm": refused("no-usable-series", says="secondary capture"),
        "fo-dicom/D_CLUNIE_CT1_RLE_FRAGS.dcm": OneSlice(),
        "fo-dicom/GH177_D_CLUNIE_CT1_IVRLE_BigEndian_undefined_length.dcm": NO_IMAGE,
        "fo-dicom/CT1_J2KI": OneSlice(Accepted(None, (LOSSY,))),
        "fo-dicom/IM-0001-0001-0001.dcm": OneSlice(),
        "fo-dicom/CR-MONO1-10-chest": refused("no-dicom-image", says="no preamble"),
    },
    "dcmqi_ct3 (3 files)": {"dcmqi_ct3": Accepted()},
    "spheres_nrrd (7 files, 10-55 kB)": {
        f"{SPHERES}{name}.nrrd": Accepted(None, warnings)
        for name, warnings in (
            ("3mmFiducialTest", ()),
            ("4mmFiducialTest", ()),
            ("5mmFiducialTest", ()),
            ("10mmFiducialTest", ()),
            ("20mmFiducialTest", ()),
            ("3mmFiducialTest_resampled2.5", (THICK,)),
            ("4mmFiducialTest_Resampled2.5", (THICK,)),
        )
    },
    "niivue/CT_pitch.nii.gz": {"niivue/CT_pitch.nii.gz": Accepted(None, (THICK,))},
    "crasher/sitk257_segfault_one_byte.dcm": {
        "crasher/sitk257_segfault_one_byte.dcm": refused("no-geometry", "bad-codestream")
    },
}
"""The first cell of each row of the README: its files and folders, and how each must end."""

OUTCOMES = {path: outcome for row in ROWS.values() for path, outcome in row.items()}


def of_kind(kind):
    return [path for path, outcome in OUTCOMES.items() if isinstance(outcome, kind)]


def test_every_row_of_the_readme_has_an_expectation(ct_corpus):
    lines = (ct_corpus / "README.md").read_text(encoding="utf-8").splitlines()
    cells = [line.split("|")[1].strip() for line in lines if line.startswith("| ")]
    assert cells[0] == "folder / file"
    assert cells[1:] == list(ROWS)


def test_every_file_of_the_corpus_belongs_to_a_row(ct_corpus):
    about = {"README.md", "SHA256SUMS", "LICENSE", "LICENSE.txt", "License.txt"}
    files = [path.relative_to(ct_corpus) for path in ct_corpus.rglob("*") if path.is_file()]
    loose = [
        str(path)
        for path in files
        if path.name not in about
        and not any(path.is_relative_to(expected) for expected in OUTCOMES)
    ]
    assert loose == []
    assert all((ct_corpus / path).exists() for path in OUTCOMES)


@pytest.mark.parametrize("path", of_kind(Refused))
def test_a_trap_is_refused_for_all_its_reasons(path, ct_corpus):
    expected = OUTCOMES[path]
    with pytest.raises(HexaFixError) as caught:
        read_volume(ct_corpus / path)
    faults = caught.value.faults
    assert {fault.code for fault in faults} == expected.codes
    assert all(fault.next_step for fault in faults)
    assert expected.says in " ".join(fault.message for fault in faults)
    assert str(ct_corpus) not in str(caught.value)


@pytest.mark.parametrize("path", of_kind(OneSlice))
def test_a_single_slice_is_too_few(path, ct_corpus):
    with pytest.raises(HexaFixError) as caught:
        read_volume(ct_corpus / path)
    assert [fault.code for fault in caught.value.faults] == ["too-few-slices"]


def frames_of(folder: Path) -> list[pydicom.Dataset]:
    """Position, orientation and pitch of every frame, by pydicom and the standard's tags."""
    found = []
    for file in [folder] if folder.is_file() else sorted(folder.iterdir()):
        if file.name.upper().startswith("LICENSE"):
            continue
        item = pydicom.dcmread(file, stop_before_pixels=True)
        if "PerFrameFunctionalGroupsSequence" not in item:
            found.append(item)
            continue
        shared = item.SharedFunctionalGroupsSequence[0]
        for own in item.PerFrameFunctionalGroupsSequence:
            frame = pydicom.Dataset()
            frame.Rows, frame.Columns = item.Rows, item.Columns
            for group in (shared, own):
                for macro, keyword in (
                    ("PlanePositionSequence", "ImagePositionPatient"),
                    ("PlaneOrientationSequence", "ImageOrientationPatient"),
                    ("PixelMeasuresSequence", "PixelSpacing"),
                ):
                    if macro in group:
                        setattr(frame, keyword, getattr(group[macro].value[0], keyword))
            found.append(frame)
    return found


def corners_by_header(item: pydicom.Dataset) -> np.ndarray:
    """Centres of the four corner pixels of a slice by the standard's C.7.6.2.1-1, (2, 2, 3)."""
    row, column = np.reshape(np.array(item.ImageOrientationPatient, float), (2, 3))
    # A header of four decimals is off unit length by more than the tolerance at a far corner.
    row, column = row / np.linalg.norm(row), column / np.linalg.norm(column)
    between_rows, between_columns = (float(value) for value in item.PixelSpacing)
    i, j = np.meshgrid([0, item.Columns - 1], [0, item.Rows - 1], indexing="ij")
    return (
        np.array(item.ImagePositionPatient, float)
        + i[..., None] * row * between_columns
        + j[..., None] * column * between_rows
    )


def assert_corners(volume, frames) -> None:
    """Each slice's four corners lie where the volume, or what was acquired for it, has them."""
    region = volume.source.acquisition or volume
    i, j, k = region.size_ijk
    assert k == len(frames)
    left = set(range(k))
    for frame in frames:
        assert (frame.Columns, frame.Rows) == (i, j)
        stated = corners_by_header(frame)
        inverse = np.linalg.inv(region.ijk_to_lps)
        number = round(float((inverse @ [*stated[0, 0], 1.0])[2]))
        left.remove(number)
        for a, b in np.ndindex(2, 2):
            at = region.ijk_to_lps @ (a * (i - 1), b * (j - 1), number, 1)
            np.testing.assert_allclose(at[:3], stated[a, b], atol=1e-3)


def assert_accepted(volume, expected: Accepted) -> None:
    acquisition = volume.source.acquisition
    if expected.tilt_deg is None:
        assert acquisition is None
    else:
        assert acquisition.tilt_deg == pytest.approx(expected.tilt_deg, abs=0.05)
        np.testing.assert_allclose(volume.direction.T @ volume.direction, np.eye(3), atol=1e-9)
    kinds = (LOSSY, THICK, "gantry tilt (H02)", "modality")
    said = [text for text in volume.source.warnings if text.startswith(kinds)]
    assert len(said) == len(expected.warnings)
    for beginning in expected.warnings:
        assert any(text.startswith(beginning) for text in said)


@pytest.mark.parametrize("path", [p for p in of_kind(Accepted) if not p.endswith(("nrrd", "gz"))])
def test_every_corner_of_an_accepted_series_lies_where_its_header_says(path, ct_corpus):
    volume = read_volume(ct_corpus / path)
    assert_accepted(volume, OUTCOMES[path])
    assert_corners(volume, frames_of(ct_corpus / path))
    (summary,) = list_series(ct_corpus / path)
    tilt = OUTCOMES[path].tilt_deg
    assert abs(summary.tilt_deg - (tilt or 0.0)) < 0.05
    assert ("tilted by" in summary.description) == (tilt is not None)


@pytest.mark.parametrize("path", [p for p in of_kind(Accepted) if p.endswith(("nrrd", "gz"))])
def test_every_corner_of_an_image_file_lies_where_simpleitk_has_it(path, ct_corpus):
    volume, image = read_volume(ct_corpus / path), sitk.ReadImage(str(ct_corpus / path))
    assert_accepted(volume, OUTCOMES[path])
    np.testing.assert_array_equal(volume.voxels, sitk.GetArrayFromImage(image))
    for ends in np.ndindex(2, 2, 2):
        index = [end * (n - 1) for end, n in zip(ends, image.GetSize(), strict=True)]
        at = image.TransformIndexToPhysicalPoint(index)
        np.testing.assert_allclose(volume.lps_from_ijk(index), at, atol=1e-3)


@pytest.mark.parametrize("path", of_kind(OneSlice))
def test_copies_of_a_single_slice_in_a_row_are_read_as_a_series(path, ct_corpus, tmp_path):
    expected = OUTCOMES[path]
    item = pydicom.dcmread(ct_corpus / path)
    row, column = np.reshape(np.array(item.ImageOrientationPatient, float), (2, 3))
    normal = np.cross(row, column)
    step = np.array([0.0, 0.0, 1.0]) * np.sign(normal[2]) if expected.table else normal
    origin = np.array(item.ImagePositionPatient, float)
    for k in range(3):
        item.ImagePositionPatient = [f"{value:.9f}"[:16] for value in origin + 1.5 * k * step]
        item.SOPInstanceUID = item.file_meta.MediaStorageSOPInstanceUID = generate_uid()
        item.save_as(tmp_path / f"{k}.dcm")
    volume = read_volume(tmp_path)
    series = expected.series
    if float(item.get("SliceThickness") or 0.0) > 2.0:
        series = replace(series, warnings=(*series.warnings, THICK))
    if series.tilt_deg is not None:
        series = replace(series, warnings=(*series.warnings, "gantry tilt (H02)"))
    assert_accepted(volume, series)
    assert_corners(volume, frames_of(tmp_path))
    if series.tilt_deg is None:
        expected_hu = sitk.GetArrayFromImage(sitk.ReadImage(str(ct_corpus / path)))[0]
        # Padding below air is air here; two lossy decoders may round a grey value differently.
        near = float(item.RescaleSlope) if LOSSY in series.warnings else 0.0
        for plane in volume.voxels:
            apart = np.maximum(plane, -1024) - np.maximum(expected_hu, -1024.0)
            assert np.abs(apart).max() <= near + 1e-3
