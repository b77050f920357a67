"""Bundles made to harm: each is refused whole, and the scene stays as it was (H48, H49, H50)."""

import json
import re
import struct
import warnings
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hexafix import surfaces
from hexafix.errors import HexaFixError, InputError, Refused
from hexafix.mrml import HeadlessMrmlApp, SceneLogic, archive, markups, models, open_bundle
from hexafix.mrml.mesh_file import check_mesh
from hexafix.mrml.nodes import ensure
from hexafix.mrml.tables import put_strut_table

SCENE = "hexafix/scene.mrml"


def entry(name, mode=0o100644):
    made = zipfile.ZipInfo(name)
    made.external_attr = mode << 16
    made.compress_type = zipfile.ZIP_DEFLATED
    return made


@dataclass
class Lab:
    """A sound little bundle to spoil, and a scene to open it in."""

    logic: SceneLogic
    files: dict[str, bytes]
    folder: Path

    def write(self, files=None, extra=()):
        path = self.folder / "spoiled.mrb"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # two entries of one name
            with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
                for name, content in (files or self.files).items():
                    packed.writestr(entry(name), content)
                for item, content in extra:
                    packed.writestr(item, content)
        return path

    def state(self):
        nodes = self.logic.scene.GetNodes()
        listed = [nodes.GetItemAsObject(k) for k in range(nodes.GetNumberOfItems())]
        return [(n.GetID(), n.GetName(), n.GetMTime()) for n in listed]

    def refused(self, path):
        before = self.state()
        with pytest.raises(HexaFixError) as caught:
            open_bundle(self.logic.scene, path)
        assert self.state() == before, "the scene stays as it was"
        text = str(caught.value)
        assert str(self.folder) not in text
        ours = [fault for fault in caught.value.faults if fault.code.startswith("bundle")]
        assert all(fault.hazard and fault.next_step for fault in ours)
        return {fault.code for fault in caught.value.faults}


@pytest.fixture(scope="module")
def sound(oblique_volume, tmp_path_factory):
    """The files of a bundle with one node of each kind."""
    path = tmp_path_factory.mktemp("sound") / "sound.mrb"
    schedule = {
        "strut_step_mm": 0.5,
        "rows": [
            {"day": 0, "date": "2026-12-01", "adjustment": 0, "strut_mm": [180.0] * 6},
            {"day": 1, "date": "2026-12-01", "adjustment": 1, "strut_mm": [180.5] * 6},
        ],
    }
    with HeadlessMrmlApp() as app:
        logic = SceneLogic(app.scene)
        logic.add_volume(oblique_volume())
        logic.show_target(np.eye(4) + np.eye(4, k=3), "proximal")
        logic.save_case_into({"schema_version": 1, "case_id": "case-1"})
        ball = surfaces.spheres([[1.0, 2, 3]], diameters_mm=4.0)
        models.put_model(app.scene, "model/a", "A", ball, colour=(1.0, 0, 0))
        point = markups.Point((1.0, 2.0, 3.0), "1", "proximal ring", 0)
        markups.put_points(app.scene, "markups/proximal", "P", [point], colour=(0, 1.0, 0))
        put_strut_table(app.scene, {"schedule": schedule})
        logic.save_bundle(path)
    with zipfile.ZipFile(path) as packed:
        return {name: packed.read(name) for name in packed.namelist()}


@pytest.fixture
def lab(sound, logic, tmp_path):
    ensure(logic.scene, "vtkMRMLModelNode", "model/mine", "mine")
    return Lab(logic, dict(sound), tmp_path)


def test_the_sound_bundle_opens_so_that_what_follows_can_fail(lab):
    open_bundle(lab.logic.scene, lab.write())
    assert lab.logic.volume_of(lab.logic.volume_node()).source.warnings == ()


# ---------------------------------------------------------------- H48: the archive

PATHS = [
    "../evil.vtp",
    "hexafix/../../evil.vtp",
    "/tmp/evil.vtp",
    "C:/evil.vtp",
    "hexafix\\..\\..\\evil.vtp",
    "hexafix/./evil.vtp",
    "hexafix//evil.vtp",
    "hexafix/Data/evil.vtp ",
    "hexafix/Data/evil\n.vtp",
    "hexafix/" + 300 * "a" + ".vtp",
]


@pytest.mark.parametrize("name", PATHS)
def test_a_name_that_leads_out_of_the_folder_is_refused(lab, name):
    assert lab.refused(lab.write(extra=[(entry(name), b"x")])) == {"bundle-path"}
    assert not Path("/tmp/evil.vtp").exists()


def test_a_name_that_a_zero_cuts_short_is_refused(lab):
    path = lab.write(extra=[(entry("hexafix/Data/evilX.vtp"), b"x")])
    raw = path.read_bytes()
    assert raw.count(b"evilX") == 2
    path.write_bytes(raw.replace(b"evilX", b"evil\0"))
    assert "bundle-path" in lab.refused(path)


@pytest.mark.parametrize("name", ["hexafix/Data/volume.nrrd", "hexafix/Data/VOLUME.nrrd"])
def test_two_entries_of_one_name_are_refused(lab, name):
    codes = lab.refused(lab.write(extra=[(entry(name), lab.files["hexafix/Data/volume.nrrd"])]))
    assert codes == {"bundle-path"}


@pytest.mark.parametrize(
    "mode", [0o120777, 0o060644, 0o020644, 0o010644], ids=["link", "block", "character", "fifo"]
)
def test_a_link_or_device_is_refused(lab, mode):
    item = entry("hexafix/Data/evil.vtp", mode)
    assert lab.refused(lab.write(extra=[(item, b"/etc/passwd")])) == {"bundle-link"}


def test_a_bomb_is_refused_by_its_ratio(lab):
    assert lab.refused(lab.write(extra=[(entry("hexafix/Data/a.tsv"), bytes(1 << 24))])) == {
        "bundle-too-large"
    }


def test_more_than_four_gigabytes_are_refused_before_a_byte_is_written(lab, monkeypatch):
    assert archive.MAX_TOTAL_BYTES == 4 * 1024**3
    assert (archive.MAX_RATIO, archive.MAX_ENTRIES) == (100, 20_000)
    monkeypatch.setattr(archive, "_extract", lambda *_: pytest.fail("unpacked"))
    path = lab.write(extra=[(entry("hexafix/Data/a.tsv"), b"x" * 70_000)])
    raw = path.read_bytes()
    at = raw.rfind(b"PK\x01\x02")
    head = bytearray(raw)
    # what the table of contents states of the last entry: 60 MB packed, nearly 4 GB unpacked
    struct.pack_into("<LL", head, at + 20, 60_000_000, 0xFFFFFFF0)
    path.write_bytes(head)
    with pytest.raises(Refused, match="bytes unpacked"):
        open_bundle(lab.logic.scene, path)


def test_more_than_twenty_thousand_entries_are_refused(lab):
    extra = [(entry(f"hexafix/Data/{k}.tsv"), b"") for k in range(20_001)]
    assert lab.refused(lab.write(extra=extra)) == {"bundle-too-large"}


def test_a_table_of_contents_too_long_to_read_is_refused(lab, monkeypatch):
    path = lab.write()
    raw = bytearray(path.read_bytes())
    at = raw.rfind(b"PK\x05\x06")
    struct.pack_into("<L", raw, at + 12, 0x7FFFFFFF)
    path.write_bytes(raw)
    monkeypatch.setattr(zipfile, "ZipFile", lambda *_: pytest.fail("read"))
    assert lab.refused(path) == {"bundle-too-large"}


def test_an_entry_larger_than_it_states_is_refused(lab):
    path = lab.write(extra=[(entry("hexafix/Data/a.tsv"), bytes(range(256)) * 400)])
    raw = bytearray(path.read_bytes())
    for magic, offset in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        struct.pack_into("<L", raw, raw.rfind(magic) + offset, 500)
    path.write_bytes(raw)
    assert lab.refused(path) == {"bundle-unreadable"}


def test_entries_that_share_their_bytes_are_refused(lab):
    """The bomb whose thousand entries are one."""
    noise = np.random.default_rng(3).bytes(100_000)
    path = lab.write(extra=[(entry(f"hexafix/Data/{k}.tsv"), noise) for k in range(2)])
    raw = bytearray(path.read_bytes())
    last = raw.rfind(b"PK\x01\x02")
    first = raw.rfind(b"PK\x01\x02", 0, last)
    raw[last + 42 : last + 46] = raw[first + 42 : first + 46]
    path.write_bytes(raw)
    assert lab.refused(path) == {"bundle-too-large"}


def test_an_encrypted_or_unusually_packed_entry_is_refused(lab):
    raw = bytearray(lab.write().read_bytes())
    raw[raw.rfind(b"PK\x01\x02") + 8] |= 1
    path = lab.folder / "locked.mrb"
    path.write_bytes(raw)
    assert lab.refused(path) == {"bundle-unreadable"}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_BZIP2) as packed:
        for name, content in lab.files.items():
            packed.writestr(name, content, compress_type=zipfile.ZIP_BZIP2)
    assert lab.refused(path) == {"bundle-unreadable"}


@pytest.mark.parametrize("spoil", [lambda raw: raw[:-400], lambda raw: b"", lambda raw: b"PK" * 99])
def test_a_file_that_is_no_archive_is_an_error_not_a_crash(lab, spoil):
    path = lab.write()
    path.write_bytes(spoil(path.read_bytes()))
    before = lab.state()
    with pytest.raises(InputError) as caught:
        open_bundle(lab.logic.scene, path)
    assert caught.value.faults[0].code == "bundle-unreadable"
    assert lab.state() == before


def test_a_damaged_entry_is_refused(lab):
    raw = bytearray(lab.write().read_bytes())
    at = raw.find(b"volume.nrrd") + 200
    raw[at] ^= 0xFF
    (lab.folder / "damaged.mrb").write_bytes(raw)
    assert lab.refused(lab.folder / "damaged.mrb") <= {"bundle-unreadable", "bundle-damaged"}


def test_a_missing_file_is_an_error(lab):
    with pytest.raises(InputError):
        open_bundle(lab.logic.scene, lab.folder / "none.mrb")


# ---------------------------------------------------------------- H49: what is in it


@pytest.mark.parametrize(
    "name",
    ["a.pkl", "a.npy", "a.py", "a.h5", "a.vtk", "a.seg.nrrd.gz", "a.mha", "a.exe", "a.json", "a"],
)
def test_a_file_of_another_kind_is_refused(lab, name):
    codes = lab.refused(lab.write(extra=[(entry(f"hexafix/Data/{name}"), b"cos\nsystem\n")]))
    assert codes == {"bundle-foreign-file"}


def scene_with(lab, old, new):
    text = lab.files[SCENE].decode()
    assert old in text
    return lab.write({**lab.files, SCENE: text.replace(old, new, 1).encode()})


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('ModuleName ="HexaFixModule"', 'ModuleName ="os"'),
        ('singletonTag="HexaFixModule"', 'singletonTag="SampleData"'),
        ('"splitFraction ', '"script '),
        ('ModuleName ="HexaFixModule"', 'ModuleName ="HexaFixModule" scriptPath="a"'),
    ],
)
def test_another_modules_data_are_refused(lab, old, new):
    assert lab.refused(scene_with(lab, old, new)) == {"bundle-foreign-module"}


@pytest.mark.parametrize(
    "element",
    [
        '<CommandLineModule id="c1" name="x"></CommandLineModule>',
        '<Script id="s1" name="x"></Script>',
        '<Segmentation id="s1" name="x"></Segmentation>',
        '<Text id="t1" name="x"></Text>',
    ],
)
def test_a_node_of_another_kind_is_refused(lab, element):
    assert lab.refused(scene_with(lab, "</MRML>", f"{element}</MRML>")) == {"bundle-foreign-node"}


@pytest.mark.parametrize(
    "head",
    [
        '<!DOCTYPE MRML [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>',
        '<!DOCTYPE MRML SYSTEM "file:///etc/passwd">',
        "<?xml-stylesheet href='a'?>",
    ],
)
def test_declarations_in_the_scene_are_refused(lab, head):
    assert lab.refused(scene_with(lab, "<MRML ", f"{head}\n<MRML ")) == {"bundle-damaged"}


@pytest.mark.parametrize(
    "spoil",
    [lambda text: b"", lambda text: text[:-30], lambda text: b"<a/>", lambda text: text + b"<b/>"],
)
def test_a_scene_that_is_no_scene_is_refused(lab, spoil):
    files = {**lab.files, SCENE: spoil(lab.files[SCENE])}
    assert lab.refused(lab.write(files)) == {"bundle-damaged"}


def test_no_scene_or_two_are_refused(lab):
    without = {name: raw for name, raw in lab.files.items() if name != SCENE}
    assert lab.refused(lab.write(without)) == {"bundle-damaged"}
    two = {**lab.files, "hexafix/Data/scene.mrml": lab.files[SCENE]}
    assert lab.refused(lab.write(two)) == {"bundle-damaged"}


def mesh(lab):
    return "hexafix/Data/model-a.vtp", lab.files["hexafix/Data/model-a.vtp"].decode()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('NumberOfPoints="', 'NumberOfPoints="9'),
        ('NumberOfPolys="', 'NumberOfPolys="7'),
        ('format="ascii"', 'format="appended" offset="0"'),
        ('type="PolyData"', 'type="ImageData"'),
        ('header_type="UInt32"', 'compressor="vtkZLibDataCompressor" header_type="UInt32"'),
        ("<PolyData>", "<PolyData><Piece></Piece>"),
        ("<PolyData>", "<PolyData><Script></Script>"),
        ('<?xml version="1.0"?>', '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]>'),
    ],
)
def test_a_shape_whose_numbers_do_not_fit_never_reaches_vtk(lab, old, new):
    name, text = mesh(lab)
    assert old in text
    files = {**lab.files, name: text.replace(old, new, 1).encode()}
    assert lab.refused(lab.write(files)) == {"bundle-damaged"}


@pytest.mark.parametrize("corner", [-1, 999_999_999])
def test_a_triangle_of_a_point_that_is_not_there_is_refused(lab, corner):
    name, text = mesh(lab)
    spoiled = re.sub(r'(Name="connectivity"[^>]*>\s*)\d+', rf"\g<1>{corner}", text, count=1)
    assert spoiled != text
    assert lab.refused(lab.write({**lab.files, name: spoiled.encode()})) == {"bundle-damaged"}


def test_a_sound_shape_passes_its_check(lab, tmp_path):
    (tmp_path / "a.vtp").write_bytes(lab.files[mesh(lab)[0]])
    check_mesh(tmp_path / "a.vtp")


POINTS = "hexafix/Data/markups-proximal.mrk.json"


def points_with(lab, change):
    document = json.loads(lab.files[POINTS])
    change(document["markups"][0])
    return lab.write({**lab.files, POINTS: json.dumps(document).encode()})


def test_points_that_do_not_say_lps_are_refused(lab):
    """Taken as LPS, points in RAS stand on the other side of the patient (H36)."""
    assert lab.refused(points_with(lab, lambda m: m.update(coordinateSystem="RAS"))) == {
        "bundle-frame"
    }
    assert lab.refused(points_with(lab, lambda m: m.pop("coordinateSystem"))) == {"bundle-frame"}


@pytest.mark.parametrize(
    "change",
    [
        lambda m: m["controlPoints"][0].update(position=[1.0, 2.0]),
        lambda m: m["controlPoints"][0].update(position=[1e9, 0.0, 0.0]),
        lambda m: m["controlPoints"][0].update(position=["a", 0.0, 0.0]),
        lambda m: m.update(type="Script"),
        lambda m: m.update(controlPoints=[]),
        lambda m: m.update(controlPoints=7),
    ],
)
def test_points_that_are_none_are_refused(lab, change):
    assert lab.refused(points_with(lab, change)) == {"bundle-damaged"}


def test_a_list_of_points_that_is_no_json_is_refused(lab):
    spoiled = re.sub(rb'("position": \[)[^,]*', rb"\1NaN", lab.files[POINTS], count=1)
    assert spoiled != lab.files[POINTS]
    files = {**lab.files, POINTS: spoiled}
    assert lab.refused(lab.write(files)) == {"not-json"}


TRANSFORM = "hexafix/Data/transform-target-fragment.tfm"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"AffineTransform_double_3_3", b"DisplacementFieldTransform_double_3_3"),
        (b"#Transform 0\n", b"#Transform 0\n#Transform 1\n"),
        (b"Parameters: ", b"Parameters: nan "),
        (b"\nFixed", b"\nTransform: CompositeTransform_double_3_3\nFixed"),
    ],
)
def test_a_transform_of_another_kind_is_refused(lab, old, new):
    assert old in lab.files[TRANSFORM]
    files = {**lab.files, TRANSFORM: lab.files[TRANSFORM].replace(old, new, 1)}
    assert lab.refused(lab.write(files)) == {"bundle-damaged"}


@pytest.mark.parametrize("cell", [b"\xff\xfe", b"\x07", b"\x1b[2J"])
def test_a_table_that_is_no_text_is_refused(lab, cell):
    name = "hexafix/Data/table-struts.tsv"
    spoiled = lab.files[name].replace(b"180.5", cell, 1)
    assert spoiled != lab.files[name]
    assert lab.refused(lab.write({**lab.files, name: spoiled})) == {"bundle-damaged"}


def test_a_file_that_is_not_there_is_refused(lab):
    for name in ("hexafix/Data/volume.nrrd", mesh(lab)[0], POINTS, TRANSFORM):
        files = {n: raw for n, raw in lab.files.items() if n != name}
        assert lab.refused(lab.write(files)) == {"bundle-reference"}


# ---------------------------------------------------------------- H50: what it points to


@pytest.mark.parametrize(
    "target",
    [
        "/etc/passwd.nrrd",
        "../../outside.nrrd",
        "Data/../../outside.nrrd",
        "Data/model-a.vtp",
        "https://example.org/a.nrrd",
        "file:///etc/a.nrrd",
    ],
)
def test_a_node_that_names_a_file_outside_is_refused(lab, target):
    old = 'fileName="Data/volume.nrrd"'
    assert lab.refused(scene_with(lab, old, f'fileName="{target}"')) == {"bundle-reference"}
    old = 'fileListMember0="Data/volume.nrrd"'
    assert lab.refused(scene_with(lab, old, f'fileListMember0="{target}"')) == {"bundle-reference"}


@pytest.mark.parametrize("attribute", ['uri="a.nrrd"', 'fileNames="a.nrrd"', 'note="http://a/b"'])
def test_a_node_that_names_an_address_is_refused(lab, attribute):
    codes = lab.refused(scene_with(lab, 'useCompression="1"', f'useCompression="1" {attribute}'))
    assert codes == {"bundle-reference"}


def detached(line):
    def change(raw):
        head, _, _ = raw.partition(b"\n\n")
        return head + b"\n" + line + b"\n\n"

    return change


@pytest.mark.parametrize(
    "line",
    [b"data file: ../../outside.raw", b"data file: /etc/passwd", b"data file: LIST\n/etc/passwd"],
)
def test_an_image_whose_voxels_lie_outside_is_refused(lab, line):
    name = "hexafix/Data/volume.nrrd"
    files = {**lab.files, name: detached(line)(lab.files[name])}
    assert "detached-data" in lab.refused(lab.write(files))


def test_an_image_that_states_more_voxels_than_it_has_is_refused(lab):
    name = "hexafix/Data/volume.nrrd"
    spoiled = lab.files[name].replace(b"sizes: 9 8 7", b"sizes: 9000 8000 7000")
    assert spoiled != lab.files[name]
    assert lab.refused(lab.write({**lab.files, name: spoiled}))


def test_the_faults_of_all_files_are_told_at_once(lab):
    files = {**lab.files, TRANSFORM: b"x", POINTS: b"{}", "hexafix/a.pkl": b"x"}
    with pytest.raises(Refused) as caught:
        open_bundle(lab.logic.scene, lab.write(files))
    assert {fault.code for fault in caught.value.faults} == {
        "bundle-damaged",
        "bundle-foreign-file",
    }
    assert len(caught.value.faults) == 3
