"""The processes that read image files and decode pixels are proved before the user's bytes."""

import json
import os
import subprocess
import sys

import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.cli import main
from hexafix.errors import SelfTestFailed
from hexafix.imaging import read_volume
from hexafix.imaging.golden_dicom import GoldenPixels, dicom_file
from hexafix.imaging.golden_grid import place
from hexafix.imaging.golden_streams import SYNTAXES, golden_stream
from hexafix.selftest import foreign, images
from hexafix.selftest.foreign import image_file_checks

SUFFIXES = {"nrrd": "NrrdImageIO", "nii": "NiftiImageIO", "mha": "MetaImageIO"}
OTHER_FAULTS = {
    "a voxel is lost": """
import SimpleITK
read = SimpleITK.GetArrayFromImage
SimpleITK.GetArrayFromImage = lambda image: read(image)[:-1]
""",
    "the direction loses its sign": """
import SimpleITK
direction = SimpleITK.Image.GetDirection
SimpleITK.Image.GetDirection = lambda image: tuple(abs(v) for v in direction(image))
""",
    "the bytes are not swapped": """
import SimpleITK
read = SimpleITK.GetArrayFromImage
SimpleITK.GetArrayFromImage = lambda image: read(image).byteswap()
""",
    "it does not load": "import sys; sys.modules['SimpleITK'] = None",
}


def an_image(path):
    """An ordinary right-handed file, in which a faulty reader's mirroring would not show."""
    sitk.WriteImage(sitk.Image([4, 5, 6], sitk.sitkInt16) - 1000, str(path))
    return path


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_simpleitk_that_mirrors_never_gets_to_the_users_file(
    suffix, tmp_path, mirrors, in_every_child
):
    path = an_image(tmp_path / f"image.{suffix}")
    assert read_volume(path).size_ijk == (4, 5, 6)
    in_every_child(mirrors)
    with pytest.raises(SelfTestFailed) as caught:
        read_volume(path)
    (fault,) = caught.value.faults
    assert (fault.code, fault.hazard) == ("self-test", "H54")
    assert f"SimpleITK {sitk.__version__}" in fault.message
    assert SUFFIXES[suffix] in fault.message
    assert fault.value == "2.5 mm"


@pytest.mark.parametrize("fault", OTHER_FAULTS)
def test_other_faults_of_simpleitk_are_found_too(fault, in_every_child):
    in_every_child(OTHER_FAULTS[fault])
    outcome = image_file_checks()[1].run()
    assert outcome.found
    assert "SimpleITK" in outcome.fault.message


CODECS = {
    syntax: name for syntax, name in SYNTAXES.items() if name in ("deflated", "RLE", "JPEG 2000")
}


@pytest.fixture
def a_compressed_series(tmp_path):
    """Three slices that hold the golden image of a transfer syntax as a user's pixels."""

    def write(syntax):
        stream = golden_stream(syntax)
        start = stream.file.rfind(b"\xfe\xff\x00\xe0") + 8
        data = None if SYNTAXES[syntax] == "deflated" else stream.file[start:-8]
        for k in range(3):
            elements = [*images.plane_elements(k, place(0, 0, k)), *images.rescale_elements(1, 0)]
            pixels = GoldenPixels(stream.pixels.values, stream.pixels.rows, stream.pixels.columns,
                                  bits_stored=stream.pixels.bits_stored)  # fmt: skip
            path = tmp_path / f"{k}.dcm"
            path.write_bytes(dicom_file(elements, pixels, transfer_syntax=syntax, stream=data))
        return tmp_path

    return write


@pytest.mark.parametrize("syntax", CODECS, ids=CODECS.get)
def test_a_decoder_that_turns_pixels_round_never_gets_to_the_users(
    syntax, a_compressed_series, in_every_child
):
    folder = a_compressed_series(syntax)
    expected = golden_stream(syntax).pixels
    assert read_volume(folder).voxels[1].ravel().tolist() == list(expected.values)
    in_every_child("""
import pydicom.pixels.utils as utils
read = utils.pixel_array
utils.pixel_array = lambda *a, **k: read(*a, **k)[:, ::-1]
""")
    with pytest.raises(SelfTestFailed) as caught:
        read_volume(folder)
    (fault,) = caught.value.faults
    assert (fault.code, fault.hazard) == ("self-test", "H54")
    assert f"pydicom {__import__('pydicom').__version__}" in fault.message
    assert CODECS[syntax] in fault.message
    assert fault.value == f"{len(expected.values)} other pixels"


def selftest(*options):
    run = subprocess.run(
        [sys.executable, "-m", "hexafix", *options],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ
        | {
            "PYTHONPATH": os.pathsep.join(
                [os.environ.get("PYTHONPATH", ""), *filter(None, sys.path)]
            )
        },
    )
    assert "Traceback" not in run.stderr
    return run


def test_the_command_tells_every_check_its_library_and_its_time():
    run = selftest("selftest", "--json")
    assert run.returncode == 0
    document = json.loads(run.stdout)
    assert document["passed"] is True
    assert "refused" not in document
    names = " ".join(check["name"] for check in document["checks"])
    assert all(name in names for name in (*SUFFIXES.values(), *SYNTAXES.values(), "orientation"))
    assert len(document["checks"]) == 8 + len(SUFFIXES) + len(SYNTAXES)
    for check in document["checks"]:
        assert {"name", "library", "passed", "expected", "seconds"} == set(check)
    assert {"numpy", "scipy", "pydicom", "SimpleITK", "vtk", "typst"} <= set(document["versions"])


def test_the_command_refuses_and_names_the_library(mirrors, in_every_child, monkeypatch, capsys):
    in_every_child(mirrors)
    monkeypatch.setattr(foreign, "codec_checks", list)
    with pytest.raises(SystemExit) as ended:
        main(["selftest"])
    assert ended.value.code == 3
    text = capsys.readouterr().out
    assert "REFUSED [H54]" in text
    assert f"SimpleITK {sitk.__version__} does not give the known answer" in text
    assert "FAIL  image files (NrrdImageIO)" in text
    assert "pass  orientation" in text


def test_the_version_option_names_every_library_whose_fault_could_matter():
    lines = selftest("--version").stdout.splitlines()
    assert lines[0].startswith("hexafix ")
    named = {line.split()[0] for line in lines}
    assert {"python", "numpy", "scipy", "pydicom", "SimpleITK", "vtk", "typst", "pypdfium2",
            "pylibjpeg-openjpeg", "pylibjpeg-libjpeg"} <= named  # fmt: skip
