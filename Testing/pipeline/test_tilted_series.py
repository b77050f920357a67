"""A CT of a tilted gantry through the whole chain: read right, said so, and verified."""

from __future__ import annotations

import json

import numpy as np
import pytest
from pypdf import PdfReader

TILT_DEG = -18.5
SENTENCE = "gantry tilt (H02): the slices were acquired with a tilt of -18.50 deg"


@pytest.fixture(scope="module")
def a_tilted_bundle(tmp_path_factory):
    """A phantom as a tilted DICOM series with its case, and what is true of it."""
    from hexafix.phantom import PhantomSpec, make_phantom, write_phantom

    spec = PhantomSpec(
        seed=11,
        correction="fragment-motion",
        size_ijk=(236, 250, 192),
        spacing_mm=(1.2, 1.15, 1.5),
        noise_hu=20.0,
        gantry_tilt_rad=float(np.radians(TILT_DEG)),
    )
    phantom = make_phantom(spec)
    path = write_phantom(phantom, tmp_path_factory.mktemp("tilted") / "bundle")
    return path, phantom.truth


@pytest.fixture(scope="module")
def a_tilted_plan(a_tilted_bundle, tmp_path_factory):
    """The export of the tilted series' plan."""
    from hexafix.case import load_case
    from hexafix.pipeline import plan_and_export

    folder = tmp_path_factory.mktemp("plan") / "prescription"
    plan_and_export(load_case(a_tilted_bundle[0]), folder)
    return folder


def test_the_plan_says_that_the_image_was_tilted_and_resampled(a_tilted_plan):
    image = json.loads((a_tilted_plan / "plan.json").read_text("utf-8"))["image"]
    assert image["resampled"] is True
    assert image["gantry_tilt_deg"] == pytest.approx(TILT_DEG, abs=1e-3)
    (said,) = [text for text in image["warnings"] if "tilt" in text]
    assert said.startswith(SENTENCE)
    assert "resampled from per-slice geometry" in said
    axes = np.array(image["ijk_to_lps"])[:3, :3]
    np.testing.assert_allclose(axes.T @ axes, np.diag(np.diag(axes.T @ axes)), atol=1e-6)


def test_a_straight_image_is_not_called_resampled(an_export):
    image = json.loads((an_export / "plan.json").read_text("utf-8"))["image"]
    assert image["resampled"] is False
    assert image["gantry_tilt_deg"] is None
    assert not any("tilt" in text for text in image["warnings"])


def test_the_surgeon_reads_of_the_tilt_in_the_prescription(a_tilted_plan):
    pages = [page.extract_text() for page in PdfReader(a_tilted_plan / "prescription.pdf").pages]
    (page,) = [" ".join(text.split()) for text in pages if "gantry tilt" in text]
    assert SENTENCE in page
    assert "resampled from per-slice geometry" in page
    assert "Warnings about the image and its balls" in page


def test_the_tilted_plan_is_as_exact_as_a_straight_one_and_verified(a_tilted_bundle, a_tilted_plan):
    from hexafix.phantom.compare import errors_against_truth
    from hexafix.verify import verify_export

    document = json.loads((a_tilted_plan / "plan.json").read_text("utf-8"))
    errors = errors_against_truth(document, a_tilted_bundle[1])
    assert errors["balls_found"] == errors["balls"]
    assert errors["ball_worst_mm"] < 0.06
    assert verify_export(a_tilted_plan)["verified"]


def test_markers_and_recognise_say_it_too(a_tilted_bundle):
    from hexafix.case import load_case
    from hexafix.cli.show import balls_text, recognition_text
    from hexafix.pipeline import find_markers, recognise
    from hexafix.pipeline.document import recognition
    from hexafix.pipeline.recognise import read_case_image

    case = load_case(a_tilted_bundle[0])
    found = find_markers(case.image_path, ball_diameter_mm=case.ball_diameter_mm)
    assert f"warning: {SENTENCE}" in balls_text(found)
    document = recognition(case, recognise(case, read_case_image(case)))
    assert f"warning: {SENTENCE}" in recognition_text(document)
