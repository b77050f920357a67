"""Edits, undo, redo and work in any order: no value of older inputs ever passes for fresh (H40)."""

import copy
import hashlib
import json
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
from hexafix.case import case_from_document
from hexafix.errors import Refused
from hexafix.presenter import Presenter, Step, StepState
from hexafix.presenter.scenes import with_scenes
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

STEPS = list(Step)
NUMBERS = [str(number) for number in range(1, 9)]
STRUTS = st.integers(1, 6)
READINGS = st.sampled_from([168.0, 170.5, 181.5, 999.0])
BALLS = st.integers(0, 7)
POINTS = st.sampled_from([[50.0, 0.0, 0.0], [60.0, 1.0, 2.0]])


def right_parts(document):
    """The document without the wrong values that the rules below can enter."""
    right = copy.deepcopy(document)
    right["case_id"] = right["case_id"] or "x"
    right["markers"]["ball_diameter_mm"] = min(40.0, right["markers"]["ball_diameter_mm"])
    if not set(right["strut_readings_mm"] or [None]).isdisjoint({None, 999.0}):
        right["strut_readings_mm"] = None
    if right["schedule"]["start_date"] == "2027-02-31":
        right["schedule"] = None
    if set(right["numbering"] or NUMBERS) != set(NUMBERS):
        right["numbering"] = None
    return json.dumps(right).encode()


def straight_chain(engine, case, numbering, present):
    """The chain without presenter, cache or a case of parts; a refusal ends it."""
    _, relaxed, sha256 = present
    volume = engine.read_image(case.image_path, series_instance_uid=None)
    balls = engine.find_case_balls(
        volume,
        ball_diameter_mm=case.ball_diameter_mm,
        added_lps_mm=case.marker_edits.added_lps_mm.tolist(),
        removed_lps_mm=case.marker_edits.removed_lps_mm.tolist(),
    )
    half_done = numbering and {int(number): at for number, at in numbering.items()}
    judged = engine.judge_case_numbering(replace(case, numbering=half_done or None), balls)
    made = {Step.LOAD: volume, Step.MARKERS: balls, Step.NUMBERING: judged}
    try:
        poses = made[Step.POSES] = engine.recognise_checked(
            case, volume=volume, balls=balls, accept_relaxed_layout=relaxed
        )
    except Refused:
        return made
    if case.strut_readings_mm is not None:
        made[Step.READINGS] = engine.weigh_document(case, poses)
    made[Step.CORRECTION] = engine.preview_target(case, poses)
    named = replace(case, case_sha256=sha256)
    plan = engine.plan_recognised(named, poses, accept_relaxed_layout=relaxed)
    return {**made, Step.SCHEDULE: plan, Step.EXPORT: engine.prescribe(plan)}


def made_of(value):
    return value["made"] if isinstance(value, dict) else value.made


class AnyOrder(RuleBasedStateMachine):
    engine_class = None
    case = None
    read_scene = None
    save_scene = None

    @initialize(planned=st.booleans(), reopened=st.booleans())
    def open(self, planned, reopened):
        self.folder = Path(tempfile.mkdtemp(prefix="hexafix-"))
        (self.folder / "ct.txt").write_text("one image")
        (self.folder / "case.json").write_text(json.dumps(self.case))
        self.presenter = Presenter(
            engine=self.engine_class(), threaded=False, read_scene=self.read_scene
        )
        assert self.presenter.open_case(self.folder / "case.json")
        self.past, self.future, self.exports = [], [], 0
        self.scenes, self.told = [], {}
        self.given = self.case["strut_readings_mm"]
        if planned:
            self.presenter.run_all()
            self.presenter.confirm_side("left")
            assert self.presenter.snapshot.can_export
        if planned and reopened:
            self.go_on_in_a_scene()

    def teardown(self):
        if hasattr(self, "presenter"):
            self.presenter.close()
            shutil.rmtree(self.folder)

    @property
    def present(self):
        version = self.presenter.version
        return version.raw, version.relaxed, version.sha256

    def act(self, edit):
        """Do an edit, and keep what undo must bring back."""
        before = self.present
        edit(self.presenter)
        if self.present != before:
            self.past.append(before)
            self.future.clear()

    # ------------------------------------------------------------ edits

    @rule(mm=st.sampled_from([10.0, 9.5, 80.0]))
    def set_diameter(self, mm):
        self.act(lambda p: p.set_ball_diameter(mm))

    @rule(side=st.sampled_from(["left", "right"]), bone=st.sampled_from(["tibia", "humerus"]))
    def set_limb(self, side, bone):
        self.act(lambda p: p.set_limb(side=side, bone=bone))

    @rule(strut=STRUTS, mm=READINGS)
    def set_reading(self, strut, mm):
        self.act(lambda p: p.set_reading(strut, mm))

    @rule()
    def forget_readings(self):
        self.act(lambda p: p.set_readings(None))

    @rule(z=st.sampled_from([150, 170]), dragging=st.booleans())
    def set_correction(self, z, dragging):
        before, label = self.present, self.presenter.version.label
        target = {"kind": "target-pose", "position_mm": [0, 0, z], "angles_deg": [0, 0, 0]}
        self.presenter.set_correction(target, dragging=dragging)
        if self.present != before:
            self.future.clear()
            if not label.startswith("dragging"):
                self.past.append(before)

    @rule(start=st.sampled_from(["2027-01-01", "2027-02-31"]), step=st.sampled_from([0.5, 1.0]))
    def set_schedule(self, start, step):
        self.act(lambda p: p.set_schedule({"start_date": start, "strut_step_mm": step}))

    @rule(name=st.sampled_from(["a", "b", ""]))
    def set_name(self, name):
        self.act(lambda p: p.set_case_id(name))

    @rule(radius=st.sampled_from([100.0, 99.0]))
    def set_layout(self, radius):
        rows = [dict(row) for row in self.case["markers"]["proximal"]]
        rows[0]["radius_mm"] = radius
        self.act(lambda p: p.set_markers("proximal", rows))

    @rule(point=POINTS)
    def add(self, point):
        self.act(lambda p: p.add_marker(point))

    @rule(ball=BALLS)
    def remove(self, ball):
        self.act(lambda p: p.remove_marker(ball))

    @rule(ball=BALLS, point=POINTS)
    def move(self, ball, point):
        self.act(lambda p: p.move_marker(ball, point))

    @rule(number=st.integers(1, 9), ball=BALLS)
    def assign(self, number, ball):
        self.act(lambda p: p.assign_number(number, ball))

    @rule(a=st.integers(1, 8), b=st.integers(1, 8))
    def swap(self, a, b):
        self.act(lambda p: p.swap_numbers(a, b))

    @rule(number=st.integers(1, 8))
    def clear(self, number):
        self.act(lambda p: p.clear_number(number))

    @rule()
    def automatically(self):
        self.act(lambda p: p.number_automatically())

    @rule(accepted=st.booleans())
    def accept_relaxed(self, accepted):
        self.act(lambda p: p.accept_relaxed_layout(accepted))

    @rule(confirmed=st.booleans())
    def confirm_front(self, confirmed):
        self.act(lambda p: p.confirm_ring_front(confirmed))

    # ------------------------------------------------------------ back, forth, work

    @rule()
    def undo(self):
        before = self.present
        self.presenter.undo()
        if self.past:
            self.future.append(before)
            assert self.present == self.past.pop()
        else:
            assert self.present == before

    @rule()
    def redo(self):
        before = self.present
        self.presenter.redo()
        if self.future:
            self.past.append(before)
            assert self.present == self.future.pop()
        else:
            assert self.present == before

    @rule(step=st.sampled_from(list(Step)))
    def run(self, step):
        self.presenter.run(step)

    @rule()
    def run_all(self):
        self.presenter.run_all()

    @rule(text=st.sampled_from(["one image", "another image"]))
    def change_the_image(self, text):
        (self.folder / "ct.txt").write_text(text)
        self.act(lambda p: p.load_image(self.folder / "ct.txt"))

    @rule(side=st.sampled_from(["left", "right"]))
    def confirm_side(self, side):
        self.presenter.confirm_side(side)

    @rule()
    def repeat_readings(self):
        self.presenter.repeat_readings(
            self.presenter.version.content.get("strut_readings_mm") or [1.0] * 6
        )

    @rule()
    def save(self):
        named = None if self.presenter.case_path else self.folder / "case.json"
        assert self.presenter.save_case(named)
        saved = (self.folder / "case.json").read_bytes()
        given = json.loads(self.present[0])["strut_readings_mm"]
        known = (None, self.given, self.presenter.readings_repeated)
        if given in known:
            assert saved == self.present[0]
            assert hashlib.sha256(saved).hexdigest() == self.present[2]
        else:
            once = {"schema_version": 2, "readings_to_repeat": True}
            assert json.loads(saved) == {**json.loads(self.present[0]), **once}

    @precondition(lambda self: self.presenter.is_fresh(Step.LOAD))
    @rule()
    def save_a_scene(self):
        path = self.folder / f"scene-{len(self.scenes)}.mrb"
        held = type(self).save_scene(self.presenter, path)
        made = {s: made_of(self.presenter.value(s)) for s in Step if self.presenter.is_done(s)}
        self.scenes.append((path, held, made, self.presenter.snapshot.confirmed["readings"]))

    @precondition(lambda self: self.presenter.is_fresh(Step.LOAD))
    @rule()
    def go_on_in_a_scene(self):
        self.save_a_scene()
        self.open_a_scene(-1)

    @precondition(lambda self: self.scenes)
    @rule(which=st.integers(0, 3))
    def open_a_scene(self, which):
        path, held, made, repeated = self.scenes[which % len(self.scenes)]
        assert self.presenter.open_scene(path)
        self.past, self.future = [], []
        raw, relaxed, sha256 = self.present
        image = {"path": path.name, "series_instance_uid": None}
        wanted = {**held["document"], "image": image}
        once = wanted.pop("readings_to_repeat", False)
        assert (json.loads(raw), relaxed) == (wanted, held["relaxed"])
        assert once or sha256 == held["case_sha256"]
        self.told[raw] = sha256
        self.given = None if once else wanted["strut_readings_mm"]
        assert once != repeated or wanted["strut_readings_mm"] is None
        for step in STEPS[: STEPS.index(held["computed_to"]) + 1]:
            # what was done is done again, of the same inputs to the last byte
            assert made_of(self.presenter.value(step)) == made[step] or once
        assert self.presenter.side_answer is None

    @rule()
    def export(self):
        allowed = self.presenter.snapshot.can_export
        self.exports += 1
        folder = self.folder / f"out-{self.exports}"
        assert self.presenter.export(folder) == allowed == folder.exists()

    # ------------------------------------------------------------ what always holds

    @invariant()
    def what_is_fresh_is_of_the_present_inputs(self):
        straight = self.straight()
        for step in filter(self.presenter.is_fresh, Step):
            assert made_of(self.presenter.value(step)) == made_of(straight[step]), step

    def straight(self):
        """Every value computed from the whole case at once, as far as it is right."""
        document = json.loads(self.present[0])
        case = case_from_document(
            right_parts(document), folder=self.folder, needs_image=False, plannable=False
        )
        engine = with_scenes(self.engine_class(), type(self).read_scene)
        return straight_chain(engine, case, document.get("numbering"), self.present)

    @invariant()
    def a_plan_names_the_bytes_of_its_case_or_what_its_scene_told_of_the_same_bytes(self):
        raw, _, sha256 = self.present
        assert sha256 in (hashlib.sha256(raw).hexdigest(), self.told.get(raw))

    @invariant()
    def an_export_is_possible_only_of_the_present_inputs(self):
        snapshot = self.presenter.snapshot
        files = self.presenter.prescription_files()
        if not snapshot.can_export:
            assert snapshot.export_blocked_by
            return
        document = json.loads(self.present[0])
        assert all(view.state == StepState.DONE for view in snapshot.steps)
        assert not any(table.stale for table in snapshot.tables.values())
        assert files["plan.json"].decode() == self.straight()[Step.EXPORT].made
        assert self.presenter.side_answer[0] == document["limb"]["side"]
        typed = document["strut_readings_mm"] != self.given
        assert not typed or self.presenter.readings_repeated == document["strut_readings_mm"]
        assert document.get("ring_front_confirmed") is not False

    @invariant()
    def every_state_says_what_is_so(self):
        for view in self.presenter.snapshot.steps:
            if view.state == StepState.DONE:
                assert self.presenter.is_fresh(view.step)
            if view.state in (StepState.STALE, StepState.READY):
                assert not self.presenter.is_fresh(view.step)


@pytest.fixture
def machine(a_fake_engine_class, a_case, a_fake_scene_reader, save_fake_scene):
    given = {
        "engine_class": a_fake_engine_class,
        "case": a_case,
        "read_scene": staticmethod(a_fake_scene_reader),
        "save_scene": staticmethod(save_fake_scene),
    }
    return type("Machine", (AnyOrder,), given)


def test_no_order_of_edits_undo_and_work_leaves_a_stale_result_marked_fresh(machine):
    run_state_machine_as_test(
        machine,
        settings=settings(
            max_examples=20,
            stateful_step_count=25,
            deadline=None,
            derandomize=True,
            suppress_health_check=list(HealthCheck),
        ),
    )
