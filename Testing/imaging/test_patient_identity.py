"""Whose images these are: compared always, read only when asked for, never guessed."""

from __future__ import annotations

import datetime

import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.errors import ImageRefused, InputError
from hexafix.imaging import list_series, read_volume
from hexafix.imaging.patient_identity import PatientName, read_patient_identity
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian, generate_uid

KANJI = b"Yamada^Tarou=\x1b$B;3ED\x1b(B^\x1b$BB@O:\x1b(B=\x1b$B$d$^$@\x1b(B^\x1b$B$?$m$&\x1b(B"
PLACE = "X"


def named(items, **values):
    for item in items:
        for keyword, value in values.items():
            setattr(item, keyword, value)
    return items


def with_bytes(writer, items, folder, name: bytes, charset=None, spelled=None):
    """The series with the bytes of a name as some other program wrote them."""
    name += b" " * (len(name) % 2)
    named(items, PatientName=PLACE * len(name), PatientID="7")
    if charset is not None:
        named(items, SpecificCharacterSet=charset)
    writer.save(folder, items)
    for path in folder.iterdir():
        raw = path.read_bytes().replace(PLACE.encode() * len(name), name)
        if spelled is not None:
            raw = raw.replace(charset.encode(), spelled.encode())
        path.write_bytes(raw)
    return folder


def refused(error, path):
    with pytest.raises(error) as caught:
        read_patient_identity(path)
    (fault,) = caught.value.faults
    assert fault.hazard == "H38"
    assert fault.next_step
    return fault


def test_name_id_and_dates_of_the_series_are_read(tmp_path, writer, grid):
    items = named(
        writer.slices(grid),
        SpecificCharacterSet="ISO_IR 100",
        PatientName="Müller^Erika^Maria^Dr.^PhD",
        PatientID=" 4711-XYZ ",
        PatientBirthDate="19630208",
        StudyDate="20261105",
    )
    identity = read_patient_identity(writer.save(tmp_path, items))
    assert identity.names == (PatientName("Müller", "Erika", "Maria", "Dr.", "PhD"),)
    assert identity.patient_id == "4711-XYZ"
    assert identity.birth_date == datetime.date(1963, 2, 8)
    assert identity.study_date == datetime.date(2026, 11, 5)


@pytest.mark.parametrize(
    ("charset", "codec", "name"),
    [
        ("ISO_IR 192", "utf-8", "Łukasz^Жанна"),
        ("ISO_IR 100", "latin_1", "Müller^Zoë"),
        ("ISO_IR 144", "iso8859_5", "Люксембург^Анна"),
        ("ISO_IR 126", "iso8859_7", "Διονυσιος^Ελένη"),
        ("GB18030", "gb18030", "Wang^XiaoDong=王^小东"),
    ],
)
def test_the_character_set_of_the_header_is_followed(charset, codec, name, tmp_path, writer, grid):
    folder = with_bytes(writer, writer.slices(grid), tmp_path, name.encode(codec), charset)
    groups = [tuple(group.split("^")) for group in name.split("=")]
    found = read_patient_identity(folder).names
    assert [(part.family, part.given) for part in found] == groups


def test_ideographic_and_phonetic_groups_are_read_by_their_escapes(tmp_path, writer, grid):
    charset = ["", "ISO 2022 IR 87"]
    found = read_patient_identity(
        with_bytes(writer, writer.slices(grid), tmp_path, KANJI, charset)
    ).names
    assert [(name.family, name.given) for name in found] == [
        ("Yamada", "Tarou"),
        ("山田", "太郎"),
        ("やまだ", "たろう"),
    ]


def test_a_character_set_spelled_with_another_stroke_is_understood(tmp_path, writer, grid):
    raw = "Łukasz".encode()
    items = writer.slices(grid)
    folder = with_bytes(writer, items, tmp_path, raw, "ISO_IR 192", spelled="ISO-IR 192")
    assert read_patient_identity(folder).names[0].family == "Łukasz"


@pytest.mark.parametrize(
    ("charset", "spelled", "raw"),
    [
        (None, None, "Müller".encode("latin_1")),
        ("ISO_IR 192", "ISO_IR 999", b"Mueller"),
        ("ISO_IR 192", None, "Müller".encode("latin_1")),
    ],
    ids=["none stated", "unknown", "not followed"],
)
def test_letters_are_never_guessed(charset, spelled, raw, tmp_path, writer, grid):
    folder = with_bytes(writer, writer.slices(grid), tmp_path, raw, charset, spelled)
    fault = refused(InputError, folder)
    assert fault.code == "no-identity"
    assert "ller" not in fault.message


def test_dates_that_are_none_are_refused_and_absent_ones_are_not(tmp_path, writer, grid):
    items = named(writer.slices(grid), PatientBirthDate="20010203")
    folder = writer.save(tmp_path / "b", items)
    assert read_patient_identity(folder).study_date is None
    for path in folder.iterdir():
        path.write_bytes(path.read_bytes().replace(b"20010203", b"20011332"))
    fault = refused(InputError, folder)
    assert "2001" not in fault.message


@pytest.mark.parametrize(
    ("keyword", "value"),
    [("PatientName", "Other^Name"), ("PatientID", "ID-9"), ("PatientBirthDate", "19000101")],
)
def test_slices_of_two_patients_are_refused_also_without_the_option(
    keyword, value, tmp_path, writer, grid, secret
):
    items = named(writer.slices(grid), PatientBirthDate="19630208")
    setattr(items[3], keyword, value)
    folder = writer.save(tmp_path, items)
    with pytest.raises(ImageRefused) as caught:
        read_volume(folder)
    (fault,) = caught.value.faults
    assert (fault.code, fault.hazard) == ("mixed-patient", "H38")
    assert fault.value == "1 of 5 slices, origins at (-30.00, 12.50, 403.75) mm LPS"
    assert secret not in fault.message
    assert [fault.code for fault in list_series(folder)[0].faults] == ["mixed-patient"]
    assert refused(ImageRefused, folder).code == "mixed-patient"


def test_slices_of_two_studies_are_refused_where_the_study_s_date_is_printed(
    tmp_path, writer, grid
):
    items = named(writer.slices(grid), StudyDate="20261105")
    items[0].StudyDate = "20261106"
    folder = writer.save(tmp_path, items)
    assert read_volume(folder).size_ijk == (7, 6, 5)
    assert refused(ImageRefused, folder).code == "mixed-patient"


def test_the_same_patient_written_with_other_padding_is_one(tmp_path, writer, grid):
    items = named(writer.slices(grid), PatientName="Muster^Erika", PatientID="A7")
    items[1].PatientName, items[1].PatientID = "MUSTER^ERIKA^^^", " A7 "
    assert read_volume(writer.save(tmp_path, items)).size_ijk == (7, 6, 5)


def test_another_patient_in_the_folder_is_told(tmp_path, writer, grid):
    writer.save(tmp_path / "1", writer.slices(grid))
    other = named(writer.slices(grid), PatientName="Other^Name")
    writer.save(tmp_path / "2", other)
    uid = other[0].SeriesInstanceUID
    volume = read_volume(tmp_path, series_instance_uid=uid)
    told = "other patient (H38): 5 images in the folder name another patient"
    assert told in volume.source.warnings
    identity = read_patient_identity(tmp_path, series_instance_uid=uid)
    assert identity.names[0].family == "Other"


def test_a_header_without_name_and_id_gives_no_identity(tmp_path, writer, grid):
    items = named(writer.slices(grid), PatientName="^^", PatientID=" ")
    assert refused(InputError, writer.save(tmp_path, items)).code == "no-identity"


def test_an_image_file_that_is_no_dicom_gives_no_identity(tmp_path, coded_image, grid):
    sitk.WriteImage(coded_image(grid), str(tmp_path / "a.nrrd"))
    assert refused(InputError, tmp_path / "a.nrrd").code == "no-identity"


def test_an_identity_does_not_print_itself(tmp_path, writer, grid, secret):
    identity = read_patient_identity(writer.save(tmp_path, writer.slices(grid)))
    assert secret in identity.names[0].family
    assert secret not in repr(identity) + str(identity) + f"{identity}"


def test_a_media_directory_is_never_followed_out_of_its_folder(tmp_path, writer, grid):
    writer.save(tmp_path / "OUTSIDE", writer.slices(grid), names="IM{}".format)
    record = Dataset()
    record.OffsetOfTheNextDirectoryRecord = 0
    record.RecordInUseFlag = 0xFFFF
    record.OffsetOfReferencedLowerLevelDirectoryEntity = 0
    record.DirectoryRecordType = "IMAGE"
    record.ReferencedFileID = ["XX", "OUTSIDE", "IM0"]
    record.ReferencedSOPClassUIDInFile = "1.2.840.10008.5.1.4.1.1.2"
    directory = Dataset()
    directory.FileSetID = "DISC"
    directory.DirectoryRecordSequence = [record]
    directory.file_meta = FileMetaDataset()
    directory.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    directory.file_meta.MediaStorageSOPClassUID = "1.2.840.10008.1.3.10"
    directory.file_meta.MediaStorageSOPInstanceUID = generate_uid()
    disc = tmp_path / "disc"
    disc.mkdir()
    directory.save_as(disc / "DICOMDIR", enforce_file_format=True)
    raw = (disc / "DICOMDIR").read_bytes()
    (disc / "DICOMDIR").write_bytes(raw.replace(b"XX\\OUTSIDE", b"..\\OUTSIDE"))
    assert b"..\\OUTSIDE\\IM0" in (disc / "DICOMDIR").read_bytes()
    with pytest.raises(InputError) as caught:
        read_volume(disc)
    assert caught.value.faults[0].code == "no-dicom-image"
    assert caught.value.faults[0].value == "1 x DICOM media directory"
    writer.save(disc / "ct", writer.slices(grid))
    assert read_volume(disc).source.warnings[-1] == "skipped: 1 x DICOM media directory"
