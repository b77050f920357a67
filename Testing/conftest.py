"""Fixtures for tests of more than one room: one small oblique phantom, made once."""

import copy
import json
import os
from pathlib import Path

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


MARKER = {"radius_mm": 100.0, "height_mm": 20.0}
WHOLE = {
    "schema_version": 2,
    "case_id": "left-tibia-01",
    "limb": {"side": "left", "bone": "tibia"},
    "image": {"path": "ct", "series_instance_uid": None},
    "fixator": "generic-6sps-160",
    "markers": {
        "ball_diameter_mm": 10.0,
        "proximal": [{"number": k, "sweep_deg": 105.0 * k, **MARKER} for k in (1, 2, 3)],
        "distal": [{"number": k, "sweep_deg": 105.0 * k, **MARKER} for k in (4, 5, 6)],
    },
    "strut_readings_mm": [180.0, 175, 167.0, 168.0, 157.0, 181.5],
    "schedule": {
        "start_date": "2026-12-01",
        "adjustments_per_day": 4,
        "strut_step_mm": 0.5,
        "structures_at_risk_lps_mm": [[1.0, 2.0, 3.0]],
    },
}
POINTS = [[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [0.0, 50.0, 0.0]]
CORRECTIONS = (
    {"kind": "target-pose", "position_mm": [0, 0, 160.0], "angles_deg": [0, 0, 0]},
    {
        "kind": "fragment-motion",
        "moving": "distal",
        "matrix_lps": [[float(i == j) for j in range(4)] for i in range(4)],
    },
    {
        "kind": "landmarks",
        "moving": "distal",
        "moving_points_lps_mm": POINTS,
        "fixed_points_lps_mm": POINTS,
    },
    {
        "kind": "deformity",
        "moving": "distal",
        "origin_lps_mm": [1.0, 2.0, 3.0],
        "ap_angulation_deg": 5.0,
        "ap_angulation": "varus",
        "axial_rotation": None,
    },
)


@pytest.fixture(scope="session")
def whole_documents():
    """Right case documents that hold all that doors show, one for each kind of correction."""
    return tuple({**copy.deepcopy(WHOLE), "correction": kind} for kind in CORRECTIONS)


@pytest.fixture(scope="session")
def odd_documents(whole_documents):
    """The same with one value of another kind, too many of it, or none."""

    def places(value, place=()):
        if place:
            yield place
        inside = value.items() if isinstance(value, dict) else enumerate(value[:1])
        for key, held in inside:
            yield from (
                places(held, (*place, key)) if isinstance(held, dict | list) else [(*place, key)]
            )

    made = []
    for first, document in enumerate(whole_documents):
        for place in places(document):
            if first and place[0] != "correction":
                continue
            for odd in (None, "x", 7, True, [], {}, [None], [[1.0, 2.0]], [{}], ...):
                changed = copy.deepcopy(document)
                inner = changed
                for key in place[:-1]:
                    inner = inner[key]
                inner[place[-1]] = odd
                if odd is ...:
                    del inner[place[-1]]
                made.append(changed)
    return made


@pytest.fixture(scope="session")
def a_read_case(a_phantom):
    """The phantom's case as it is; there is no image in its folder."""
    from hexafix.case import case_from_document

    raw = json.dumps(a_phantom.case).encode()
    return case_from_document(raw, folder=Path(), needs_image=False)


@pytest.fixture(scope="session")
def a_recognised(a_phantom, a_read_case):
    """What the chain recognises in the phantom."""
    from hexafix.pipeline import recognise

    return recognise(a_read_case, a_phantom.volume)


@pytest.fixture(scope="session")
def a_plan(a_read_case, a_recognised):
    """The plan of the phantom's case; do not change it."""
    from hexafix.pipeline import plan_recognised

    return plan_recognised(a_read_case, a_recognised)


@pytest.fixture(scope="session")
def an_export(a_phantom, a_read_case, tmp_path_factory):
    """An export of the phantom's plan; copy it before changing it."""
    from hexafix.pipeline import plan_and_export

    folder = tmp_path_factory.mktemp("export")
    plan_and_export(a_read_case, folder / "prescription", volume=a_phantom.volume)
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
