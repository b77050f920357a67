"""The chain taken step by step gives the bytes of the chain at one go."""

import io
import json
import sys
import threading
from pathlib import Path

import numpy as np
import pypdfium2
import pytest
import SimpleITK
from hexafix import pipeline
from hexafix.case import case_from_document, partial_case
from hexafix.errors import InputError, LayoutRejected, MarkersNotFound, MissingLibrary
from hexafix.report.picture import SceneRenderer
from hexafix.report.surgeon import ring_table
from hexafix.threads import PDFIUM
from hexafix.verify import verify_export
from pypdf import PdfReader


def text_of(pdf):
    """All words of a PDF, one space between them."""
    with pypdfium2.PdfDocument(pdf) as document:
        pages = [page.get_textpage().get_text_range() for page in document]
    return " ".join(" ".join(page.split()) for page in pages)


@pytest.fixture(scope="module")
def prescription(a_phantom, a_recognised):
    """The phantom's prescription by steps, each with only the parts of the case that it needs."""
    raw = json.dumps(a_phantom.case).encode()
    for_poses = partial_case(raw, folder=Path(), keep=("numbering", "strut_readings_mm"))
    recognised = pipeline.recognise_checked(
        for_poses, volume=a_phantom.volume, balls=a_recognised.balls
    )
    case = case_from_document(raw, folder=Path(), needs_image=False)
    return pipeline.prescribe(pipeline.plan_recognised(case, recognised))


def test_every_file_has_the_bytes_of_the_export_at_one_go(prescription, an_export, tmp_path):
    pipeline.write_prescription(prescription, tmp_path / "by-steps")
    names = sorted(path.name for path in an_export.iterdir())
    assert names == sorted(path.name for path in (tmp_path / "by-steps").iterdir())
    for name in names:
        assert (tmp_path / "by-steps" / name).read_bytes() == (an_export / name).read_bytes(), name


def test_the_document_is_what_plan_json_holds(prescription):
    assert json.loads(prescription.files["plan.json"]) == json.loads(
        json.dumps(prescription.document)
    )
    assert [g["gate"] for g in prescription.document["gates"]][-2:] == ["G9", "G9"]
    assert not prescription.names_the_patient
    with pytest.raises(TypeError):
        prescription.files["plan.json"] = b""


def test_a_prescription_is_not_written_over_something_else(prescription, tmp_path):
    (tmp_path / "holiday.txt").write_text("mine")
    with pytest.raises(InputError):
        pipeline.write_prescription(prescription, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["holiday.txt"]


def test_balls_that_are_given_are_not_searched_again(a_phantom, a_phantom_case, a_recognised):
    class Untouchable(type(a_phantom.volume)):
        @property
        def voxels(self):
            raise AssertionError("the voxels were looked at")

    blind = object.__new__(Untouchable)
    for name in ("ijk_to_lps", "source"):
        object.__setattr__(blind, name, getattr(a_phantom.volume, name))
    seen = pipeline.recognise(a_phantom_case(), blind, balls=a_recognised.balls)
    np.testing.assert_array_equal(seen.mechanism.pose.matrix, a_recognised.mechanism.pose.matrix)


def test_the_checked_step_refuses_a_layout_before_the_image(a_phantom, a_phantom_case):
    markers = json.loads(json.dumps(a_phantom.case["markers"]))
    for marker, sweep in zip(markers["proximal"], (0, 8, 16, 24), strict=True):
        marker["sweep_deg"] = sweep
    with pytest.raises(LayoutRejected):
        pipeline.recognise_checked(a_phantom_case(markers=markers), volume=None)


def test_the_steps_documents_are_the_commands(a_plan, a_phantom_case):
    recognised, case = a_plan.recognised, a_plan.case
    document = pipeline.recognition_document(case, recognised)
    planned = pipeline.plan_document_of(a_plan)
    assert document["rings"] == planned["rings"]
    assert pipeline.balls_document(recognised.balls)["balls"][0]["center_mm"]
    assert "added" not in json.dumps(planned)
    layout = pipeline.layout_document(case.proximal, case.distal)
    assert layout == pipeline.check_case_layout(case.proximal, case.distal)


EDITED = {"schema_version": 2, "ring_front_confirmed": True}


@pytest.fixture(scope="module")
def edited(a_phantom, a_recognised):
    """The phantom's case with a ball dragged, planned by the case alone."""
    center = a_recognised.balls.balls[4].center_mm
    edits = {
        "removed_lps_mm": [center.tolist()],
        "added_lps_mm": [(center + np.array([1.0, 1.0, -1.0])).tolist()],
    }
    raw = json.dumps({**a_phantom.case, **EDITED, "marker_edits": edits}).encode()
    case = case_from_document(raw, folder=Path(), needs_image=False)
    plan = pipeline.plan_correction(case, volume=a_phantom.volume)
    return pipeline.prescribe(plan, renderer=SceneRenderer(opengl_windows=()))


def test_the_users_edits_are_followed_by_every_door(edited, prescription):
    added = [ball for ball in edited.document["balls"] if ball.get("added")]
    (same,) = [b for b in prescription.document["balls"] if b["number"] == added[0]["number"]]
    assert len(added) == 1
    assert added[0]["center_mm"] == same["center_mm"]
    for key in ("rings", "mechanism", "schedule", "numbering", "layout"):
        assert edited.document[key] == prescription.document[key], key
    assert edited.document["case"]["marker_edits"]["added_lps_mm"]


def test_a_removed_ball_is_missed_by_name(a_phantom, a_phantom_case, a_recognised):
    center = a_recognised.balls.balls[4].center_mm.tolist()
    case = a_phantom_case(**EDITED, marker_edits={"removed_lps_mm": [center]})
    with pytest.raises(MarkersNotFound) as error:
        pipeline.recognise(case, a_phantom.volume)
    assert error.value.faults[0].hazard == "H13"
    balls = pipeline.case_balls(case, a_phantom.volume)
    assert "removed by the user" in [other.reason for other in balls.rejected]


def test_an_edited_export_is_verified_by_the_other_road(edited, tmp_path):
    pipeline.write_prescription(edited, tmp_path / "out")
    assert verify_export(tmp_path / "out")["verified"]


def test_the_surgeon_reads_whether_the_rings_front_was_confirmed(edited, prescription):
    said = "Front of both rings (notch) confirmed against the picture:"
    assert f"{said} yes." in text_of(edited.files["prescription.pdf"])
    assert said not in text_of(prescription.files["prescription.pdf"])


def test_the_surgeon_reads_that_the_rings_front_was_not_confirmed(edited):
    denied = json.loads(edited.files["plan.json"])
    denied["case"]["ring_front_confirmed"] = False
    assert ring_table(denied).note.endswith("confirmed against the picture: NO.")
    del denied["case"]["ring_front_confirmed"]
    assert "notch" not in ring_table(denied).note


def test_without_opengl_the_prescription_is_drawn_by_lines(edited, prescription):
    said = "Line drawing of rings, struts and balls"
    assert said in text_of(edited.files["prescription.pdf"])
    assert said not in text_of(prescription.files["prescription.pdf"])


def test_the_surgeon_reads_which_ball_the_user_put_there(edited, prescription):
    (number,) = [b["number"] for b in edited.document["balls"] if b.get("added")]
    said = "Put there by the user, not found by itself: ball"
    assert f"{said} {number}." in text_of(edited.files["prescription.pdf"])
    assert said not in text_of(prescription.files["prescription.pdf"])


def test_the_pages_are_pictures_of_the_prescription(prescription):
    pdf = prescription.files["prescription.pdf"]
    pages = pipeline.prescription_pages(pdf, dpi=40.0)
    printed = PdfReader(io.BytesIO(pdf)).pages
    assert len(pages) == len(printed)
    for page, png in zip(printed, pages, strict=True):
        assert png.startswith(b"\x89PNG\r\n\x1a\n")
        columns, rows = (int.from_bytes(png[k : k + 4], "big") for k in (16, 20))
        assert abs(columns - float(page.mediabox.width) * 40 / 72) <= 1
        assert abs(rows - float(page.mediabox.height) * 40 / 72) <= 1


def test_a_page_read_by_another_program_is_paper_with_ink(prescription, tmp_path):
    png = pipeline.prescription_pages(prescription.files["prescription.pdf"], dpi=50.0)[0]
    (tmp_path / "page.png").write_bytes(png)
    image = SimpleITK.ReadImage(str(tmp_path / "page.png"))
    assert image.GetNumberOfComponentsPerPixel() == 3
    pixels = SimpleITK.GetArrayFromImage(image)
    assert pixels.shape[:2] == (image.GetHeight(), image.GetWidth())
    assert np.mean(pixels.min(axis=-1) > 240) > 0.5
    assert pixels.min() < 60


@pytest.mark.parametrize("dpi", [0.0, 5000.0, float("nan")])
def test_pages_are_drawn_at_a_screens_resolutions_only(dpi):
    with pytest.raises(InputError) as error:
        pipeline.prescription_pages(b"", dpi=dpi)
    assert error.value.faults[0].code == "page-resolution"


def test_what_is_no_pdf_has_no_pages():
    with pytest.raises(InputError) as error:
        pipeline.prescription_pages(b"no PDF")
    assert error.value.faults[0].code == "not-a-pdf"


def test_without_the_library_the_pages_say_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pypdfium2", None)
    with pytest.raises(MissingLibrary) as error:
        pipeline.prescription_pages(b"%PDF-")
    assert "pypdfium2" in str(error.value)


def test_pages_wait_while_another_thread_reads_a_pdf(prescription):
    pdf, pages = prescription.files["prescription.pdf"], []
    drawing = threading.Thread(
        target=lambda: pages.extend(pipeline.prescription_pages(pdf, dpi=20.0))
    )
    with PDFIUM:
        drawing.start()
        drawing.join(0.3)
        assert pages == []
        assert drawing.is_alive()
    drawing.join()
    assert pages
