"""The self-test's known answers are right: worked out again by other means than the libraries'."""

import hashlib
import io
import json
import math
import struct
from decimal import Decimal, getcontext
from fractions import Fraction

import numpy as np
import pydicom
import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.imaging import golden_dicom, golden_grid, golden_image_files, golden_streams
from hexafix.imaging.metaimage_header import read_metaimage_header
from hexafix.imaging.nifti_header import read_nifti_header
from hexafix.imaging.nrrd_header import read_nrrd_header
from hexafix.paths import resources
from hexafix.selftest import images, motion

getcontext().prec = 50
D = Decimal


def exact(values):
    return [Fraction(repr(value)) for value in values]


def test_the_grids_axes_are_exactly_perpendicular_unit_vectors():
    i, j, n = (exact(v) for v in (golden_grid.ROW, golden_grid.COLUMN, golden_grid.NORMAL))
    for one in (i, j, n):
        assert sum(a * a for a in one) == 1
    assert sum(a * b for a, b in zip(i, j, strict=True)) == 0
    cross = [i[1] * j[2] - i[2] * j[1], i[2] * j[0] - i[0] * j[2], i[0] * j[1] - i[1] * j[0]]
    assert cross == n
    assert exact(golden_grid.AGAINST) == [-Fraction(5, 4) * a for a in n]


def sine_and_cosine(x):
    """By their power series, fifty digits."""
    sine = cosine = D(0)
    term, k = D(1), 0
    while abs(term) > D(10) ** -60:
        sine, cosine = (sine + term, cosine) if k % 2 else (sine, cosine + term)
        k += 1
        # the sign turns at every second term
        term = term * x / k * (1 if k % 2 else -1)
    return sine, cosine


def product(a, b):
    return [
        [sum(x * y for x, y in zip(r, c, strict=True)) for c in zip(*b, strict=True)] for r in a
    ]


def rotation():
    pi = D("3.14159265358979323846264338327950288419716939937510582")
    (sa, ca), (sb, cb), (sc, cc) = (sine_and_cosine(D(d) * pi / 180) for d in (6, -9, 14))
    about_x = [[D(1), D(0), D(0)], [D(0), ca, -sa], [D(0), sa, ca]]
    about_y = [[cb, D(0), sb], [D(0), D(1), D(0)], [-sb, D(0), cb]]
    about_z = [[cc, -sc, D(0)], [sc, cc, D(0)], [D(0), D(0), D(1)]]
    return product(about_z, product(about_y, about_x))


def test_the_golden_rotation_turns_about_fixed_x_then_y_then_z():
    assert tuple(math.radians(d) for d in (6, -9, 14)) == motion.ANGLES_RAD
    assert [[float(v) for v in row] for row in rotation()] == [list(row) for row in motion.ROTATION]


def test_the_golden_lengths_are_those_of_the_shipped_fixators_joints():
    path = resources() / "Hardware" / "Frames" / "generic-6sps-160.json"
    frame = json.loads(path.read_text(), parse_float=D)
    turn, shift = rotation(), [D(repr(v)) for v in motion.POSITION_MM]
    lengths = []
    for a, b in zip(frame["proximal"]["joints_mm"], frame["distal"]["joints_mm"], strict=True):
        moved = [sum(r * x for r, x in zip(row, a, strict=True)) for row in turn]
        strut = [m + p - y for m, p, y in zip(moved, shift, b, strict=True)]
        lengths.append(float(sum(s * s for s in strut).sqrt()))
    assert tuple(lengths) == motion.LENGTHS_MM


def test_the_golden_motion_is_the_exponential_of_its_twist():
    x, y, z, a, b, c = (D(repr(v)) for v in motion.TWIST)
    zero = D(0)
    twist = [[zero, -c, b, x], [c, zero, -a, y], [-b, a, zero, z], [zero] * 4]
    total = term = [[D(int(r == k)) for k in range(4)] for r in range(4)]
    for k in range(1, 60):
        term = [[v / k for v in row] for row in product(term, twist)]
        total = [
            [u + v for u, v in zip(p, q, strict=True)] for p, q in zip(total, term, strict=True)
        ]
    np.testing.assert_allclose(
        [[float(v) for v in row] for row in total[:3]], motion.TWISTED, rtol=1e-15
    )


def a_slice(k, syntax):
    elements = [
        *images.plane_elements(k, golden_grid.place(0, 0, k)),
        *images.rescale_elements(1, 0),
    ]
    codes = golden_grid.codes_of_slice(k)
    pixels = golden_dicom.GoldenPixels(codes, golden_grid.SIZE[1], golden_grid.SIZE[0])
    return golden_dicom.dicom_file(elements, pixels, transfer_syntax=syntax)


@pytest.mark.parametrize("syntax", [images.EXPLICIT, images.IMPLICIT, images.BIG_ENDIAN])
def test_pydicom_reads_our_own_writers_bytes_as_they_were_meant(syntax):
    dataset = pydicom.dcmread(io.BytesIO(a_slice(1, syntax)))
    assert dataset.ImagePositionPatient == list(golden_grid.place(0, 0, 1))
    assert dataset.ImageOrientationPatient == [*golden_grid.ROW, *golden_grid.COLUMN]
    assert dataset.PixelSpacing == [golden_grid.BETWEEN_ROWS, golden_grid.BETWEEN_COLUMNS]
    assert dataset.pixel_array.ravel().tolist() == golden_grid.codes_of_slice(1)
    assert not [element for element in dataset if element.tag.group == 0x0010]


def test_gdcm_reads_our_own_writers_bytes_as_they_were_meant(tmp_path):
    (tmp_path / "1.dcm").write_bytes(a_slice(1, images.EXPLICIT))
    image = sitk.ReadImage(str(tmp_path / "1.dcm"))
    for i, j in ((0, 0), (4, 0), (4, 3)):
        place = image.TransformIndexToPhysicalPoint((i, j, 0))
        np.testing.assert_allclose(place, golden_grid.place(i, j, 1), atol=1e-9)
        assert image[i, j, 0] == golden_grid.code(i, j, 1)


def test_our_own_writers_bytes_are_the_recorded_ones():
    files = b"".join(a_slice(k, images.EXPLICIT) for k in range(3))
    streams = b"".join(
        stream.file for syntax in golden_streams.SYNTAXES
        if (stream := golden_streams.golden_stream(syntax)) and syntax != golden_streams.DEFLATED
    )  # fmt: skip
    readers = golden_image_files.READERS
    others = b"".join(golden_image_files.golden_image_file(reader)[1] for reader in readers)
    found = [hashlib.sha256(content).hexdigest()[:16] for content in (files, streams, others)]
    # slices, compressed streams, image files
    assert found == ["9090e36da9c248d2", "0d0264a097a365b4", "0f62c35c5820f9f4"]


@pytest.mark.parametrize(
    ("reader", "parse"),
    [
        ("NrrdImageIO", read_nrrd_header),
        ("NiftiImageIO", read_nifti_header),
        ("MetaImageIO", read_metaimage_header),
    ],
)
def test_our_own_parsers_place_the_golden_files_by_the_formula(reader, parse, tmp_path):
    suffix, content = golden_image_files.golden_image_file(reader)
    path = tmp_path / f"golden.{suffix}"
    path.write_bytes(content)
    geometry = parse(path)
    assert geometry.size_ijk == golden_grid.SIZE
    for index in ((0, 0, 0), (4, 0, 0), (0, 3, 0), (0, 0, 2), (4, 3, 2)):
        np.testing.assert_allclose(
            geometry.ijk_to_lps @ [*index, 1], [*golden_grid.place(*index), 1], atol=1e-4
        )
    assert np.linalg.det(geometry.ijk_to_lps[:3, :3]) < 0
    order = "<" if suffix == "nii" else ">"
    codes = [code for k in range(3) for code in golden_grid.codes_of_slice(k)]
    assert list(struct.unpack(f"{order}60h", content[-120:])) == codes


def test_the_mirrored_markers_of_the_rigid_fit_stay_twenty_millimetres_away():
    # the best proper rotation of the mirrored points turns about y and misses twice their z
    mirrored = [(-x, y, z) for x, y, z in motion.TETRAHEDRON_MM]
    turned = [(-x, y, -z) for x, y, z in motion.TETRAHEDRON_MM]
    assert [math.dist(a, b) for a, b in zip(mirrored, turned, strict=True)] == [20.0] * 4


def test_a_misplaced_a_missing_and_a_doubled_voxel_are_seen():
    places = [
        (golden_grid.place(i, j, k), golden_grid.code(i, j, k))
        for k in range(3)
        for j in range(4)
        for i in range(5)
    ]
    assert golden_grid.worst_misplacement_mm(places) == 0.0
    (x, y, z), code = places[7]
    moved = [*places[:7], ((x, y + 0.25, z), code), *places[8:]]
    assert golden_grid.worst_misplacement_mm(moved) == pytest.approx(0.25)
    assert golden_grid.worst_misplacement_mm(places[1:]) == math.inf
    assert golden_grid.worst_misplacement_mm([*places, places[0]]) == math.inf
    assert golden_grid.worst_misplacement_mm([*places[1:], (places[0][0], 5)]) == math.inf
