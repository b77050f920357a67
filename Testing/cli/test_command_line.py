"""The command line keeps the contract: exit codes, one JSON document, nothing lost."""

import json
import os
import re
import subprocess
import sys

import pydicom
import pytest
from pypdf import PdfReader

PRIVATE = "Musterfrau^Erika"


def hexafix(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "hexafix", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
    )


@pytest.fixture(scope="module")
def a_case_on_disk(a_phantom, tmp_path_factory):
    """The phantom written as DICOM with names and numbers of a patient in its headers."""
    from hexafix.phantom import write_phantom

    folder = tmp_path_factory.mktemp("case") / "bundle"
    write_phantom(a_phantom, folder)
    for path in sorted((folder / "ct").iterdir()):
        header = pydicom.dcmread(path)
        header.PatientName = PRIVATE
        header.PatientID = "PID-4711-XYZ"
        header.PatientBirthDate = "19630208"
        header.InstitutionName = "Krankenhaus Nirgendwo"
        header.ReferringPhysicianName = "Doktor^Niemand"
        header.AccessionNumber = "ACC998877"
        header.StudyDate = "20261105"
        header.save_as(path)
    return folder


@pytest.fixture(scope="module")
def a_planned_case(a_case_on_disk, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "prescription"
    return hexafix("plan", a_case_on_disk, "--out", out, "--json"), out


def test_plan_prints_the_plan_and_writes_the_same(a_planned_case):
    run, out = a_planned_case
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout) == json.loads((out / "plan.json").read_text())
    names = {"plan.json", "schedule.csv", "prescription.pdf", "markers.mrk.json", "manifest.json"}
    assert {path.name for path in out.iterdir()} == names
    assert "read" in run.stderr


def test_the_contracts_keys_stand_in_the_plan(a_planned_case):
    document = json.loads(a_planned_case[0].stdout)
    assert document["schema_version"] == 1
    assert {"numbering", "rings", "mechanism", "gates", "layout", "schedule"} <= set(document)
    for ring in ("proximal", "distal"):
        keys = {"matrix_lps", "position_mm", "angles_deg", "rms_mm", "covariance"}
        assert keys <= set(document["rings"][ring])
    assert {"position_mm", "angles_deg", "matrix", "from_struts", "difference"} <= set(
        document["mechanism"]
    )


def test_no_patient_string_is_in_any_output(a_planned_case, a_case_on_disk):
    run, out = a_planned_case
    header = pydicom.dcmread(next((a_case_on_disk / "ct").iterdir()), stop_before_pixels=True)
    private = ["Musterfrau", "Erika", "PID-4711", "19630208", "Nirgendwo", "Niemand", "ACC998877"]
    private += ["20261105", "2026-11-05", str(header.SeriesInstanceUID)]
    private += [str(header.StudyInstanceUID), str(a_case_on_disk)]
    pages = PdfReader(out / "prescription.pdf").pages
    text = "\n".join(page.extract_text() for page in pages)
    everything = [run.stdout, run.stderr, text]
    everything += [path.read_bytes().decode("latin-1") for path in out.iterdir()]
    for word in private:
        assert not any(word in content for content in everything), word


def test_verify_accepts_the_export_and_refuses_a_changed_one(a_planned_case, tmp_path):
    _, out = a_planned_case
    run = hexafix("verify", out, "--json")
    assert run.returncode == 0
    assert json.loads(run.stdout)["verified"] is True
    changed = tmp_path / "changed"
    changed.mkdir()
    for path in out.iterdir():
        (changed / path.name).write_bytes(path.read_bytes())
    csv = (changed / "schedule.csv").read_text()
    (changed / "schedule.csv").write_text(csv.replace(".5", ".0", 1))
    run = hexafix("verify", changed, "--json")
    assert run.returncode == 3
    assert json.loads(run.stdout)["verified"] is False


def test_the_same_input_gives_the_same_bytes(a_planned_case, a_case_on_disk, tmp_path):
    _, out = a_planned_case
    run = hexafix("plan", a_case_on_disk, "--out", tmp_path / "again", "--quiet")
    assert run.returncode == 0
    assert run.stderr == ""
    for path in out.iterdir():
        assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes(), path.name


def test_markers_needs_nothing_but_the_image_and_the_diameter(a_case_on_disk, a_phantom):
    run = hexafix("markers", a_case_on_disk / "ct", "--diameter-mm", 10, "--json")
    found = json.loads(run.stdout)
    assert found["frame"] == "LPS"
    assert len(found["balls"]) == len(a_phantom.truth["balls"])
    for ball in found["balls"]:
        assert {"center_mm", "diameter_mm", "sigma_mm", "rms_residual_mm"} <= set(ball)
    assert all(set(other) == {"center_mm", "reason"} for other in found["rejected"])


def test_recognise_prints_the_contracts_keys(a_case_on_disk):
    run = hexafix("recognise", a_case_on_disk / "case.json", "--json")
    document = json.loads(run.stdout)
    assert {"numbering", "rings", "mechanism", "gates"} <= set(document)
    text = hexafix("recognise", a_case_on_disk, "--quiet")
    assert "proximal ring in LPS" in text.stdout


def test_check_layout_needs_no_image(a_case_on_disk, tmp_path):
    case = json.loads((a_case_on_disk / "case.json").read_text())
    layout = {
        "schema_version": 1,
        "proximal": case["markers"]["proximal"],
        "distal": case["markers"]["distal"],
    }
    (tmp_path / "layout.json").write_text(json.dumps(layout))
    run = hexafix("check-layout", tmp_path / "layout.json", "--json")
    document = json.loads(run.stdout)
    for ring in ("proximal", "distal"):
        assert document[ring]["rule"] in {"preferred", "relaxed", "violated"}
        keys = {"included_angles_deg", "uniqueness_mm", "predicted_error_mm", "predicted_error_deg"}
        assert keys <= set(document[ring])
    assert hexafix("check-layout", tmp_path / "layout.json").returncode == 0


def test_an_even_layout_is_told_to_be_ambiguous_with_a_better_one(tmp_path):
    ring = [
        {"number": n, "radius_mm": 100.0, "sweep_deg": 120.0 * (n - 1), "height_mm": 20.0}
        for n in (1, 2, 3)
    ]
    layout = {
        "schema_version": 1,
        "proximal": ring,
        "distal": [{**marker, "number": marker["number"] + 3} for marker in ring],
    }
    (tmp_path / "layout.json").write_text(json.dumps(layout))
    document = json.loads(hexafix("check-layout", tmp_path / "layout.json", "--json").stdout)
    assert document["proximal"]["uniqueness_mm"] == pytest.approx(0.0, abs=1e-6)
    assert any("move" in text for text in document["advice"])


def test_a_refusal_exits_with_3_writes_nothing_and_keeps_the_older_export(
    a_planned_case, a_case_on_disk
):
    _, out = a_planned_case
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    case = json.loads((a_case_on_disk / "case.json").read_text())
    case["strut_readings_mm"][2] += 10.0
    (a_case_on_disk / "typo.json").write_text(json.dumps(case))
    run = hexafix("plan", a_case_on_disk / "typo.json", "--out", out, "--json")
    assert run.returncode == 3
    refused = json.loads(run.stdout)["refused"]
    assert refused[0]["hazard"] == "H24"
    assert "strut 3" in refused[0]["message"]
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert not [path for path in out.parent.iterdir() if path != out]


def test_a_wrong_case_exits_with_2_and_names_every_fault(a_case_on_disk, tmp_path):
    case = json.loads((a_case_on_disk / "case.json").read_text())
    case["limb"]["side"] = "top"
    case["strut_readings_mm"][0] = 18.0
    (a_case_on_disk / "wrong.json").write_text(json.dumps(case))
    run = hexafix("plan", a_case_on_disk / "wrong.json", "--out", tmp_path / "out", "--json")
    assert run.returncode == 2
    where = {error["where"] for error in json.loads(run.stdout)["errors"]}
    assert where == {"limb.side", "strut_readings_mm[0]"}
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("plan",),
        ("plan", "nowhere.json", "--out", "x"),
        ("frobnicate",),
        ("markers", "nowhere", "--diameter-mm", "10"),
        ("markers", "nowhere", "--diameter-mm", "ten"),
        ("verify", "nowhere"),
        ("check-layout", "nowhere.json"),
        ("benchmark", "nothing"),
    ],
)
def test_a_wrong_command_line_exits_with_2_and_no_traceback(arguments):
    run = hexafix(*arguments)
    assert run.returncode == 2
    assert "Traceback" not in run.stderr


def test_help_names_every_command_of_the_contract():
    run = hexafix("--help")
    assert run.returncode == 0
    for command in ("demo", "phantom", "markers", "recognise", "check-layout", "plan", "verify"):
        assert re.search(rf"\b{command}\b", run.stdout)
    assert hexafix("--version").stdout.startswith("hexafix ")


def test_a_phantom_is_not_written_over_other_files(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    run = hexafix("phantom", tmp_path, "--quiet")
    assert run.returncode == 2
    assert (tmp_path / "thesis.txt").read_text() == "mine"
