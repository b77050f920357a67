"""The scene follows the presenter, and what is dragged in the scene becomes an edit of the case."""

import hashlib
import json
from types import SimpleNamespace

import numpy as np
import pytest
from hexafix import pipeline
from hexafix.errors import InputError, Refused
from hexafix.geometry import Pose
from hexafix.mrml import (
    HeadlessMrmlApp,
    SceneLogic,
    SceneSync,
    bundle,
    markups,
    parameter_node,
    transforms,
)
from hexafix.mrml.nodes import find
from hexafix.mrml.tables import table_rows
from hexafix.presenter import Presenter, Step
from hexafix.surfaces import STALE_COLOUR, ring_colour


@pytest.fixture
def presenter(a_phantom, a_recognised, tmp_path):
    (tmp_path / "ct").mkdir()
    document = {**a_phantom.case, "image": {"path": "ct", "series_instance_uid": None}}
    (tmp_path / "case.json").write_text(json.dumps(document))
    steps = {name: getattr(pipeline, name) for name in dir(pipeline) if not name.startswith("_")}
    steps["read_image"] = lambda *_, **__: a_phantom.volume
    search = steps["find_case_balls"]

    def find_case_balls(volume, *, added_lps_mm=(), removed_lps_mm=(), **more):
        # the search without edits was made once for all tests
        if len(added_lps_mm) == len(removed_lps_mm) == 0:
            return a_recognised.balls
        return search(volume, added_lps_mm=added_lps_mm, removed_lps_mm=removed_lps_mm, **more)

    steps["find_case_balls"] = find_case_balls
    made = Presenter(engine=SimpleNamespace(**steps), threaded=False)
    made.open_case(tmp_path / "case.json")
    yield made
    made.close()


@pytest.fixture
def sync(logic, presenter):
    made = SceneSync(logic, presenter)
    presenter.changed.connect(made.update)
    made.update(presenter.snapshot)
    yield made
    made.close()


def colour(logic, role):
    return np.array(find(logic.scene, role).GetDisplayNode().GetSelectedColor())


def drag(logic, ring, k, shift_lps):
    """Move a point as a view does at the end of a drag."""
    node = find(logic.scene, f"markups/{ring}")
    x, y, z = markups.positions_lps_mm(node)[k] + np.array(shift_lps)
    node.SetNthControlPointPosition(k, -x, -y, z)
    node.InvokeEvent(node.PointEndInteractionEvent)
    return [x, y, z]


def test_each_step_brings_its_nodes(sync, logic, presenter):
    seen = []
    for step, role in [
        (Step.LOAD, "volume"),
        (Step.MARKERS, "markups/unnumbered"),
        (Step.POSES, "model/strut/6"),
        (Step.SCHEDULE, "table/struts"),
    ]:
        assert find(logic.scene, role) is None, role
        assert presenter.run(step)
        assert find(logic.scene, role) is not None, role
        seen.append(step)
    plan = presenter.value(Step.SCHEDULE)
    assert len(table_rows(find(logic.scene, "table/struts"))) == len(plan.schedule.rows) + 1
    assert find(logic.scene, "model/target/ring") is not None
    bone = find(logic.scene, "model/bone/proximal")
    assert bone.GetParentTransformNode().GetAttribute("HexaFix.role") == transforms.FRAGMENT


def test_the_case_follows_every_edit_without_the_images_path(sync, logic, presenter, tmp_path):
    presenter.set_reading(3, 171.5)
    document = logic.case_document_from_scene()
    assert document["strut_readings_mm"][2] == 171.5
    text = find(logic.scene, "parameters").GetParameter("caseJson")
    assert str(tmp_path) not in text
    presenter.undo()
    assert (
        logic.case_document_from_scene()["strut_readings_mm"]
        == presenter.snapshot.document["strut_readings_mm"]
    )
    presenter.go_to(Step.READINGS)
    shell = parameter_node.read(find(logic.scene, "parameters"), parameter_node.ShellParameters)
    assert shell.step == "readings"


def test_the_scene_knows_the_cases_file_and_how_far_the_work_has_come(
    sync, logic, presenter, tmp_path
):
    def shell():
        node = find(logic.scene, "parameters")
        return parameter_node.read(node, parameter_node.ShellParameters)

    own = hashlib.sha256((tmp_path / "case.json").read_bytes()).hexdigest()
    assert (shell().caseFileSha256, shell().computedTo) == (own, "")
    presenter.run(Step.MARKERS)
    assert shell().computedTo == "numbering", "numbering follows by itself"
    assert shell().inputVolume is logic.volume_node()
    presenter.accept_relaxed_layout(True)
    presenter.split_fraction = 0.25
    assert (shell().acceptRelaxedLayout, shell().splitFraction) == (True, 0.25)
    presenter.set_case_id("other")
    assert shell().caseFileSha256 == hashlib.sha256(presenter.version.raw).hexdigest() != own


def test_a_fixator_of_a_file_and_readings_typed_once_are_told_in_the_scene(
    sync, logic, presenter, tmp_path
):
    from hexafix.paths import resources

    definition = resources() / "Hardware" / "Frames" / "generic-6sps-160.json"
    (tmp_path / "Doe.json").write_bytes(definition.read_bytes())
    presenter.set_fixator(str(tmp_path / "Doe.json"))
    presenter.set_reading(3, 171.5)
    document = logic.case_document_from_scene()
    assert document["fixator"] == json.loads(definition.read_text())
    assert document["readings_to_repeat"] is True


def test_nothing_is_rebuilt_without_need(sync, logic, presenter):
    presenter.run(Step.SCHEDULE)
    nodes = [find(logic.scene, r) for r in ("volume", "markups/proximal", "model/strut/1",
                                            "model/bone/distal", "table/struts")]  # fmt: skip
    before = [node.GetMTime() for node in nodes]
    presenter.go_to(Step.EXPORT)
    sync.update(presenter.snapshot)
    assert [node.GetMTime() for node in nodes] == before


def test_what_is_stale_is_grey_until_it_is_computed_or_undone(sync, logic, presenter):
    presenter.run(Step.SCHEDULE)
    presenter.set_ball_diameter(10.5)
    for role in ("markups/proximal", "model/balls/proximal", "model/ring/proximal/plate"):
        np.testing.assert_allclose(colour(logic, role), STALE_COLOUR, atol=1e-5, err_msg=role)
    presenter.undo()
    for role in ("markups/proximal", "model/balls/proximal", "model/ring/proximal/plate"):
        np.testing.assert_allclose(colour(logic, role), ring_colour("proximal"), atol=1e-5)


def test_a_swapped_number_is_seen_at_once_and_back_after_undo(sync, logic, presenter):
    presenter.run(Step.POSES)
    node = find(logic.scene, "markups/proximal")
    places = dict(
        zip(
            [node.GetNthControlPointLabel(k) for k in range(4)],
            markups.positions_lps_mm(node).tolist(),
            strict=True,
        )
    )
    presenter.swap_numbers(1, 2)
    labels = [node.GetNthControlPointLabel(k) for k in range(4)]
    swapped = dict(zip(labels, markups.positions_lps_mm(node).tolist(), strict=True))
    np.testing.assert_allclose(swapped["1"], places["2"], atol=1e-9)
    np.testing.assert_allclose(colour(logic, "model/ring/distal/plate"), STALE_COLOUR, atol=1e-5)
    presenter.undo()
    labels = [node.GetNthControlPointLabel(k) for k in range(4)]
    again = dict(zip(labels, markups.positions_lps_mm(node).tolist(), strict=True))
    np.testing.assert_allclose(again["1"], places["1"], atol=1e-9)


def test_a_dragged_ball_becomes_an_edit_and_the_point_goes_back_until_it_is_found(
    sync, logic, presenter
):
    presenter.run(Step.NUMBERING)
    before = markups.positions_lps_mm(find(logic.scene, "markups/proximal"))
    wanted = drag(logic, "proximal", 0, [0.8, -0.5, 0.3])
    edits = presenter.snapshot.document["marker_edits"]
    np.testing.assert_allclose(edits["added_lps_mm"], [wanted], atol=1e-9)
    np.testing.assert_allclose(edits["removed_lps_mm"], before[:1], atol=1e-6)
    np.testing.assert_allclose(
        markups.positions_lps_mm(find(logic.scene, "markups/proximal"))[0], before[0], atol=1e-9
    )
    presenter.undo()
    assert not presenter.snapshot.document.get("marker_edits")


def test_a_point_that_is_only_touched_edits_nothing(sync, logic, presenter):
    presenter.run(Step.NUMBERING)
    undo = presenter.snapshot.undo_label
    drag(logic, "proximal", 0, [0.0, 0.0, 0.0])
    drag(logic, "proximal", 1, [1e-9, 0.0, 0.0])
    assert presenter.snapshot.undo_label == undo
    assert not presenter.snapshot.document.get("marker_edits")


def test_a_deleted_point_removes_its_ball(sync, logic, presenter):
    presenter.run(Step.NUMBERING)
    node = find(logic.scene, "markups/distal")
    place = markups.positions_lps_mm(node)[2]
    node.RemoveNthControlPoint(2)
    np.testing.assert_allclose(
        presenter.snapshot.document["marker_edits"]["removed_lps_mm"], [place], atol=1e-6
    )
    if presenter.is_fresh(Step.MARKERS):
        lists = [find(logic.scene, f"markups/{name}") for name in markups.LISTS]
        count = sum(n.GetNumberOfControlPoints() for n in lists[:3])
        assert count == len(presenter.value(Step.MARKERS).balls) == 7
    else:
        assert node.GetNumberOfControlPoints() == 4, "it stays, grey, until the search is run"


def test_a_dragged_fragment_becomes_the_correction(sync, logic, presenter):
    presenter.run(Step.CORRECTION)
    node = find(logic.scene, transforms.TARGET)
    assert not sync.commit_fragment(), "nothing was dragged"
    nudge = Pose.from_xyz_fixed(position_mm=[1.5, -2.0, 0.5], angles_rad=[0.01, 0.02, -0.03])
    wanted = nudge.matrix @ transforms.motion_lps(node)
    node.SetMatrixTransformToParent(transforms.vtk_of_motion(wanted))
    sync.update(presenter.snapshot)
    np.testing.assert_allclose(
        logic.fragment_motion_lps(), wanted, atol=1e-12, err_msg="an update does not end the drag"
    )
    assert sync.commit_fragment()
    correction = presenter.snapshot.document["correction"]
    assert (correction["kind"], correction["moving"]) == ("fragment-motion", "proximal")
    np.testing.assert_allclose(correction["matrix_lps"], wanted, atol=1e-9)
    np.testing.assert_allclose(logic.fragment_motion_lps(), wanted, atol=1e-9)
    presenter.undo()
    assert np.abs(np.array(logic.fragment_motion_lps()) - wanted).max() > 1e-3


@pytest.mark.parametrize("chosen", ["proximal", "distal"])
def test_without_a_correction_the_fragment_chosen_on_screen_is_dragged(
    sync, logic, presenter, chosen
):
    presenter.set_correction(None)
    presenter.run(Step.POSES)
    sync.drag_fragment(True, moving=chosen)
    ghost, bone = (
        find(logic.scene, f"model/{r}/{s}") for r, s in (("target", "bone"), ("bone", chosen))
    )
    assert ghost.GetPolyData().GetNumberOfPoints() == bone.GetPolyData().GetNumberOfPoints()
    assert not sync.commit_fragment(), "a click that moves nothing is no correction"
    assert presenter.snapshot.document["correction"] is None
    node = find(logic.scene, transforms.TARGET)
    wanted = Pose.from_xyz_fixed(position_mm=[2.0, 0.0, 1.0], angles_rad=[0, 0.1, 0]).matrix
    node.SetMatrixTransformToParent(transforms.vtk_of_motion(wanted))
    assert sync.commit_fragment()
    assert presenter.snapshot.document["correction"]["moving"] == chosen
    sync.drag_fragment(False)
    assert not sync.commit_fragment()


def test_playback_shows_the_plans_rows(sync, logic, presenter):
    presenter.run(Step.SCHEDULE)
    rows = presenter.playback().rows
    sync.show_playback_row(len(rows) - 1)
    node = find(logic.scene, transforms.RING["proximal"])
    np.testing.assert_allclose(transforms.motion_lps(node), rows[-1].proximal_lps, atol=1e-12)
    sync.show_playback_row(None)
    pose = presenter.value(Step.POSES).proximal.pose.matrix
    np.testing.assert_allclose(transforms.motion_lps(node), pose, atol=1e-9)


def place_of(scene, role):
    matrix = find(scene, role).GetMatrixTransformToParent()
    return [matrix.GetElement(i, j) for i in range(4) for j in range(4)]


def test_a_saved_scene_shows_the_frame_as_the_ct_does_whatever_is_played(
    sync, presenter, logic, tmp_path
):
    presenter.run(Step.SCHEDULE)
    ring = transforms.RING["proximal"]
    in_the_ct = place_of(logic.scene, ring)
    sync.show_playback_row(5)
    played = place_of(logic.scene, ring)
    sync.save_bundle(tmp_path / "scene.mrb")
    assert place_of(logic.scene, ring) == played != in_the_ct
    with HeadlessMrmlApp() as app:
        opened = SceneLogic(app.scene)
        opened.open_bundle(tmp_path / "scene.mrb")
        np.testing.assert_allclose(place_of(app.scene, ring), in_the_ct, atol=1e-9)
        assert opened.case_document_from_scene() == logic.case_document_from_scene()


def test_a_scene_with_older_results_is_not_saved_until_the_edit_is_undone(
    sync, presenter, tmp_path
):
    presenter.run(Step.SCHEDULE)
    older = (tmp_path / "scene.mrb").write_bytes(b"older")
    presenter.set_reading(2, 171.5)
    with pytest.raises(Refused) as refused:
        sync.save_bundle(tmp_path / "scene.mrb")
    fault = refused.value.faults[0]
    assert (fault.code, fault.hazard) == ("scene-out-of-date", "H40")
    assert "Schedule" in fault.what
    assert (tmp_path / "scene.mrb").stat().st_size == older
    presenter.undo()
    sync.save_bundle(tmp_path / "scene.mrb")
    assert (tmp_path / "scene.mrb").stat().st_size > older


def test_a_scene_that_mrml_cannot_write_is_told_as_not_written(sync, tmp_path, monkeypatch):
    monkeypatch.setattr(bundle, "EXTENSIONS", {"vtkMRMLModelNode": ".of-no-known-kind"})
    sync.presenter.run(Step.MARKERS)
    with pytest.raises(InputError) as refused:
        sync.save_bundle(tmp_path / "scene.mrb")
    assert refused.value.faults[0].code == "bundle-not-written"
    assert not (tmp_path / "scene.mrb").exists()


def test_a_new_case_empties_the_scene(sync, logic, presenter):
    presenter.run(Step.SCHEDULE)
    presenter.new_case()
    for role in ("volume", "markups/proximal", "model/strut/1", "model/bone/distal",
                 "model/target/ring", "table/struts"):  # fmt: skip
        assert find(logic.scene, role) is None, role


def test_after_closing_the_scene_is_no_longer_listened_to(sync, logic, presenter):
    presenter.run(Step.NUMBERING)
    sync.close()
    drag(logic, "proximal", 0, [3.0, 0.0, 0.0])
    assert not presenter.snapshot.document.get("marker_edits")
