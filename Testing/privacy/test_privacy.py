"""No string of the input that could name a patient is in anything that HexaFix prints or writes."""

import base64
import io
import json
import struct
import zipfile
import zlib

import pydicom
import pytest
from hexafix.report.pdf import prescription_pdf
from pypdf import PdfReader, PdfWriter

DRIVER = """
import json, sys
from hexafix.cli import main
for name, arguments in json.loads(sys.argv[1]):
    for stream in (sys.stdout, sys.stderr):
        print(f"=== {name} ===", file=stream, flush=True)
    if name == "defect":
        import hexafix.imaging.dicom_volume as room

        def broken(path, *_):
            raise RuntimeError(f"a library died over {path}")

        room.scan = broken
    try:
        main(arguments)
    except SystemExit as end:
        print(f"=== exit {end.code} ===", flush=True)
"""

CODES = {
    "series": 0,
    "series --json": 0,
    "check-layout": 0,
    "check-layout --json": 0,
    "advise": 0,
    "advise, a wrong value": 2,
    "verify": 0,
    "verify --json": 0,
    "several series": 3,
    "mixed patient": 3,
    "mixed patient, identified": 3,
    "missing slice": 3,
    "truncated": 3,
    "damaged headers": 2,
    "foreign words": 3,
    "foreign words, series": 0,
    "private syntax": 3,
    "localizers": 3,
    "unknown series": 2,
    "not there": 2,
    "no image": 2,
    "nrrd without a known space": 3,
    "nrrd, identified": 2,
    "detached data elsewhere": 3,
    "a case of texts": 2,
    "a case of wrong kinds": 2,
    "a case that is no json": 2,
    "a case that is not there": 2,
    "an image that is not there": 2,
    "a target with other files": 2,
    "a target that is a file": 2,
    "an export that is none": 2,
    "too many words": 2,
    "an unknown command": 2,
    "a wrong value": 2,
    "an unknown option": 2,
    "defect": 1,
}
"""What one process is asked for, in this order, and the exit code that says it got there."""


@pytest.fixture(scope="module")
def before(salted_case):
    return set(salted_case.home.rglob("*"))


@pytest.fixture(scope="module")
def planned(salted_case, before):
    run = salted_case.run("plan", salted_case.case, "--out", salted_case.home / "export")
    assert run.code == 0, run.stderr
    return run


@pytest.fixture(scope="module")
def identified(salted_case, before):
    """The same plan with the patient's identity on the prescription."""
    arguments = ("plan", salted_case.case, "--out", salted_case.home / "identified")
    run = salted_case.run(*arguments, "--identified-pdf", "--json")
    assert run.code == 0, run.stderr
    return run


@pytest.fixture(scope="module")
def seen(salted_case, before):
    return {
        "markers": salted_case.run("markers", salted_case.ct, "--diameter-mm", "10"),
        "recognise": salted_case.run("recognise", salted_case.case, "--json"),
    }


@pytest.fixture(scope="module")
def troubles(salted_case, small_series, salt, planned, tmp_path_factory):
    """Every other command, refusal, error and defect; output and exit code by name."""
    top = tmp_path_factory.mktemp("troubles") / salt.text("trouble folder")
    top.mkdir()
    asked = _arguments(top, salted_case, small_series, salt)
    assert set(asked) == set(CODES)
    # the defect stays broken, so it comes last
    listed = json.dumps([(name, [str(a) for a in asked[name]]) for name in CODES])
    run = salted_case.run(listed, code=DRIVER)
    parts = {}
    for text in (run.stdout, run.stderr):
        pieces = text.split("=== ")
        for piece in pieces[1:]:
            head, _, body = piece.partition(" ===\n")
            if head.startswith("exit"):
                parts[name] = (int(head[5:]), parts[name][1])  # noqa: F821
            else:
                name = head
                code, sofar = parts.get(name, (None, ""))
                parts[name] = (code, sofar + body)
    return parts


def _arguments(top, salted_case, small_series, salt):
    """The command line of each entry of `CODES`, its files written below `top`."""
    new = iter(top / salt.text("folder") for _ in range(100))
    ct, case = salted_case.ct, salted_case.case
    balls = ("--diameter-mm", "10")
    many = next(new)
    small_series.write(many / "1"), small_series.write(many / "2")

    def rename(k, header):
        if k == 2:
            header.PatientName = salt.value("PN", "another patient")

    def scout(k, header):
        header.ImageType = ["ORIGINAL", "PRIMARY", "LOCALIZER", salt.text("words").upper()]

    def words(k, header):
        for keyword in ("Modality", "BodyPartExamined", "Laterality", "ImageLaterality"):
            setattr(header, keyword, salt.text(keyword).upper())
        for keyword in ("PatientPosition", "LossyImageCompression", "PhotometricInterpretation"):
            setattr(header, keyword, salt.text(keyword).upper())
        header.RescaleType = salt.text("RescaleType")
        header.ImageType = [salt.text("ImageType").upper() for _ in range(4)]

    mixed, wordy = small_series.write(next(new), change=rename), small_series.write(
        next(new), change=words
    )  # fmt: skip
    gap = small_series.write(next(new), slices=6, change=lambda k, _: k != 2)
    cut, damaged = small_series.write(next(new)), small_series.write(next(new))
    for path in cut.iterdir():
        path.write_bytes(path.read_bytes()[:-60])
    for path in damaged.iterdir():
        raw = path.read_bytes()
        path.write_bytes(raw[:200] + salt.text("damage").encode() + raw[190:700])
    private = small_series.write(next(new))
    for path in private.iterdir():
        item = pydicom.dcmread(path)
        item.file_meta.TransferSyntaxUID = salt.uid()
        item.save_as(path, implicit_vr=False, little_endian=True)
    empty = next(new)
    empty.mkdir()
    (empty / f"{salt.text('note file')}.txt").write_text(salt.text("note"))
    foreign = next(new)
    foreign.mkdir()
    (foreign / "manifest.json").write_text("{}")
    (foreign / salt.text("foreign file")).write_text("mine")
    nrrd, nhdr = next(new).with_suffix(".nrrd"), next(new).with_suffix(".nhdr")
    head = (
        "NRRD0005\ntype: short\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nendian: little\n"
        f"# {salt.text('comment')}\ncontent: {salt.text('content')}\n"
        f"{salt.text('key')}:={salt.text('value')}\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n"
    )
    space = f"space: {salt.text('space')}\nspace origin: (0,0,0)\n\n"
    nrrd.write_bytes((head + space).encode() + bytes(16))
    nhdr.write_text(f"{head}data file: ../../{salt.text('data file')}.raw\n\n")
    good = json.loads(case.read_text())

    def case_of(**changes):
        path = next(new).with_suffix(".json")
        path.write_text(json.dumps({**good, **changes}))
        return path

    def plan(file, *more):
        return ("plan", file, "--out", top / "out", *more)

    texts = case_of(
        case_id=f"{salt.text('case id')} *", image={"path": str(ct)} | {"series_instance_uid": "x"},
        fixator=salt.text("fixator"), limb={"side": salt.text("side"), "bone": salt.text("Bone")},
        correction={"kind": salt.text("kind")},
        schedule={"start_date": salt.text("start"), "compensation": salt.text("mode")},
    )  # fmt: skip
    kinds = case_of(
        markers=salt.text("markers"), limb=[salt.text("limb")], numbering={"1": salt.text("ball")},
        image={"path": 7, "series_instance_uid": salt.uid() + salt.text("uid")},
    )  # fmt: skip
    no_json = next(new).with_suffix(".json")
    no_json.write_text(f'{{"case_id": {salt.text("broken")} "{salt.uid()}"')
    of = {"series_instance_uid": None}
    return {
        "series": ("series", ct),
        "series --json": ("series", many, "--json"),
        "check-layout": ("check-layout", case),
        "check-layout --json": ("check-layout", case, "--json"),
        "advise": ("advise", case, "--json"),
        "advise, a wrong value": ("advise", case, "--heights-mm", salt.text("heights")),
        "verify": ("verify", salted_case.home / "export"),
        "verify --json": ("verify", salted_case.home / "export", "--json"),
        "several series": plan(case_of(image={"path": str(many), **of}), "--json"),
        "mixed patient": ("markers", mixed, *balls),
        "mixed patient, identified": plan(
            case_of(image={"path": str(mixed), **of}), "--identified-pdf"
        ),
        "missing slice": ("markers", gap, *balls, "--json"),
        "truncated": ("markers", cut, *balls),
        "damaged headers": ("markers", damaged, *balls),
        "foreign words": ("markers", wordy, *balls),
        "foreign words, series": ("series", wordy, "--json"),
        "private syntax": ("markers", private, *balls),
        "localizers": ("markers", small_series.write(next(new), change=scout), *balls, "--json"),
        "unknown series": ("markers", ct, *balls, "--series", salt.uid()),
        "not there": ("markers", top / salt.text("nowhere"), *balls, "--json"),
        "no image": ("series", empty),
        "nrrd without a known space": ("markers", nrrd, *balls),
        "nrrd, identified": plan(case_of(image={"path": str(nrrd), **of}), "--identified-pdf"),
        "detached data elsewhere": ("markers", nhdr, *balls),
        "a case of texts": plan(texts, "--json"),
        "a case of wrong kinds": plan(kinds),
        "a case that is no json": plan(no_json, "--json"),
        "a case that is not there": plan(top / salt.text("nowhere")),
        "an image that is not there": plan(case_of(image={"path": salt.text("image"), **of})),
        "a target with other files": ("plan", case, "--out", foreign),
        "a target that is a file": ("plan", case, "--out", case),
        "an export that is none": ("verify", ct),
        "too many words": ("plan", top / "a", salt.text("word"), "--out", salt.text("word")),
        "an unknown command": (salt.text("command"), ct),
        "a wrong value": ("markers", ct, "--diameter-mm", salt.text("value")),
        "an unknown option": ("markers", ct, *balls, f"--{salt.text('option')}={salt.text('v')}"),
        "defect": ("markers", ct, *balls),
    }


def test_every_text_of_the_headers_is_salted_or_allowed_with_a_reason(salted_case, scan, allowed):
    whole = max(salted_case.ct.glob("*.dcm"), key=lambda path: path.stat().st_size)
    header = pydicom.dcmread(whole, stop_before_pixels=True)
    plain, salted = set(), set()
    for element in (*header.file_meta, *header.iterall()):
        if element.VR in {"PN", "LO", "SH", "ST", "LT", "UT", "UC", "UR", "UI", "DA", "DT", "TM",
                          "IS", "AE", "CS"} and str(element.value or ""):  # fmt: skip
            (salted if scan.of(str(element.value)) else plain).add(element.keyword)
    assert len(salted) > 900
    assert plain <= set(allowed)
    assert all(len(reason) > 5 for reason in allowed.values())


LEAKS = {
    "text": lambda word: f"case {word}: left tibia",
    "upper case": lambda word: f"CASE {word.upper()}",
    "utf-16": lambda word: word.encode("utf-16"),
    "escaped json": lambda word: "".join(f"\\u{ord(c):04x}" for c in word),
    "hex": lambda word: word.encode("utf-16-be").hex().upper(),
    "base64": lambda word: base64.b64encode(f"id={word};".encode()),
    "percent": lambda word: "".join(f"%{ord(c):02X}" for c in word),
    "png text": lambda word: _png(b"tEXt", b"Comment\0" + word.encode()),
    "png packed text": lambda word: _png(b"zTXt", b"Note\0\0" + zlib.compress(word.encode())),
    "archive": lambda word: _archive(word),
    "pdf information": lambda word: _pdf(lambda pdf: pdf.add_metadata({"/Title": f"of {word}"})),
    "pdf attachment": lambda word: _pdf(lambda pdf: pdf.add_attachment("a.txt", word.encode())),
    "pdf attachment's name": lambda word: _pdf(lambda pdf: pdf.add_attachment(word, b"x")),
    "pdf bookmark": lambda word: _pdf(lambda pdf: pdf.add_outline_item(title=word, page_number=0)),
}
"""How a string could hide in an output."""


def _png(kind, content):
    chunk = struct.pack(">L", len(content)) + kind + content + bytes(4)
    return b"\x89PNG\r\n\x1a\n" + chunk


def _archive(word):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scene.npy", f"bone of {word}")
    return buffer.getvalue()


def _pdf(change):
    pdf = PdfWriter()
    pdf.add_blank_page(100, 100)
    change(pdf)
    buffer = io.BytesIO()
    pdf.write(buffer)
    return buffer.getvalue()


@pytest.mark.parametrize("kind", LEAKS)
def test_the_scan_finds_a_leak_and_finds_none_where_there_is_none(kind, scan, salt):
    assert "text" in scan.of(LEAKS[kind](salt.text("leaked")))
    assert scan.of(LEAKS[kind]("harmless-word-of-a-case")) == set()


@pytest.mark.parametrize("style", ["%Y%m%d", "%Y-%m-%d", "%d.%m.%Y", "%m/%d/%Y", "%d %B %Y"])
def test_the_scan_finds_a_date_however_it_is_written(style, scan, salt):
    written = salt.dates["PatientBirthDate"].strftime(style)
    assert scan.of(f"born {written}.") == {"date PatientBirthDate"}
    assert scan.of(written.encode("utf-16-be")) == {"date PatientBirthDate"}


def test_the_scan_finds_numbers_times_uids_and_file_names(scan, salt, tmp_path):
    assert scan.of(f"x{salt.number}x") == {"number"}
    assert scan.of(f"at {salt.time}") == {"time"}
    assert scan.of(salt.uid()) == {"UID"}
    (tmp_path / salt.text("a file")).mkdir()
    assert scan.of_folder(tmp_path)


def test_the_scan_reads_the_text_of_a_prescription(an_export, scan, salt):
    document = json.loads((an_export / "plan.json").read_text())
    document["case_id"] = salt.text("the case id")
    assert "text the case id" in scan.of(prescription_pdf(document))
    document["case_id"] = "harmless"
    assert scan.of(prescription_pdf(document)) == set()


def test_a_plan_names_the_patient_nowhere(planned, salted_case, scan):
    assert scan.of(planned.stdout + planned.stderr) == set()
    folder = salted_case.home / "export"
    assert len(list(folder.iterdir())) == 5
    assert scan.of_folder(folder) == {}
    assert json.loads((folder / "plan.json").read_text())["case"]["image"] == {
        "path": None,
        "series_instance_uid": None,
    }


@pytest.mark.parametrize("command", ["markers", "recognise"])
def test_a_command_that_reads_the_ct_names_nobody(command, seen, scan):
    run = seen[command]
    assert run.code == 0, run.stderr
    assert len(run.stdout) > 300
    assert scan.of(run.stdout + run.stderr) == set()


@pytest.mark.parametrize("name", [name for name in CODES if "series" not in name.split(", ")[-1]])
def test_no_command_refusal_or_error_names_anybody(name, troubles, scan):
    code, text = troubles[name]
    assert code == CODES[name], text
    assert len(text) > 40
    assert scan.of(text) == set()


@pytest.mark.parametrize("name", ["several series", "unknown series"])
def test_a_choice_of_series_is_asked_for_without_their_uids(name, troubles, scan):
    code, text = troubles[name]
    assert code == CODES[name]
    assert "hexafix series" in text
    assert scan.of(text) == set()


@pytest.mark.parametrize("name", ["series", "series --json", "foreign words, series"])
def test_the_list_of_series_shows_their_uids_and_no_more(name, troubles, scan):
    code, text = troubles[name]
    assert code == 0, text
    assert scan.of(text) == {"UID"}


def test_the_listed_uid_is_the_series_own(troubles, salted_case):
    assert salted_case.series_uid in troubles["series"][1]


def test_an_identified_prescription_alone_names_the_patient(identified, salted_case, scan):
    assert scan.of(identified.stdout + identified.stderr) == set()
    assert "handle it as patient data" in identified.stderr
    folder = salted_case.home / "identified"
    tells = scan.of_folder(folder)
    assert set(tells) == {"prescription.pdf"}
    assert tells["prescription.pdf"] == {
        *("text", "text PatientName", "text PatientID"),
        *("date PatientBirthDate", "date StudyDate"),
    }
    assert folder.stat().st_mode & 0o777 == 0o700


def test_the_identity_is_on_every_page_and_in_no_metadata(identified, salted_case, scan):
    reader = PdfReader(salted_case.home / "identified" / "prescription.pdf")
    for page in reader.pages:
        assert {"text PatientName", "text PatientID"} <= scan.of(page.extract_text())
    catalogue = reader.trailer["/Root"]
    assert scan.of(str(reader.metadata)) == set()
    assert scan.of(catalogue["/Metadata"].get_data()) == set()
    assert scan.of(str(catalogue.get("/Outlines"))) == set()


def test_an_identified_export_differs_in_its_prescription_alone_and_verifies(
    planned, identified, salted_case
):
    one, other = salted_case.home / "export", salted_case.home / "identified"
    for name in ("plan.json", "schedule.csv", "markers.mrk.json"):
        assert (one / name).read_bytes() == (other / name).read_bytes()
    run = salted_case.run("verify", other, "--json")
    assert json.loads(run.stdout)["verified"] is True


def test_nothing_is_left_behind(before, planned, identified, seen, troubles, salted_case):
    assert list(salted_case.scratch.rglob("*")) == []
    exports = {salted_case.home / "export", salted_case.home / "identified"}
    after = {path for path in salted_case.home.rglob("*") if not exports & {path, *path.parents}}
    assert after == before
