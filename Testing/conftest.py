"""Fixtures for tests of more than one room: one small oblique phantom, made once."""

import copy
import json
import os

import pytest

OBLIQUE = {
    "size_ijk": (280, 300, 220),
    "spacing_mm": (1.0, 0.95, 1.3),
    "image_angles_rad": (0.08, -0.06, 0.11),
    "noise_hu": 20.0,
}
"""Oblique, anisotropic and off-origin, and coarse enough to be quick."""


@pytest.fixture(scope="session")
def a_phantom():
    """A synthetic CT with its truth and case; do not change it."""
    from hexafix.phantom import PhantomSpec, make_phantom

    return make_phantom(PhantomSpec(seed=11, correction="fragment-motion", **OBLIQUE))


@pytest.fixture
def a_phantom_case(a_phantom, tmp_path):
    """Reads the phantom's case with changes: `a_phantom_case(limb={...})`."""
    from hexafix.case import case_from_document

    def read(**changes):
        document = {**copy.deepcopy(a_phantom.case), **changes}
        raw = json.dumps(document).encode()
        return case_from_document(raw, folder=tmp_path, needs_image=False)

    return read


@pytest.fixture(scope="session")
def a_case_on_disk(a_phantom, tmp_path_factory):
    """The phantom's case file beside its CT as NRRD; copy the folder before changing it."""
    from hexafix.phantom import write_phantom

    folder = tmp_path_factory.mktemp("on-disk") / "phantom"
    write_phantom(a_phantom, folder, image_format="nrrd")
    return folder / "case.json"


@pytest.fixture(scope="session")
def a_recognised(a_phantom):
    """What the chain recognises in the phantom."""
    from pathlib import Path

    from hexafix.case import case_from_document
    from hexafix.pipeline import recognise

    raw = json.dumps(a_phantom.case).encode()
    case = case_from_document(raw, folder=Path(), needs_image=False)
    return recognise(case, a_phantom.volume)


@pytest.fixture(scope="session")
def an_export(a_phantom, tmp_path_factory):
    """An export of the phantom's plan; copy it before changing it."""
    from hexafix.case import case_from_document
    from hexafix.pipeline import plan_and_export

    folder = tmp_path_factory.mktemp("export")
    raw = json.dumps(a_phantom.case).encode()
    case = case_from_document(raw, folder=folder, needs_image=False)
    plan_and_export(case, folder / "prescription", volume=a_phantom.volume)
    return folder / "prescription"


def pytest_terminal_summary(terminalreporter):
    """In CI a test skipped for anything but the third-party corpus counts as a failure."""
    if not os.environ.get("HEXAFIX_CI"):
        return
    skipped = terminalreporter.stats.get("skipped", [])
    wrong = [r for r in skipped if "corpus" not in str(getattr(r, "longrepr", ""))]
    if wrong:
        terminalreporter.section("skipped in CI")
        for report in wrong:
            terminalreporter.line(f"{report.nodeid}: {report.longrepr}")


def pytest_sessionfinish(session, exitstatus):
    """Make the exit status of `pytest_terminal_summary` the process's."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if not os.environ.get("HEXAFIX_CI") or reporter is None:
        return
    skipped = reporter.stats.get("skipped", [])
    if any("corpus" not in str(getattr(r, "longrepr", "")) for r in skipped):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
