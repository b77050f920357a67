"""Case and CT of a scene's file: exactly what was saved, or the whole file is refused."""

import gzip
import json
import re
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hexafix.errors import Cancelled, InputError
from hexafix.imaging import read_volume
from hexafix.imaging.fingerprint import fingerprint
from hexafix.imaging.volume import Acquisition, ImageSource, Volume
from hexafix.mrml import HeadlessMrmlApp, SceneLogic, bundle_content, markups, open_bundle
from hexafix.mrml.scene_file import read_scene
from hexafix.presenter import Presenter, Step

SCENE, IMAGE = "hexafix/scene.mrml", "hexafix/Data/volume.nrrd"

CASE = {
    "schema_version": 1,
    "case_id": 'a "b" <c> & ; : = % %20 %3B é 髓',
    "image": {"path": "/home/Doe", "series_instance_uid": "1.2.3"},
    "strut_readings_mm": [180.0, 175.125, 0.1, 168.0, 157.0, 1e-7],
    "marker_edits": {"added_lps_mm": [[1.0, -2.5, 3.0]], "removed_lps_mm": []},
}
WARNINGS = ('lossy; (H10): 100 % "sure" & <so>', "thick: slices", "é")
TOLD = "ab" * 32


def known(volume, **more):
    """The volume as a reader gives it: with the hash of its voxels and place."""
    found = fingerprint(volume.voxels, volume.ijk_to_lps)
    given = {"kind": "dicom", "sha256": found, "laterality": "L", "slice_thickness_mm": 0.625}
    return Volume(volume.voxels, volume.ijk_to_lps, ImageSource(**{**given, **more}))


def save(folder, volume, case=CASE, **shell):
    """A scene's file with a CT, a list of points and a case; the logic is closed again."""
    path = folder / "scene.mrb"
    with HeadlessMrmlApp() as app:
        logic = SceneLogic(app.scene)
        if volume is not None:
            logic.add_volume(volume)
        point = markups.Point((1.0, 2.0, 3.0), "1", "proximal ring", 0)
        markups.put_points(app.scene, "markups/proximal", "P", [point], colour=(0, 1.0, 0))
        if case is not None:
            logic.save_case_into(case, case_sha256=TOLD, **shell)
        logic.save_bundle(path)
    return path


@dataclass
class Lab:
    """A sound scene to spoil, and a presenter with a case open."""

    files: dict[str, bytes]
    folder: Path
    presenter: Presenter
    quiet: set[str]

    def write(self, changed=None):
        path = self.folder / "spoiled.mrb"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
            for name, content in {**self.files, **(changed or {})}.items():
                packed.writestr(name, content)
        return path

    def scene(self, old, new, *, count=1):
        text = self.files[SCENE].decode()
        assert old in text
        return {SCENE: text.replace(old, new, count).encode()}

    def node(self, tag, pattern, new):
        """The scene with one place of one element changed."""
        text = self.files[SCENE].decode()
        start = re.search(rf"<{tag}\s", text).start()
        end = text.index(">", start)
        element, count = re.subn(pattern, new, text[start:end], count=1)
        assert count == 1
        return {SCENE: (text[:start] + element + text[end:]).encode()}

    def image(self, *, header=lambda text: text, voxels=lambda raw: raw):
        """The image file with other words or other voxels."""
        raw = self.files[IMAGE]
        at = raw.index(b"\n\n") + 2
        words = header(raw[:at].decode())
        packed = gzip.compress(voxels(gzip.decompress(raw[at:])))
        assert (words.encode(), packed) != (raw[:at], raw[at:])
        return {IMAGE: words.encode() + packed}

    def refused(self, changed=None, *, path=None):
        """The codes of the refusal; neither the open case nor what it shows has changed."""
        path = path or self.write(changed)
        presenter = self.presenter
        before, shown = presenter.version, presenter.snapshot
        assert presenter.open_scene(path)
        after = presenter.snapshot
        assert presenter.version is before
        assert presenter.is_fresh(Step.LOAD)
        assert (after.steps, after.document) == (shown.steps, shown.document)
        told = [banner for banner in after.banners if banner.id not in self.quiet]
        assert all(banner.kind in ("refused", "error") for banner in told)
        assert all(banner.hazard or banner.code == "no-case-in-scene" for banner in told)
        assert not any(str(self.folder) in banner.message for banner in told)
        return {banner.code for banner in told}


@pytest.fixture(scope="module")
def sound(oblique_volume, tmp_path_factory):
    """A saved scene, and the CT in it."""
    volume = known(oblique_volume(), warnings=WARNINGS)
    return save(tmp_path_factory.mktemp("sound"), volume, step="poses", splitFraction=0.3), volume


@pytest.fixture(scope="module")
def sound_files(sound):
    with zipfile.ZipFile(sound[0]) as packed:
        return {name: packed.read(name) for name in packed.namelist()}


@pytest.fixture(scope="module")
def a_presenter(sound):
    """With the sound scene itself open: nothing below changes that."""
    presenter = Presenter(threaded=False, read_scene=read_scene)
    assert presenter.open_scene(sound[0])
    assert presenter.is_fresh(Step.LOAD)
    yield presenter
    presenter.close()


@pytest.fixture(scope="module")
def images():
    """Images that were read, by the bytes of their files."""
    return {}


@pytest.fixture
def lab(sound_files, a_presenter, images, tmp_path, monkeypatch):
    def read_once(path, **more):
        raw = path.read_bytes()
        if raw not in images:
            images[raw] = read_volume(path, **more)
        return images[raw]

    monkeypatch.setattr(bundle_content, "read_volume", read_once)
    a_presenter.go_to(Step.POSES)  # what was told of another test's scene goes
    quiet = {banner.id for banner in a_presenter.snapshot.banners}
    return Lab(sound_files, tmp_path, a_presenter, quiet)


# ---------------------------------------------------------------- what was saved comes back


def test_case_and_ct_come_back_to_the_last_bit(sound):
    content, volume = read_scene(sound[0]), sound[1]
    bare = {**CASE, "image": {"path": "volume-node", "series_instance_uid": None}}
    assert content.document == bare
    assert (content.case_sha256, content.step, content.split_fraction) == (TOLD, "poses", 0.3)
    assert content.volume.voxels.dtype == volume.voxels.dtype
    np.testing.assert_array_equal(content.volume.voxels, volume.voxels)
    np.testing.assert_array_equal(content.volume.ijk_to_lps, volume.ijk_to_lps)
    assert content.volume.source == volume.source


def test_it_is_what_mrml_reads_of_the_same_file(sound):
    content = read_scene(sound[0])
    with HeadlessMrmlApp() as app:
        open_bundle(app.scene, sound[0])
        logic = SceneLogic(app.scene)
        volume = logic.volume_of(logic.volume_node())
        assert logic.case_document_from_scene() == content.document
    np.testing.assert_array_equal(content.volume.voxels, volume.voxels)
    np.testing.assert_array_equal(content.volume.ijk_to_lps, volume.ijk_to_lps)
    assert content.volume.source == volume.source


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("dtype", [np.int16, np.float32])
def test_a_stack_of_either_hand_comes_back(oblique_volume, tmp_path, dtype, mirrored):
    volume = oblique_volume(dtype, mirrored=mirrored)
    volume = known(
        Volume(volume.voxels + dtype(0.25), volume.ijk_to_lps) if dtype is np.float32 else volume
    )
    back = read_scene(save(tmp_path, volume)).volume
    assert back.voxels.dtype == dtype
    np.testing.assert_array_equal(back.voxels, volume.voxels)
    np.testing.assert_array_equal(back.ijk_to_lps, volume.ijk_to_lps)


def test_a_tilted_acquisition_comes_back_with_the_hash_of_its_slices(oblique_volume, tmp_path):
    volume = oblique_volume()
    acquired = Acquisition(volume.ijk_to_lps + np.eye(4), (9, 8, 5), 12.5)
    volume = known(volume, sha256="cd" * 32, acquisition=acquired)
    source = read_scene(save(tmp_path, volume)).volume.source
    np.testing.assert_array_equal(source.acquisition.ijk_to_lps, acquired.ijk_to_lps)
    assert replace(source, acquisition=None) == replace(volume.source, acquisition=None)


def test_a_draft_without_ct_comes_back(tmp_path):
    content = read_scene(save(tmp_path, None, {"schema_version": 2, "case_id": "a"}))
    assert content.volume is None
    assert content.document["case_id"] == "a"


def test_reading_can_be_stopped_at_every_report(sound):
    reports = []
    read_scene(sound[0], progress=lambda text, fraction: reports.append(text))
    assert len(reports) > 3
    for stop in range(len(reports)):
        left = iter(range(stop))

        def progress(text, fraction, left=left):
            if next(left, None) is None:
                raise Cancelled.of("cancelled", "stopped")

        with pytest.raises(Cancelled):
            read_scene(sound[0], progress=progress)


# ---------------------------------------------------------------- the CT is another one (H01)


def flipped(raw, axis):
    return np.flip(np.frombuffer(raw, "<i2").reshape(7, 8, 9), axis).tobytes()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_mirrored_voxels_are_refused(lab, axis):
    assert lab.refused(lab.image(voxels=lambda raw: flipped(raw, axis))) == {"scene-volume-changed"}


def test_mirrored_voxels_of_a_tilted_acquisition_are_refused(lab, oblique_volume, tmp_path):
    """The hash of its slices says nothing of the moved voxels: theirs does."""
    volume = oblique_volume()
    acquired = Acquisition(volume.ijk_to_lps, (9, 8, 5), 12.5)
    (tmp_path / "other").mkdir()
    path = save(tmp_path / "other", known(volume, sha256="cd" * 32, acquisition=acquired))
    with zipfile.ZipFile(path) as packed:
        lab.files = {name: packed.read(name) for name in packed.namelist()}
    changed = lab.image(voxels=lambda raw: flipped(raw, 0))
    assert lab.refused(changed) == {"scene-volume-changed"}


def test_one_changed_voxel_is_refused(lab):
    def change(raw):
        return raw[:200] + bytes([raw[200] ^ 1]) + raw[201:]

    assert lab.refused(lab.image(voxels=change)) == {"scene-volume-changed"}


def mirror_directions(text):
    """The first axis runs the other way."""
    return re.sub(
        r"space directions: \(([^)]*)\)",
        lambda m: f"space directions: ({','.join(str(-float(x)) for x in m[1].split(','))})",
        text,
    )


@pytest.mark.parametrize(
    "header",
    [
        mirror_directions,
        lambda text: text.replace("left-posterior-superior", "right-anterior-superior"),
        lambda text: re.sub(r"space origin: \(-?\d", "space origin: (7", text),
        lambda text: text.replace("type: short", "type: unsigned short"),
    ],
)
def test_an_image_in_another_place_or_of_another_type_is_refused(lab, header):
    assert lab.refused(lab.image(header=header)) == {"scene-volume-changed"}


@pytest.mark.parametrize(
    ("pattern", "new"),
    [
        (r"ijk_to_lps:\[\[0", "ijk_to_lps:[[1"),
        (r"ijk_to_lps:\[\[", "ijk_to_lps:[[["),
        (r"content_sha256:[0-9a-f]", "content_sha256:x"),
        (r"sha256&quot;: &quot;[0-9a-f]", "sha256&quot;: &quot;x"),
        (r"&quot;dicom&quot;", "&quot;paper&quot;"),
        (r"&quot;dicom&quot;", "5"),
        (r"0\.625", "NaN"),
        (r"0\.625", "&quot;thick&quot;"),
        (r"&quot;laterality&quot;: &quot;L&quot;", "&quot;laterality&quot;: [1]"),
        (r"&quot;warnings&quot;: \[", "&quot;warnings&quot;: [3, "),
        (r"HexaFix\.source:", "HexaFix.sources:"),
        (r"HexaFix\.ijk_to_lps:", "HexaFix.ijk_to_ras:"),
    ],
)
def test_what_was_known_of_the_ct_must_be_as_it_was(lab, pattern, new):
    assert lab.refused(lab.node("Volume", pattern, new)) == {"scene-volume-changed"}


def test_a_ct_that_hexafix_did_not_read_is_refused(lab):
    changed = lab.node("Volume", r"HexaFix\.content_sha256:[0-9a-f]+;", "")
    assert lab.refused(changed) == {"scene-volume-foreign"}


@pytest.mark.parametrize(
    ("tag", "pattern", "new"),
    [
        ("Volume", 'references="', 'references="transform:vtkMRMLLinearTransformNode1;'),
        ("Volume", 'name="CT"', 'name="CT" transformNodeRef="vtkMRMLLinearTransformNode1"'),
        ("VolumeArchetypeStorage", 'centerImage="0"', 'centerImage="1"'),
        ("Volume", "HexaFix.role:volume", "HexaFix.role:model/volume"),
    ],
)
def test_a_ct_that_stands_elsewhere_than_its_file_says_is_refused(lab, tag, pattern, new):
    assert lab.refused(lab.node(tag, pattern, new)) == {"scene-volume-moved"}


@pytest.mark.parametrize(
    ("tag", "pattern", "new"),
    [
        ("Volume", "storage:vtk", "storage:xtk"),
        ("Volume", "^<Volume", '<Volume id="a" name="b"></Volume><Volume'),
        ("VolumeArchetypeStorage", "^<Vol", '<VolumeArchetypeStorage id="a"/><Vol'),
        ("ScriptedModule", "HexaFix.role:parameters", "HexaFix.role:volume"),
    ],
)
def test_a_scene_that_names_its_ct_twice_or_not_is_refused(lab, tag, pattern, new):
    assert lab.refused(lab.node(tag, pattern, new)) == {"bundle-damaged"}


@pytest.mark.parametrize(
    "element",
    [
        '<Volume id="a" name="b"></Volume>',
        '<VolumeArchetypeStorage id="a" fileName="Data/volume.nrrd"/>',
        '<ScriptedModule singletonTag="HexaFixModule" ModuleName="HexaFixModule"/>',
    ],
)
def test_a_second_ct_or_case_behind_the_first_is_refused(lab, element):
    assert lab.refused(lab.scene("</MRML>", f"{element}</MRML>")) == {"bundle-damaged"}


def test_a_second_image_is_refused(lab):
    assert lab.refused({"hexafix/Data/other.nrrd": lab.files[IMAGE]}) == {"bundle-damaged"}


def test_two_nodes_of_one_role_are_refused(lab):
    changed = lab.node("MarkupsFiducial", r"HexaFix\.role:markups/proximal", "HexaFix.role:volume")
    assert lab.refused(changed) == {"bundle-damaged"}


def test_an_image_without_its_node_is_refused(lab):
    text = lab.files[SCENE].decode()
    bare = re.sub(r"<Volume\s[^>]*></Volume>", "", text)
    assert bare != text
    assert lab.refused({SCENE: bare.encode()}) == {"bundle-damaged"}


# ---------------------------------------------------------------- the case is another one


@pytest.mark.parametrize(
    ("pattern", "new"),
    [
        (r"180\.0", "181.0"),
        (r"caseJsonSha256 [0-9a-f]", "caseJsonSha256 x"),
        (r"caseFileSha256 [0-9a-f]", "caseFileSha256 x"),
        (r"caseFileSha256 [0-9a-f]+", "caseFileSha256 "),
    ],
)
def test_a_case_that_was_changed_in_the_file_is_refused(lab, pattern, new):
    assert lab.refused(lab.node("ScriptedModule", pattern, new)) == {"scene-case-changed"}


@pytest.mark.parametrize(
    ("pattern", "new", "code"),
    [
        (r"splitFraction 0\.3", "splitFraction nan", "bundle-damaged"),
        (r"splitFraction 0\.3", "splitFraction half", "parameter-value"),
        (r"acceptRelaxedLayout False", "acceptRelaxedLayout 1", "parameter-value"),
        (r"step poses", "splitFraction 0.4", "bundle-damaged"),
        (r"step poses", "step", "bundle-damaged"),
        (r'"caseJson [^"]*"', '"caseJson "', "no-case-in-scene"),
        (r"HexaFix\.role:parameters", "HexaFix.role:other", "no-case-in-scene"),
        ("^<Scr", '<ScriptedModule singletonTag="HexaFixModule" ModuleName="HexaFixModule"/><Scr',
         "bundle-damaged"),
    ],
)  # fmt: skip
def test_parameters_of_another_kind_are_refused(lab, pattern, new, code):
    assert lab.refused(lab.node("ScriptedModule", pattern, new)) == {code}


def test_a_scene_without_a_case_is_refused(lab, oblique_volume, tmp_path):
    (tmp_path / "other").mkdir()
    path = save(tmp_path / "other", known(oblique_volume()), None)
    assert lab.refused(path=path) == {"no-case-in-scene"}


# ---------------------------------------------------------------- hostile, damaged, foreign


@pytest.mark.parametrize(
    ("name", "content", "code"),
    [
        ("../evil.vtp", b"x", "bundle-path"),
        ("hexafix/Data/a.tsv", bytes(1 << 24), "bundle-too-large"),
        ("hexafix/Data/a.pkl", b"cos\nsystem\n", "bundle-foreign-file"),
        ("hexafix/Data/a.tsv", b"\0", "bundle-damaged"),
        ("hexafix/other/scene.mrml", b"<MRML/>", "bundle-damaged"),
    ],
)
def test_a_hostile_entry_refuses_the_whole_scene(lab, name, content, code):
    assert lab.refused({name: content}) == {code}


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("<Crosshair", "<Segmentation", "bundle-foreign-node"),
        ('ModuleName ="HexaFixModule"', 'ModuleName ="os"', "bundle-foreign-module"),
        ("Data/volume.nrrd", "../volume.nrrd", "bundle-reference"),
        ("<MRML", "<!DOCTYPE a [<!ENTITY b 'c'>]><MRML", "bundle-damaged"),
        ("</MRML>", "", "bundle-damaged"),
    ],
)
def test_a_scene_of_another_program_or_a_broken_one_is_refused(lab, old, new, code):
    assert code in lab.refused(lab.scene(old, new))


def test_points_that_do_not_say_lps_refuse_the_scene_though_they_are_not_used(lab):
    (name,) = (name for name in lab.files if name.endswith(".mrk.json"))
    content = json.loads(lab.files[name])
    content["markups"][0]["coordinateSystem"] = "RAS"
    assert lab.refused({name: json.dumps(content).encode()}) == {"bundle-frame"}


@pytest.mark.parametrize("spoil", [lambda raw: raw[:-300], lambda raw: b"", lambda raw: b"{}"])
def test_a_file_that_is_no_archive_is_an_error(lab, spoil):
    path = lab.write()
    path.write_bytes(spoil(path.read_bytes()))
    assert lab.refused(path=path) == {"bundle-unreadable"}


def test_a_missing_file_is_an_error(tmp_path):
    with pytest.raises(InputError):
        read_scene(tmp_path / "none.mrb")


def test_a_ct_whose_voxels_are_cut_short_is_refused(lab):
    assert lab.refused(lab.image(voxels=lambda raw: raw[:-100])) == {"corrupt-pixel-data"}
