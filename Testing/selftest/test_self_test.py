"""A library with a fault is found, named, and keeps every plan from being made."""

import tempfile

import numpy as np
import pytest
import scipy.linalg.lapack
import scipy.ndimage
import scipy.spatial.transform
from hexafix.errors import SelfTestFailed
from hexafix.imaging import Volume, dicom_header, pixel_data
from hexafix.kinematics import inverse
from hexafix.pipeline import plan_and_export, plan_correction
from hexafix.selftest import motion, require_self_test, run
from hexafix.selftest.foreign import codec_checks, image_file_checks
from scipy.spatial.transform import RigidTransform, Rotation

SABOTAGES = {}


def sabotage(*checks):
    """A fault of a library, and the checks that it makes fail."""
    return lambda apply: SABOTAGES.update({apply.__name__: (apply, set(checks))})


def raw_bytes_changed(monkeypatch, tag, change):
    """Lets pydicom hand out other bytes of one element."""
    read = dicom_header.dcmread

    def faulty(*args, **options):
        dataset = read(*args, **options)
        element = dataset.get_item(tag)
        dataset[tag] = element._replace(value=change(element.value))
        return dataset

    monkeypatch.setattr(dicom_header, "dcmread", faulty)


@sabotage("orientation", "gantry tilt")
def pydicom_turns_the_rows_round(monkeypatch):
    def turned(value):
        cosines = [float(part) for part in value.split(b"\\")]
        return "\\".join(map(str, [*(-v for v in cosines[:3]), *cosines[3:]])).encode()

    raw_bytes_changed(monkeypatch, 0x00200037, turned)


@sabotage("orientation", "gantry tilt")
def pydicom_swaps_the_pixel_spacing(monkeypatch):
    def swapped(value):
        return b"\\".join(reversed(value.strip().split(b"\\")))

    raw_bytes_changed(monkeypatch, 0x00280030, swapped)


@sabotage("Hounsfield units")
def pydicom_loses_the_sign_of_the_intercept(monkeypatch):
    raw_bytes_changed(monkeypatch, 0x00281052, lambda value: value.replace(b"-", b" "))


@sabotage("orientation")
def numpys_matrices_come_transposed(monkeypatch):
    def index(volume, points):
        offset = np.asarray(points, float) - volume.ijk_to_lps[:3, 3]
        return offset @ np.linalg.inv(volume.ijk_to_lps[:3, :3])

    monkeypatch.setattr(Volume, "ijk_from_lps", index)


@sabotage("orientation")
def slices_are_stacked_upside_down(monkeypatch):
    place = Volume.lps_from_ijk

    def upside_down(volume, ijk):
        last = volume.size_ijk[2] - 1
        mirrored = np.asarray(ijk, float) * (1, 1, -1) + (0, 0, last)
        return place(volume, mirrored if volume.source.acquisition is None else ijk)

    monkeypatch.setattr(Volume, "lps_from_ijk", upside_down)


@sabotage("gantry tilt")
def scipys_spline_filter_is_a_voxel_off(monkeypatch):
    monkeypatch.setattr(
        scipy.ndimage, "spline_filter1d", lambda rows, axis, **_: np.roll(rows, 1, axis)
    )


@sabotage("Hounsfield units")
def bytes_are_not_swapped(monkeypatch):
    kind = pixel_data.stored_type
    monkeypatch.setattr(pixel_data, "stored_type", lambda item, **_: kind(item))


@sabotage("X-Y-Z fixed angles")
def angles_turn_about_moving_axes(monkeypatch):
    monkeypatch.setattr(
        motion,
        "matrix_from_xyz_fixed",
        lambda angles: Rotation.from_euler("XYZ", angles).as_matrix(),
    )


@sabotage("rotations")
def scipy_turns_rotation_vectors_backwards(monkeypatch):
    class Backwards:
        @staticmethod
        def from_rotvec(vector):
            return Rotation.from_rotvec(-np.asarray(vector))

    monkeypatch.setattr(motion, "Rotation", Backwards)


@sabotage("rotations")
def scipys_exponential_goes_backwards(monkeypatch):
    class Backwards:
        from_matrix = RigidTransform.from_matrix

        @staticmethod
        def from_exp_coords(coords):
            return RigidTransform.from_exp_coords(-np.asarray(coords))

    monkeypatch.setattr(scipy.spatial.transform, "RigidTransform", Backwards)


@sabotage("rigid fit")
def numpys_determinant_has_no_sign(monkeypatch):
    det = np.linalg.det
    monkeypatch.setattr(np.linalg, "det", lambda matrix: np.abs(det(matrix)))


@sabotage("strut lengths")
def struts_are_counted_from_the_other_end(monkeypatch):
    vectors = inverse.strut_vectors

    def shifted(**given):
        return np.roll(vectors(**given), 1, axis=-2)

    monkeypatch.setattr(inverse, "strut_vectors", shifted)


@sabotage("forward kinematics")
def lapack_solves_with_the_wrong_sign(monkeypatch):
    solve = scipy.linalg.lapack.dgesv

    def wrong(*args, **options):
        *factors, solution, info = solve(*args, **options)
        return *factors, -solution, info

    monkeypatch.setattr(scipy.linalg.lapack, "dgesv", wrong)


LIBRARY = {
    "orientation": "pydicom 3",
    "gantry tilt": "scipy 1",
    "Hounsfield units": "numpy 2",
    "X-Y-Z fixed angles": "numpy 2",
    "rotations": "scipy 1",
    "rigid fit": "numpy 2",
    "strut lengths": "numpy 2",
    "forward kinematics": "scipy 1",
}


def test_the_installed_libraries_pass():
    outcomes = run.run_self_test()
    assert {o.check.name: o.found for o in outcomes} == dict.fromkeys(LIBRARY, "")


@pytest.mark.parametrize("name", SABOTAGES)
def test_a_fault_makes_its_check_fail_and_no_other_and_names_the_library(
    name, monkeypatch, not_yet_passed
):
    apply, expected = SABOTAGES[name]
    apply(monkeypatch)
    with pytest.raises(SelfTestFailed) as caught:
        require_self_test()
    assert caught.value.exit_code == 3
    faults = {fault.what.split(": ")[0].removeprefix("self-test "): fault for fault in
              caught.value.faults}  # fmt: skip
    assert set(faults) == expected
    for check, fault in faults.items():
        assert (fault.code, fault.hazard) == ("self-test", "H54")
        assert LIBRARY[check] in fault.message
        assert fault.value
        assert fault.limit
        assert "hexafix selftest" in fault.next_step


def test_every_check_has_a_fault_that_it_finds():
    found = set().union(*(checks for _, checks in SABOTAGES.values()))
    assert found == set(LIBRARY)


def test_an_error_in_a_check_is_a_wrong_answer(monkeypatch):
    monkeypatch.setattr(motion, "kabsch", lambda **_: 1 / 0)
    (outcome,) = [o for o in run.run_self_test() if not o.passed]
    assert (outcome.check.name, outcome.found) == ("rigid fit", "ZeroDivisionError")


@pytest.fixture
def a_faulty_library(monkeypatch, not_yet_passed):
    numpys_determinant_has_no_sign = SABOTAGES["numpys_determinant_has_no_sign"][0]
    numpys_determinant_has_no_sign(monkeypatch)


@pytest.mark.usefixtures("a_faulty_library")
def test_plan_refuses_before_the_image_is_read_and_writes_nothing(
    a_phantom, a_phantom_case, tmp_path
):
    steps = []
    out = tmp_path / "out"
    with pytest.raises(SelfTestFailed):
        plan_and_export(
            a_phantom_case(), out, volume=a_phantom.volume, progress=lambda *s: steps.append(s)
        )
    assert steps == []
    assert not out.exists()
    with pytest.raises(SelfTestFailed):
        plan_correction(a_phantom_case(), volume=a_phantom.volume)


def test_it_runs_once_a_process_while_the_versions_stay(monkeypatch, not_yet_passed):
    runs = []
    monkeypatch.setattr(run, "checks", lambda: runs.append(1) or [])
    require_self_test()
    require_self_test()
    assert len(runs) == 1
    monkeypatch.setattr(np, "__version__", "2.99.0")
    require_self_test()
    assert len(runs) == 2


def test_a_failure_is_not_remembered_as_passed(monkeypatch, not_yet_passed):
    with monkeypatch.context() as faulty:
        SABOTAGES["lapack_solves_with_the_wrong_sign"][0](faulty)
        for _ in range(2):
            with pytest.raises(SelfTestFailed):
                require_self_test()
    require_self_test()


@pytest.mark.parametrize("faulty", [False, True])
def test_nothing_is_left_in_the_temporary_folder(
    faulty, monkeypatch, tmp_path, mirrors, in_every_child
):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    if faulty:
        SABOTAGES["pydicom_turns_the_rows_round"][0](monkeypatch)
        in_every_child(mirrors)
    outcomes = [*run.run_self_test(), image_file_checks()[0].run(), codec_checks()[0].run()]
    assert all(o.passed for o in outcomes) is not faulty
    assert list(tmp_path.iterdir()) == []
