"""A phantom whose every header is salted, and a scan that finds the salt in whatever is produced.

Every text that could name somebody holds one marker, so that one search finds them all in any
encoding; the letters after it tell the attribute. Numbers, times and UIDs share markers of digits,
dates are searched for in every way that they are written.
"""

from __future__ import annotations

import base64
import copy
import io
import json
import os
import random
import re
import shutil
import subprocess
import sys
import warnings
import zipfile
import zlib
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

import numpy as np
import pydicom
import pypdfium2
import pytest
from hexafix.imaging import Volume
from hexafix.phantom import write_phantom
from hexafix.phantom.dicom_series import write_dicom_series
from pydicom.datadict import DicomDictionary, dictionary_keyword, dictionary_VR
from pydicom.dataset import Dataset
from pypdf import PdfReader

SEED = 20261122

ALLOWED = {
    "SpecificCharacterSet": "how texts are encoded; names nobody",
    "ImageType": "tells a localizer from a volume; shown from a closed vocabulary only",
    "Modality": "tells a CT from other images; shown from a closed vocabulary only",
    "SOPClassUID": "the standard's UID of the kind of object; never shown",
    "TransferSyntaxUID": "the standard's UID of how pixels are stored; shown if it is one of these",
    "MediaStorageSOPClassUID": "as SOPClassUID",
    "ImplementationClassUID": "the writing program's; never shown",
    "BodyPartExamined": "compared with the case's bone; never shown itself",
    "Laterality": "compared with the case's side; left or right is all that is shown",
    "ImageLaterality": "as Laterality",
    "PatientPosition": "head or feet first; never shown",
    "LossyImageCompression": "00 or 01",
    "RescaleType": "tells Hounsfield units from other values; never shown",
    "PhotometricInterpretation": "how grey values are stored; never shown",
}
"""Attributes that the chain needs and a plan cannot be made without: not salted by the dictionary.

Their own texts are salted too in `a_wordy_folder`, where no plan has to come out.
"""

PSEUDONYM = "pseudonym-7"

GROUPS = (0x0008, 0x0010, 0x0012, 0x0018, 0x0020, 0x0032, 0x0038, 0x0040, 0x0088, 0x0400, 0x4008)
"""Patient, study, series, equipment, acquisition, request, visit, procedure, signature, results."""

SALTED = {"PN", "LO", "SH", "ST", "LT", "UT", "UC", "UR", "UI", "DA", "DT", "TM", "IS", "AE", "CS"}

IN_EVERY_SLICE = {
    "AccessionNumber", "AcquisitionDate", "ContentDate", "DeviceSerialNumber",
    "FrameOfReferenceUID", "ImageComments", "InstitutionAddress", "InstitutionName",
    "InstitutionalDepartmentName", "OperatorsName", "OtherPatientIDs", "PatientAddress",
    "PatientBirthDate", "PatientBirthTime", "PatientComments", "PatientID",
    "PatientMotherBirthName", "PatientName", "PatientSex", "PatientTelephoneNumbers",
    "PerformingPhysicianName", "ProtocolName", "ReferringPhysicianName",
    "RequestAttributesSequence", "RequestingPhysician", "SeriesDate", "SeriesDescription",
    "SeriesInstanceUID", "SeriesTime", "StationName", "StudyDate", "StudyDescription",
    "StudyID", "StudyInstanceUID", "StudyTime",
}  # fmt: skip
"""The usual ones; every fortieth slice has the whole dictionary besides."""

MONTHS = "January February March April May June July August September October November December"


class Salt:
    """Random texts, numbers, dates and UIDs, the same in every run, and what each stands for."""

    def __init__(self) -> None:
        pick = random.Random(SEED)
        self.marker = "q" + "".join(pick.choice("bcdfghjkmnpqrstvwxz") for _ in range(11))
        digits = "".join(pick.choice("123456789") for _ in range(30))
        self.uid_marker = digits[:14]
        self.number = f"17{digits[14:22]}"
        self.time = f"{pick.randrange(10, 24)}{pick.randrange(10, 60)}59.{digits[22:27]}"
        self.dates = {
            name: date(pick.randrange(1930, 1999), pick.randrange(1, 13), pick.randrange(13, 29))
            for name in ("PatientBirthDate", "StudyDate", "other")
        }
        self.names: dict[str, str] = {}
        self._pick = pick

    def text(self, what: str) -> str:
        """A word with the marker; the four letters after it stand for `what`."""
        number = len(self.names)
        letters = "".join("abcdefghij"[int(digit)] for digit in f"{number:04d}")
        self.names[letters] = what
        return f"{self.marker}{letters}"

    def uid(self) -> str:
        return f"1.2.826.0.1.{self.uid_marker}.{self._pick.randrange(10**9, 10**10)}"

    def value(self, vr: str, keyword: str) -> str:
        """What an attribute of this VR holds."""
        day = self.dates.get(keyword, self.dates["other"]).strftime("%Y%m%d")
        match vr:
            case "PN":
                return "^".join([*(self.text(keyword) for _ in range(3)), "Dr."])
            case "SH" | "CS" | "AE":
                word = self.text(keyword)
                return word if vr == "SH" else word.upper()
            case "UR":
                return f"https://{self.text(keyword)}.example/{self.text(keyword)}"
            case "UI":
                return self.uid()
            case "DA":
                return day
            case "DT":
                return day + self.time
            case "TM":
                return self.time
            case "IS":
                return self.number
        return f"{self.text(keyword)} of {self.text(keyword)}"


def patterns(salt: Salt) -> dict[bytes, str]:
    """What to search for, in lower case (base64 as it is): bytes and what they would mean."""
    found: dict[bytes, str] = {}
    words = {salt.marker: "text", salt.uid_marker: "UID", salt.number: "number", salt.time: "time"}
    words[f"{salt.time[:2]}:{salt.time[2:4]}:{salt.time[4:]}"] = "time"
    for name, day in salt.dates.items():
        month = MONTHS.split()[day.month - 1].lower()
        for style in ("%Y%m%d", "%Y-%m-%d", "%d.%m.%Y", "%m/%d/%Y", "%d/%m/%Y", "%Y/%m/%d",
                      "%d-%m-%Y", "%Y.%m.%d", "%d%m%Y", "%d.%m.%y"):  # fmt: skip
            words[day.strftime(style)] = f"date {name}"
        words[f"{day.day} {month} {day.year}"] = f"date {name}"
        words[f"{month} {day.day}, {day.year}"] = f"date {name}"
        words[f"{day.day} {month[:3]} {day.year}"] = f"date {name}"
    for word, meaning in words.items():
        for encoding in ("utf-8", "utf-16-le", "utf-16-be"):
            found |= {word.encode(encoding): meaning, word.encode(encoding).hex().encode(): meaning}
        if meaning.startswith("date"):
            continue
        found["".join(f"\\u{ord(c):04x}" for c in word).encode()] = meaning
        found["".join(f"&#{ord(c)};" for c in word).encode()] = meaning
        found["".join(f"%{ord(c):02x}" for c in word).encode()] = meaning
        for lead in (b"", b"~", b"~~") if len(word) > 11 else ():
            # whole groups of three bytes only, wherever the text starts in the encoded whole
            whole = base64.b64encode(lead + word.encode())
            found[whole[4 if lead else 0 : -4]] = meaning
    return found


def expand(data: bytes, depth: int = 0) -> list[bytes]:
    """The bytes and everything packed in them: PDF and PNG streams, archives, escaped strings."""
    blobs = [data]
    if depth > 3:
        return blobs
    if (b"\\" in data and data[:5] == b"%PDF-") or depth:
        blobs.append(_unescaped(data))
    if data[:2] == b"PK":
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            for name in archive.namelist():
                blobs += [name.encode(), *expand(archive.read(name), depth + 1)]
    if b"%PDF-" in data[:64]:
        blobs += _pdf_texts(data)
    for start in re.finditer(rb"stream\r?\n|zTXt|iTXt|IDAT", data):
        blobs += _inflated(data, start.end(), depth)
    return blobs


def _inflated(data: bytes, start: int, depth: int) -> list[bytes]:
    """What inflates from `start` on, or from behind the keyword that a PNG's text begins with."""
    head = data[start : start + 2000]
    offsets = [0, *(m.start() for m in re.finditer(rb"\x78[\x01\x5e\x9c\xda]", head))][:6]
    for offset in offsets:
        try:
            return expand(zlib.decompressobj().decompress(data[start + offset :]), depth + 1)
        except zlib.error:
            continue
    return []


def _unescaped(data: bytes) -> bytes:
    """PDF's literal strings without their escapes."""
    octal = re.sub(rb"\\([0-7]{3})", lambda m: bytes([int(m[1], 8) & 255]), data)
    return re.sub(rb"\\([()\\])", rb"\1", octal)


def _pdf_texts(data: bytes) -> list[bytes]:
    """The text of every page, the file's information, and what is attached."""
    reader = PdfReader(io.BytesIO(data))
    texts: list[str] = []
    with pypdfium2.PdfDocument(data) as pdf:
        texts += [page.get_textpage().get_text_range() for page in pdf]
        texts += [str(pdf.get_metadata_dict())]
    texts += [str(reader.metadata), *reader.attachments]
    blobs = [text.encode("utf-8", "surrogatepass") for text in texts]
    return blobs + [raw for items in reader.attachments.values() for raw in items]


@dataclass
class Scan:
    """Searches for the salt."""

    salt: Salt
    patterns: dict[bytes, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.patterns = patterns(self.salt)

    def of(self, data: bytes | str) -> set[str]:
        """What the data tell of the patient, empty when nothing."""
        raw = data if isinstance(data, bytes) else data.encode("utf-8", "surrogateescape")
        found: set[str] = set()
        for blob in expand(raw):
            small = blob.lower()
            for pattern, meaning in self.patterns.items():
                where = blob if pattern != pattern.lower() else small
                if pattern in where:
                    found.add(meaning)
            for letters in re.findall(self.salt.marker.encode() + rb"([a-j]{4})", small):
                found.add(f"text {self.salt.names.get(letters.decode(), '?')}")
        return found

    def of_folder(self, folder: Path) -> dict[str, set[str]]:
        """What file names and contents below a folder tell."""
        found = {}
        for path in sorted(folder.rglob("*")):
            tells = self.of(str(path.relative_to(folder)))
            if path.is_file():
                tells |= self.of(path.read_bytes())
            if tells:
                found[path.name] = tells
        return found


def salted_tags() -> list[tuple[int, str, str]]:
    """Tag, VR and keyword of everything in the dictionary that could hold an identity."""
    found = []
    for tag in sorted(DicomDictionary):
        vr, keyword = dictionary_VR(tag), dictionary_keyword(tag)
        if tag >> 16 in GROUPS and tag & 0xFFFF and keyword and (vr in SALTED or vr == "SQ"):
            found.append((tag, vr, keyword))
    return found


def salted_header(salt: Salt, *, whole: bool) -> Dataset:
    """Every attribute that can hold a text, a date, a time, a UID or a number of a patient."""
    header = Dataset()
    for tag, vr, keyword in salted_tags():
        if keyword in ALLOWED or not (whole or keyword in IN_EVERY_SLICE):
            continue
        if vr == "SQ":
            item = Dataset()
            item.PatientName = salt.value("PN", keyword)
            item.CodeMeaning = salt.value("LO", keyword)
            item.ReferencedSOPInstanceUID = salt.uid()
            header.add_new(tag, vr, [item])
        else:
            header.add_new(tag, vr, salt.value(vr, keyword))
    header.add_new(0x60000022, "LO", salt.value("LO", "OverlayDescription"))
    header.add_new(0x60001500, "LO", salt.value("LO", "OverlayLabel"))
    header.add_new(0x50000022, "LO", salt.value("LO", "CurveDescription"))
    block = header.private_block(0x0009, salt.value("LO", "private creator"), create=True)
    block.add_new(1, "LO", salt.value("LO", "private LO"))
    block.add_new(2, "PN", salt.value("PN", "private PN"))
    block.add_new(3, "UN", salt.value("LO", "private UN").encode())
    return header


def salt_slice(item: Dataset, target: Path, salt: Salt, header: Dataset) -> None:
    """One slice of the phantom with the header laid over what does not make its geometry."""
    series, frame = header.SeriesInstanceUID, header.FrameOfReferenceUID
    item.update(header)
    item.SpecificCharacterSet = "ISO_IR 192"
    item.SeriesInstanceUID, item.FrameOfReferenceUID = series, frame
    item.SOPInstanceUID = item.file_meta.MediaStorageSOPInstanceUID = salt.uid()
    item.preamble = salt.text("preamble").encode().ljust(128, b"\0")
    item.file_meta.SourceApplicationEntityTitle = salt.text("source AE title")
    item.file_meta.SendingApplicationEntityTitle = salt.text("sending AE title")
    item.file_meta.ImplementationVersionName = salt.text("implementation")
    item.file_meta.PrivateInformationCreatorUID = salt.uid()
    item.file_meta.PrivateInformation = salt.text("private information").encode()
    item.add_new(0xFFFCFFFC, "OB", salt.text("trailing padding").encode())
    item.save_as(target, enforce_file_format=True)


@dataclass
class Run:
    """One command, what it printed and where its export is."""

    name: str
    code: int
    stdout: str
    stderr: str


def run_hexafix(arguments, *, home: Path, scratch: Path, code: str | None = None, name: str = ""):
    """The command line in a process of its own, at home in the salted folder."""
    command = [sys.executable, "-m", "hexafix"] if code is None else [sys.executable, "-c", code]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("HEXAFIX")}
    environment |= {"HOME": str(home), "TMPDIR": str(scratch), "OMP_NUM_THREADS": "1"}
    environment["PYTHONPATH"] = os.pathsep.join(p for p in sys.path if p)
    done = subprocess.run(
        [*command, *map(str, arguments)],
        capture_output=True,
        check=False,
        env=environment,
        cwd=home,
    )
    return Run(name, done.returncode, done.stdout.decode("utf-8"), done.stderr.decode("utf-8"))


@pytest.fixture(scope="session")
def salt() -> Salt:
    return Salt()


@pytest.fixture(scope="session")
def scan(salt) -> Scan:
    return Scan(salt)


@pytest.fixture(scope="session")
def allowed() -> dict[str, str]:
    return ALLOWED


@dataclass(frozen=True)
class SaltedCase:
    """A home folder with a salted case in it; every name on the way is salted.

    Attributes
    ----------
    home : Path
        Holds everything that a user would have at home.
    case : Path
        The case file.
    ct : Path
        The DICOM folder.
    scratch : Path
        Where the programs put what is temporary.
    series_uid : str
    header : Dataset
        What every slice has.
    """

    home: Path
    case: Path
    ct: Path
    scratch: Path
    series_uid: str
    header: Dataset

    def run(self, *arguments, code: str | None = None) -> Run:
        return run_hexafix(arguments, home=self.home, scratch=self.scratch, code=code)


@pytest.fixture(scope="session")
def salted_case(a_phantom, salt, tmp_path_factory) -> SaltedCase:
    """The phantom as a hospital would hand it over, with a patient in every corner of it."""
    top = tmp_path_factory.mktemp("salted")
    home, scratch = top / salt.text("home folder"), top / "scratch"
    folder = home / f"{salt.text('case folder')} {salt.text('case folder')}"
    scratch.mkdir()
    write_phantom(a_phantom, folder)
    ct = (folder / "ct").rename(folder / salt.text("image folder"))
    with warnings.catch_warnings():
        # pydicom thinks that some of our words are too long or no code strings
        warnings.simplefilter("ignore")
        headers = [salted_header(salt, whole=whole) for whole in (True, False)]
        for element in headers[0]:
            if element.tag in headers[1]:
                headers[1][element.tag] = element
        for place, path in enumerate(sorted(ct.iterdir())):
            target = ct / f"{salt.text('image file')}.dcm"
            salt_slice(pydicom.dcmread(path), target, salt, headers[place % 40 != 0])
            path.unlink()
    (ct / f"{salt.text('note file')}.txt").write_text(salt.text("note"))
    document = copy.deepcopy(a_phantom.case)
    document["case_id"] = PSEUDONYM
    document["image"] = {"path": ct.name, "series_instance_uid": headers[0].SeriesInstanceUID}
    (folder / "case.json").unlink()
    (folder / "truth.json").unlink()
    case = folder / f"{salt.text('case file')}.json"
    case.write_text(json.dumps(document))
    return SaltedCase(home, case, ct, scratch, headers[0].SeriesInstanceUID, headers[0])


@dataclass(frozen=True)
class SmallSeries:
    """Writes small salted DICOM series."""

    salt: Salt
    header: Dataset

    def write(self, folder: Path, *, slices: int = 5, change=None) -> Path:
        """A series of its own UID; `change(k, dataset)` spoils slice k and may return False."""
        voxels = np.zeros((slices, 6, 7), np.int16)
        affine = np.diag([0.8, 0.8, 1.5, 1.0])
        plain = folder.with_name("plain")
        write_dicom_series(Volume(voxels, affine), plain, identity=str(folder))
        folder.mkdir(parents=True)
        header = copy.deepcopy(self.header)
        header.SeriesInstanceUID = self.salt.uid()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for k, path in enumerate(sorted(plain.iterdir(), key=_position)):
                item = pydicom.dcmread(path)
                target = folder / f"{self.salt.text('image file')}.dcm"
                own = copy.deepcopy(header)
                if change is None or change(k, own) is not False:
                    salt_slice(item, target, self.salt, own)
        shutil.rmtree(plain)
        return folder


def _position(path: Path) -> float:
    return float(pydicom.dcmread(path, stop_before_pixels=True).ImagePositionPatient[2])


@pytest.fixture(scope="session")
def small_series(salt) -> SmallSeries:
    return SmallSeries(salt, salted_header(salt, whole=False))
