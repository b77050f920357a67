"""NIfTI: two forms, units, and archives; nothing that is not certain."""

from __future__ import annotations

import gzip
import struct

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.errors import ImageRefused, InputError
from hexafix.imaging import read_volume
from hexafix.imaging.itk_reader import load_with_itk
from scipy.spatial.transform import Rotation

pytestmark = pytest.mark.usefixtures("itk_in_process")

TILT = Rotation.from_euler("xyz", [0.3, -0.2, 0.5]).as_matrix()


def codes(path, error=ImageRefused):
    with pytest.raises(error) as caught:
        read_volume(path)
    return {fault.code: fault.hazard for fault in caught.value.faults}


@pytest.fixture
def oblique(writer):
    return writer.grid(row=tuple(TILT[:, 0]), column=tuple(TILT[:, 1]))


def edit(path, offset, layout, *values):
    data = bytearray(path.read_bytes())
    struct.pack_into(layout, data, offset, *values)
    path.write_bytes(data)


@pytest.fixture
def nifti(tmp_path, oblique, coded_image):
    path = tmp_path / "image.nii"
    sitk.WriteImage(coded_image(oblique), str(path))
    return path


def test_nifti_without_forms_is_refused(nifti):
    edit(nifti, 252, "<2h", 0, 0)
    assert codes(nifti) == {"no-geometry": "H07"}


def test_nifti_forms_that_disagree_are_refused_just_above_the_tolerance(nifti):
    (z,) = struct.unpack_from("<f", nifti.read_bytes(), 276)
    edit(nifti, 276, "<f", z + 0.012)
    assert codes(nifti) == {"forms-disagree": "H08"}
    edit(nifti, 276, "<f", z + 0.007)
    assert read_volume(nifti).size_ijk == (7, 6, 5)


def test_nifti_with_a_mirrored_sform_is_refused(nifti):
    row = struct.unpack_from("<4f", nifti.read_bytes(), 280)
    edit(nifti, 280, "<4f", *(-value for value in row))
    assert codes(nifti) == {"forms-disagree": "H08"}


@pytest.mark.parametrize("codes_kept", [(1, 0), (0, 1)])
def test_nifti_with_one_form_is_read_by_it(codes_kept, nifti, oblique):
    edit(nifti, 252, "<2h", *codes_kept)
    volume = read_volume(nifti)
    np.testing.assert_allclose(volume.lps_from_ijk([6, 5, 4]), oblique.place(6, 5, 4), atol=1e-4)


@pytest.mark.parametrize(("unit", "factor"), [(1, 1000.0), (3, 1e-3)])
def test_nifti_units_are_turned_into_millimetres(unit, factor, nifti, oblique):
    data = nifti.read_bytes()
    edit(nifti, 123, "<B", unit)
    edit(nifti, 80, "<3f", *(v / factor for v in struct.unpack_from("<3f", data, 80)))
    edit(nifti, 268, "<3f", *(v / factor for v in struct.unpack_from("<3f", data, 268)))
    edit(nifti, 280, "<12f", *(v / factor for v in struct.unpack_from("<12f", data, 280)))
    volume = read_volume(nifti)
    np.testing.assert_allclose(volume.lps_from_ijk([6, 5, 4]), oblique.place(6, 5, 4), atol=1e-3)


def test_nifti_without_a_unit_is_refused(nifti):
    edit(nifti, 123, "<B", 0)
    assert codes(nifti) == {"no-geometry": "H08"}


def test_nifti_with_a_sheared_sform_alone_is_refused(nifti):
    edit(nifti, 252, "<2h", 0, 1)
    (xy,) = struct.unpack_from("<f", nifti.read_bytes(), 284)
    edit(nifti, 284, "<f", xy + 0.01)
    assert codes(nifti) == {"sheared": "H08"}


def test_nifti_of_several_volumes_is_an_input_error(nifti):
    edit(nifti, 40, "<8h", 4, 7, 6, 5, 2, 1, 1, 1)
    assert codes(nifti, InputError) == {"not-a-volume": None}


def test_a_real_doubt_of_itk_is_heard(nifti):
    # Forms that disagree are refused by our own parser before ITK is asked: ask it directly.
    (xy,) = struct.unpack_from("<f", nifti.read_bytes(), 284)
    edit(nifti, 284, "<f", xy + 0.05)
    about, _ = load_with_itk(nifti, "NiftiImageIO")
    assert about["warnings"] > 0


def test_a_short_nifti_inside_a_whole_archive_is_refused(tmp_path, grid, coded_image):
    path = tmp_path / "image.nii"
    sitk.WriteImage(coded_image(grid), str(path))
    packed = tmp_path / "image.nii.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()[:-20]))
    assert codes(packed) == {"truncated-pixel-data": "H09"}
