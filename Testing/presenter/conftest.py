"""A fake pipeline: quick, counted, as slow or refusing as a test asks for."""

import copy
import hashlib
import json
import threading
from types import SimpleNamespace

import pytest

from hexafix.errors import Refused
from hexafix.progress import silent

GATE = {
    "gate": "G2", "code": "ring-rms", "name": "rigid RMS", "hazard": "H01", "value": 0.02,
    "limit": 0.5, "unit": "mm", "passed": True, "message": "good", "next_step": "",
}  # fmt: skip


def digest(*values):
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=str).encode()).hexdigest()


class FakeEngine:
    """Every value is a digest of what it was made from, so that a stale one shows."""

    def __init__(self):
        self.calls = []
        self.refuse = set()
        self.hold = {}
        self.entered = threading.Event()

    def _made(self, name, *values):
        self.calls.append(name)
        if name in self.refuse:
            raise Refused.of(f"{name}-refused", f"{name} refuses", hazard="H12", next_step="look")
        return digest(name, *values)

    def _long(self, name, progress):
        progress(name, 0.0)
        if name in self.hold:
            self.entered.set()
            while not self.hold[name].wait(0.002):
                progress(name, 0.5)
        progress(name, 1.0)

    def image_series(self, path, *, progress=silent):
        return {"series": [], "patients": 1, "skipped": []}

    def read_image(self, path, *, series_instance_uid=None, progress=silent):
        self._long("read_image", progress)
        content = path.read_bytes()
        made = self._made("read_image", content.decode(), series_instance_uid)
        return SimpleNamespace(made=made)

    def image_document(self, volume):
        return {
            "kind": "nrrd", "size_ijk": [4, 4, 4], "spacing_mm": [1.0, 1.0, 1.0],
            "sha256": volume.made, "warnings": [],
        }  # fmt: skip

    def find_case_balls(
        self,
        volume,
        *,
        ball_diameter_mm,
        added_lps_mm=(),
        removed_lps_mm=(),
        found=None,
        progress=silent,
    ):
        if found is None:
            self._long("find_case_balls", progress)
            self.calls.append("search")
        self._made("edit_balls")
        made = digest("balls", volume.made, ball_diameter_mm, added_lps_mm, removed_lps_mm)
        return SimpleNamespace(made=made)

    def with_ball_added(self, edits, *, lps_mm):
        return {**edits, "added_lps_mm": [*edits["added_lps_mm"], lps_mm]}

    def with_ball_removed(self, edits, *, ball):
        return {**edits, "removed_lps_mm": [*edits["removed_lps_mm"], ball["center_mm"]]}

    def balls_document(self, balls):
        ball = {
            "diameter_mm": 10.0, "sigma_mm": [0.01] * 3, "rms_residual_mm": 0.02,
            "core_hu": 3000.0, "warnings": [],
        }  # fmt: skip
        centers = [[float(k), 2.0 * k, 3.0 * k] for k in range(8)]
        return {
            "balls": [{"center_mm": center, **ball} for center in centers],
            "rejected": [], "warnings": [],
        }  # fmt: skip

    def judge_case_numbering(self, parts, balls):
        assigned = parts.numbering
        found = {str(k + 1): k for k in range(8)}
        if assigned is not None:
            found = {str(n): round(float(p[0])) for n, p in assigned.items()}
        lengths = parts.strut_readings_mm
        made = self._made("judge", balls.made, found, None if lengths is None else list(lengths))
        ring = {"residuals_mm": dict.fromkeys(found, 0.01), "rms_mm": 0.01}
        return {
            "made": made, "complete": len(found) == 8, "assigned": found,
            "rings": {"proximal": ring, "distal": {"residuals_mm": {}}}, "faults": [],
        }  # fmt: skip

    def recognise_checked(
        self, case, *, volume=None, balls=None, accept_relaxed_layout=False, progress=silent
    ):
        self._long("recognise", progress)
        case_made = digest(dict(case.document), accept_relaxed_layout)
        made = self._made("recognise", volume.made, balls.made, case_made)
        return SimpleNamespace(made=made)

    def recognition_document(self, case, recognised):
        pose = {"position_mm": [0.0] * 3, "angles_deg": [0.0] * 3, "rms_mm": 0.01}
        return {
            "made": recognised.made, "rings": {"proximal": pose, "distal": pose},
            "mechanism": pose, "gates": [GATE],
        }  # fmt: skip

    def layout_document(self, proximal, distal):
        ring = {
            "included_angles_deg": [105.0, 120.0], "rule": "preferred", "uniqueness_mm": 9.0,
            "predicted_error_mm": 0.2, "predicted_error_deg": 0.1,
        }  # fmt: skip
        return {"proximal": ring, "distal": ring, "advice": []}

    def weigh_document(self, case, recognised):
        made = self._made("weigh", recognised.made, dict(case.document))
        return {"made": made, "struts": [], "faults": []}

    def preview_target(self, case, recognised):
        return {"made": self._made("preview", recognised.made, dict(case.document)), "faults": []}

    def plan_recognised(self, case, recognised, *, accept_relaxed_layout=False):
        made = self._made("plan", recognised.made, case.case_sha256, accept_relaxed_layout)
        return SimpleNamespace(made=made, case=case)

    def plan_document_of(self, plan):
        row = {"day": 0, "date": "2026-12-01", "adjustment": 0, "strut_mm": [180.0] * 6}
        return {
            "made": plan.made,
            "gates": [GATE],
            "schedule": {
                "start_date": "2026-12-01", "days": 1, "adjustments_per_day": 4,
                "ruling_point": "centre", "rate_mm_per_day": 1.0, "rate_deg_per_day": 1.0,
                "end_error_mm": 0.1, "end_error_deg": 0.1, "strut_step_mm": 0.5, "rows": [row],
            },
        }  # fmt: skip

    def prescribe(self, plan, *, progress=silent):
        self._long("prescribe", progress)
        made = self._made("prescribe", plan.made)
        files = {"plan.json": made.encode()}
        return SimpleNamespace(made=made, document={"made": made, "gates": [GATE]}, files=files)

    def write_prescription(self, prescription, folder):
        folder.mkdir()
        for name, content in prescription.files.items():
            (folder / name).write_bytes(content)

    def playback(self, plan):
        return SimpleNamespace(rows=(), made=plan.made)

    def pictures(self, document):
        return {"strut_curves": "<svg/>"}

    def layout_pictures(self, proximal, distal):
        return {"layout_proximal": "<svg/>"}


MARKER = {"radius_mm": 100.0, "height_mm": 20.0}
CASE = {
    "schema_version": 1,
    "case_id": "left-tibia-01",
    "limb": {"side": "left", "bone": "tibia"},
    "image": {"path": "ct.txt", "series_instance_uid": None},
    "fixator": "generic-6sps-160",
    "markers": {
        "ball_diameter_mm": 10.0,
        "proximal": [
            {"number": k, "sweep_deg": a, **MARKER}
            for k, a in ((1, 0.0), (2, 105.0), (3, 225.0), (4, 300.0))
        ],
        "distal": [
            {"number": k, "sweep_deg": a, **MARKER}
            for k, a in ((5, 20.0), (6, 120.0), (7, 240.0), (8, 180.0))
        ],
    },
    "numbering": None,
    "strut_readings_mm": [180.0, 175.0, 167.0, 168.0, 157.0, 181.5],
    "correction": {"kind": "target-pose", "position_mm": [0, 0, 160], "angles_deg": [0, 0, 0]},
    "schedule": {"start_date": "2026-12-01"},
}


@pytest.fixture
def a_case():
    return copy.deepcopy(CASE)


@pytest.fixture
def an_engine():
    return FakeEngine()


@pytest.fixture
def a_case_file(tmp_path, a_case):
    """A complete case on disk; its image is a text."""
    (tmp_path / "ct.txt").write_text("one image")
    file = tmp_path / "case.json"
    file.write_text(json.dumps(a_case))
    return file


@pytest.fixture
def make_presenter():
    """Presenters that are closed at the end."""
    from hexafix.presenter import Presenter

    made = []

    def make(**options):
        made.append(Presenter(**options))
        return made[-1]

    yield make
    for presenter in made:
        presenter.close()


@pytest.fixture
def a_presenter(make_presenter, an_engine, a_case_file):
    """With the complete case open, working on the calling thread."""
    presenter = make_presenter(engine=an_engine, threaded=False)
    assert presenter.open_case(a_case_file)
    return presenter
