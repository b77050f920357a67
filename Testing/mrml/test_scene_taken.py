"""A scene taken at one moment and written at another, on any thread, packed once."""

import concurrent.futures
import zipfile

import numpy as np
import pytest
from hexafix.errors import Cancelled
from hexafix.imaging import Volume
from hexafix.mrml import HeadlessMrmlApp, SceneLogic
from hexafix.mrml.bundle import TakenBundle

CASE = {"schema_version": 1, "case_id": "case-1"}


def opened(path):
    """Case and volume of a bundle."""
    with HeadlessMrmlApp() as app:
        logic = SceneLogic(app.scene)
        logic.open_bundle(path)
        return logic.case_document_from_scene(), logic.volume_of(logic.volume_node())


def test_what_is_written_is_the_scene_as_it_was_taken(logic, oblique_volume, tmp_path):
    first = oblique_volume()
    logic.add_volume(first)
    logic.save_case_into(CASE)
    taken = logic.take_bundle()
    logic.add_volume(Volume(first.voxels + 7, first.ijk_to_lps))
    logic.save_case_into({**CASE, "case_id": "case-2"})
    with concurrent.futures.ThreadPoolExecutor(1) as thread:
        thread.submit(taken.write, tmp_path / "a.mrb").result()
    case, volume = opened(tmp_path / "a.mrb")
    assert case["case_id"] == "case-1"
    np.testing.assert_array_equal(volume.voxels, first.voxels)
    assert volume.source.warnings == ()


def test_writing_that_is_stopped_leaves_the_older_file_and_no_other(
    logic, oblique_volume, tmp_path
):
    logic.add_volume(oblique_volume())
    taken = TakenBundle(logic.scene)
    (tmp_path / "a.mrb").write_bytes(b"older")

    def stop(step, fraction):
        assert step == "pack the CT"
        raise Cancelled.of("cancelled", "stopped")

    with pytest.raises(Cancelled):
        taken.write(tmp_path / "a.mrb", progress=stop)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mrb"]
    assert (tmp_path / "a.mrb").read_bytes() == b"older"


@pytest.mark.parametrize("dtype", [np.int16, np.float32])
def test_an_image_is_packed_inside_its_own_file_and_there_alone(
    logic, oblique_volume, tmp_path, dtype
):
    told = []
    logic.add_volume(oblique_volume(dtype, size=(90, 80, 150)))
    logic.take_bundle().write(tmp_path / "a.mrb", progress=lambda *now: told.append(now))
    with zipfile.ZipFile(tmp_path / "a.mrb") as archive:
        entry = next(e for e in archive.infolist() if e.filename.endswith(".nrrd"))
        header, _, voxels = archive.read(entry).partition(b"\n\n")
    assert entry.compress_type == zipfile.ZIP_STORED
    assert b"\nencoding: gzip\n" in header + b"\n"
    assert b"raw" not in header
    # the stream tells neither a name nor a time
    assert voxels[:8] == bytes([0x1F, 0x8B, 8, 0, 0, 0, 0, 0])
    assert told[-1] == ("pack the CT", 1.0)
    assert told == sorted(told)


def test_a_scene_of_nothing_but_air_is_no_attack_when_it_comes_back(
    logic, oblique_volume, tmp_path
):
    volume = oblique_volume(size=(120, 120, 120))
    air = Volume(np.full_like(volume.voxels, -1000), volume.ijk_to_lps)
    logic.add_volume(air)
    logic.save_case_into(CASE)
    logic.save_bundle(tmp_path / "a.mrb")
    assert (tmp_path / "a.mrb").stat().st_size * 100 < air.voxels.nbytes
    np.testing.assert_array_equal(opened(tmp_path / "a.mrb")[1].voxels, air.voxels)
