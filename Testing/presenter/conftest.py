"""A fake pipeline: quick, counted, as slow or refusing as a test asks for.

Each value is a digest of what it was made from, and each function reads from a case what the real
one reads, so that a value of older inputs, or of too few, shows.
"""

import copy
import hashlib
import itertools
import json
import threading
from pathlib import Path
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


def numbers_of(case):
    return None if case.numbering is None else {n: list(p) for n, p in case.numbering.items()}


def sites_of(case):
    rings = (case.proximal, case.distal)
    return [(s.number, s.radius_mm, round(s.sweep_rad, 9)) for r in rings for s in r.sites]


def struts_of(case):
    if case.strut_readings_mm is None or case.fixator is None:
        return None
    return [list(case.strut_readings_mm), case.fixator.id]


class FakeEngine:
    """The pipeline's functions; `hold` keeps one under way, `fail` makes one raise."""

    def __init__(self):
        self.calls = []
        self.fail = {}
        self.hold = {}
        self.entered = threading.Event()

    def _made(self, name, *values):
        self.calls.append(name)
        if name in self.fail:
            raise self.fail[name]
        return digest(name, *values)

    def _long(self, name, progress):
        progress(name, 0.0)
        if name in self.hold:
            self.entered.set()
            while not self.hold[name].wait(0.002):
                progress(name, 0.5)
        progress(name, 1.0)

    def image_series(self, path, *, progress=silent):
        self._long("image_series", progress)
        series = {
            "number": 1, "description": "axial", "modality": "CT", "slices": 40,
            "size_ij": [512, 512], "series_instance_uid": "1.2.3", "left_out": None,
            "refused": [],
        }  # fmt: skip
        return {"series": [series], "patients": 1, "skipped": []}

    def read_image(self, path, *, series_instance_uid=None, progress=silent):
        self._long("read_image", progress)
        content = Path(path).read_text()
        return SimpleNamespace(made=self._made("read_image", content, series_instance_uid))

    def image_document(self, volume):
        return {
            "kind": "nrrd", "size_ijk": [4, 4, 4], "spacing_mm": [1.0, 1.0, 1.0],
            "gantry_tilt_deg": None, "sha256": volume.made, "warnings": [],
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
        edits = list(added_lps_mm), list(removed_lps_mm)
        made = self._made("find_case_balls", volume.made, ball_diameter_mm, edits)
        return SimpleNamespace(made=made)

    def balls_document(self, balls):
        ball = {
            "diameter_mm": 10.0, "sigma_mm": [0.01] * 3, "rms_residual_mm": 0.02,
            "core_hu": 3000.0, "warnings": [],
        }  # fmt: skip
        centers = [[float(k), 2.0 * k, 3.0 * k] for k in range(8)]
        return {
            "balls": [{"center_mm": center, **ball} for center in centers],
            "rejected": [{"center_mm": [1.0, 2.0, 3.0], "reason": "radius"}], "warnings": [],
        }  # fmt: skip

    def with_ball_added(self, edits, *, lps_mm):
        return {**edits, "added_lps_mm": [*edits["added_lps_mm"], lps_mm]}

    def with_ball_removed(self, edits, *, ball):
        return {**edits, "removed_lps_mm": [*edits["removed_lps_mm"], ball["center_mm"]]}

    def _settled(self, case):
        """A radius of 99 mm stands for layouts that leave the numbering a choice."""
        if case.numbering is not None:
            return numbers_of(case)
        return struts_of(case) if case.proximal.sites[0].radius_mm == 99.0 else "layout"

    def judge_case_numbering(self, case, balls):
        settled = self._settled(case)
        found = {str(k + 1): k for k in range(8)}
        if case.numbering is not None:
            found = {str(n): round(float(p[0])) for n, p in case.numbering.items()}
        faults = []
        if settled is None:
            faults = [{"code": "numbering-ambiguous", "message": "no choice", "hazard": "H18"}]
        residuals = dict.fromkeys(found, 0.01)
        return {
            "made": self._made("judge", balls.made, sites_of(case), settled),
            "complete": len(found) == 8 and not faults, "assigned": found, "faults": faults,
            "rings": {"proximal": {"residuals_mm": residuals}, "distal": {"residuals_mm": {}}},
        }  # fmt: skip

    def recognise_checked(
        self, case, *, volume=None, balls=None, accept_relaxed_layout=False, progress=silent
    ):
        self._long("recognise", progress)
        read = [case.limb.side, case.limb.bone, sites_of(case), self._settled(case)]
        read += [case.ball_diameter_mm, accept_relaxed_layout]
        made = self._made("recognise", volume.made, balls.made, read)
        if case.limb.bone == "humerus":
            raise Refused.of("limb-conflict", "not the limb of the image", hazard="H37")
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
        made = self._made("weigh", recognised.made, struts_of(case))
        struts = [
            {
                "strut": k + 1, "reading_mm": float(reading), "length_mm": float(reading),
                "ct_length_mm": 180.0, "difference_mm": 0.1, "verdict": "agrees",
            }
            for k, reading in enumerate(case.strut_readings_mm)
        ]  # fmt: skip
        return {"made": made, "struts": struts, "faults": []}

    def preview_target(self, case, recognised):
        rules = case.schedule and [case.schedule.compensation, case.schedule.strut_step_mm]
        read = [dict(case.document)["correction"], case.limb.side, struts_of(case), rules]
        return {
            "made": self._made("preview", recognised.made, read), "faults": [],
            "target": {"position_mm": [0.0, 0.0, 160.0], "angles_deg": [0.0] * 3},
            "struts_mm": [180.0] * 6, "within_stroke": [True] * 6,
        }  # fmt: skip

    def plan_recognised(self, case, recognised, *, accept_relaxed_layout=False):
        read = [case.case_sha256, case.fixator_sha256, accept_relaxed_layout]
        return SimpleNamespace(made=self._made("plan", recognised.made, read))

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
        document = {"made": made, "gates": [GATE]}
        return SimpleNamespace(made=made, document=document, files={"plan.json": made.encode()})

    def write_prescription(self, prescription, folder):
        self._made("write")
        folder.mkdir()
        for name, content in prescription.files.items():
            (folder / name).write_bytes(content)

    def playback(self, plan):
        self.calls.append("playback")
        return SimpleNamespace(rows=(), made=plan.made)

    def pictures(self, document):
        return {"strut_curves": document["made"]}

    def layout_pictures(self, proximal, distal):
        return {"layout_proximal": "<svg/>"}


def read_fake_scene(path, *, progress=silent):
    """A scene's file as a test writes it: JSON, its CT the value that the fake engine read."""
    from hexafix.presenter.scenes import SceneContent

    progress("open the scene", 0.0)
    try:
        held = json.loads(path.read_text())
    except ValueError:
        raise Refused.of("bundle-damaged", "no scene", hazard="H49") from None
    made = held.pop("volume")
    return SceneContent(**held, volume=None if made is None else SimpleNamespace(made=made))


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
def a_fake_engine_class():
    return FakeEngine


@pytest.fixture
def a_fake_scene_reader():
    return read_fake_scene


@pytest.fixture
def save_fake_scene():
    """Saves what `SceneSync` saves: case, hash, CT, what is done; returns what was written."""
    from hexafix.presenter import Step, StepState

    def save(presenter, path, **other):
        document, sha256 = presenter.case_for_scene()
        document["image"] = {"path": "volume-node", "series_instance_uid": None}
        done = list(
            itertools.takewhile(lambda v: v.state == StepState.DONE, presenter.snapshot.steps)
        )
        volume = presenter.value(Step.LOAD) if presenter.is_fresh(Step.LOAD) else None
        held = {
            "document": document,
            "case_sha256": sha256 or digest(document),
            "volume": volume and volume.made,
            "relaxed": presenter.version.relaxed,
            "step": presenter.snapshot.current.value,
            "computed_to": done[-1].step.value if done else "",
            "split_fraction": presenter.split_fraction,
        }
        path.write_text(json.dumps({**held, **other}))
        return {**held, **other}

    return save


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


@pytest.fixture
def a_planned(a_presenter):
    """With everything computed and the side said twice."""
    a_presenter.run_all()
    a_presenter.confirm_side("left")
    assert a_presenter.snapshot.can_export, a_presenter.snapshot.export_blocked_by
    return a_presenter


@pytest.fixture
def states():
    """The states of all steps, by name."""

    def of(presenter):
        return {view.step.value: view.state.value for view in presenter.snapshot.steps}

    return of


@pytest.fixture
def codes():
    """The codes of all banners."""

    def of(presenter):
        return [banner.code for banner in presenter.snapshot.banners]

    return of
