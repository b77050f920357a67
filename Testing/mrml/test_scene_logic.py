import csv
import io
import json

import numpy as np
import pytest
from hexafix.errors import InputError, Refused
from hexafix.mrml import HeadlessMrmlApp, SceneLogic, markups, transforms
from hexafix.mrml.geometry import lps_points
from hexafix.mrml.hierarchy import tree_of
from hexafix.mrml.logic import GROUPS
from hexafix.mrml.nodes import ROLE, find, nodes_of
from hexafix.mrml.tables import table_rows
from hexafix.pipeline import bone_fragments, playback
from hexafix.surfaces import STALE_COLOUR, ring_colour, strut_colour


def _center_lps(node):
    bounds = [0.0] * 6
    node.GetRASBounds(bounds)
    return lps_points((np.array(bounds[::2]) + np.array(bounds[1::2])) / 2)


# ---------------------------------------------------------------- balls


def test_each_ball_stands_in_its_rings_list_under_its_number(planned):
    balls = {ball["number"]: ball for ball in planned.document["balls"]}
    seen = {}
    for ring in ("proximal", "distal"):
        node = find(planned.app.scene, f"markups/{ring}")
        for k, place in enumerate(markups.positions_lps_mm(node)):
            number = int(node.GetNthControlPointLabel(k))
            assert balls[number]["ring"] == ring
            assert node.GetNthControlPointDescription(k).startswith(f"{ring} ring")
            np.testing.assert_allclose(place, balls[number]["center_mm"], atol=1e-6)
            seen[number] = ring
    assert set(seen) == set(balls)


def test_the_rings_lists_have_the_colours_of_the_prescription(planned):
    for ring in ("proximal", "distal"):
        display = find(planned.app.scene, f"markups/{ring}").GetDisplayNode()
        np.testing.assert_allclose(display.GetSelectedColor(), ring_colour(ring), atol=1e-6)
    for number in range(1, 7):
        display = find(planned.app.scene, f"model/strut/{number}").GetDisplayNode()
        np.testing.assert_allclose(display.GetColor(), strut_colour(number), atol=1e-6)


def test_rejected_candidates_are_kept_hidden_with_their_reason(logic, a_recognised, layouts):
    nodes = logic.show_balls(a_recognised.balls, None, layouts)
    node, rejected = nodes["rejected"], a_recognised.balls.rejected
    assert node.GetNumberOfControlPoints() == len(rejected) > 5
    assert not node.GetDisplayNode().GetVisibility()
    words = [node.GetNthControlPointDescription(k) for k in range(len(rejected))]
    assert words == [other.reason for other in rejected]
    logic.show_rejected(True)
    assert node.GetDisplayNode().GetVisibility()
    logic.show_balls(a_recognised.balls, None, layouts)
    assert node.GetDisplayNode().GetVisibility(), "what the user shows stays shown"


def test_without_numbers_every_ball_is_a_question(logic, a_recognised, layouts):
    nodes = logic.show_balls(a_recognised.balls, None, layouts)
    count = len(a_recognised.balls.balls)
    assert nodes["unnumbered"].GetNumberOfControlPoints() == count
    assert {nodes["unnumbered"].GetNthControlPointLabel(k) for k in range(count)} == {"?"}
    assert nodes["proximal"].GetNumberOfControlPoints() == 0


def test_a_partial_numbering_leaves_the_others_without_one(logic, a_recognised, a_judged, layouts):
    some = {"assigned": {n: k for n, k in a_judged["assigned"].items() if n in ("1", "2")}}
    nodes = logic.show_balls(a_recognised.balls, some, layouts)
    assert [nodes["proximal"].GetNthControlPointLabel(k) for k in (0, 1)] == ["1", "2"]
    assert nodes["distal"].GetNumberOfControlPoints() == 0
    assert nodes["unnumbered"].GetNumberOfControlPoints() == len(a_recognised.balls.balls) - 2


def test_the_residual_of_a_ball_is_told_in_millimetres(logic, a_recognised, a_judged, layouts):
    judged = {**a_judged, "rings": {"proximal": {"residuals_mm": {"1": 0.0312}}}}
    node = logic.show_balls(a_recognised.balls, judged, layouts)["proximal"]
    assert node.GetNthControlPointDescription(0).endswith("0.03 mm from its place in the layout")


def test_a_ball_is_found_by_a_click_near_it(logic, a_recognised, a_judged, layouts):
    logic.show_balls(a_recognised.balls, a_judged, layouts)
    for index, ball in enumerate(a_recognised.balls.balls):
        assert logic.ball_at(ball.center_mm + np.array([2.0, -2.0, 1.0])) == index
    assert logic.ball_at(np.mean(a_recognised.balls.centers_mm, axis=0)) is None


def test_the_chosen_ball_is_marked_and_its_place_told(logic, a_recognised, a_judged, layouts):
    nodes = logic.show_balls(a_recognised.balls, a_judged, layouts)
    index = a_judged["assigned"]["2"]
    np.testing.assert_allclose(
        logic.select_ball(index), a_recognised.balls.balls[index].center_mm, atol=1e-9
    )
    marked = [nodes["proximal"].GetNthControlPointSelected(k) for k in range(4)]
    assert marked == [True, False, True, True]
    assert logic.select_ball(None) is None
    assert all(nodes["proximal"].GetNthControlPointSelected(k) for k in range(4))


# ---------------------------------------------------------------- frame, bone, target


def test_rings_struts_and_joints_stand_where_the_plan_has_them(planned):
    rings = planned.document["rings"]
    poses = {ring: np.array(rings[ring]["matrix_lps"]) for ring in ("proximal", "distal")}
    fixator = planned.case.fixator
    for ring, pose in poses.items():
        node = find(planned.app.scene, transforms.RING[ring])
        np.testing.assert_allclose(transforms.motion_lps(node), pose, atol=1e-9)
        joints = find(planned.app.scene, f"model/ring/{ring}/joints")
        assert joints.GetParentTransformNode() is node
        bounds = np.array(joints.GetPolyData().GetBounds()) * [-1, -1, -1, -1, 1, 1]
        wanted = getattr(fixator, ring).joints_mm
        np.testing.assert_allclose(bounds[[1, 3, 4]], wanted.min(axis=0) - 6, atol=0.3)
        np.testing.assert_allclose(bounds[[0, 2, 5]], wanted.max(axis=0) + 6, atol=0.3)
    for number in range(6):
        ends = [
            poses[ring][:3, :3] @ getattr(fixator, ring).joints_mm[number] + poses[ring][:3, 3]
            for ring in ("proximal", "distal")
        ]
        np.testing.assert_allclose(
            _center_lps(find(planned.app.scene, f"model/strut/{number + 1}")),
            np.mean(ends, axis=0),
            atol=3.0,
        )


def test_the_front_mark_stands_on_the_rings_x_axis(planned):
    for ring, letter in (("proximal", "A"), ("distal", "B")):
        node = find(planned.app.scene, f"markups/frame/{ring}")
        world = [0.0] * 3
        node.GetNthControlPointPositionWorld(0, world)
        pose = np.array(planned.document["rings"][ring]["matrix_lps"])
        local = np.linalg.inv(pose) @ [*lps_points(world), 1]
        assert local[0] > getattr(planned.case.fixator, ring).outer_radius_mm
        np.testing.assert_allclose(local[1], 0.0, atol=1e-9)
        assert node.GetNthControlPointLabel(0) == f"{letter} front"


def test_the_target_moves_ghost_and_ring_as_the_correction_asks(planned):
    motion = planned.case.correction.motion.matrix
    np.testing.assert_allclose(planned.logic.fragment_motion_lps(), motion, atol=1e-9)
    bone = find(planned.app.scene, "model/bone/proximal")
    ghost = find(planned.app.scene, "model/target/bone")
    assert ghost.GetPolyData() is not None
    moved = np.eye(4)
    matrix = transforms.vtk_of_motion(np.eye(4))
    ghost.GetParentTransformNode().GetMatrixTransformToWorld(matrix)
    moved = transforms.motion_of_vtk(matrix)
    np.testing.assert_allclose(moved, motion, atol=1e-9)
    assert bone.GetPolyData().GetNumberOfPoints() == ghost.GetPolyData().GetNumberOfPoints()
    ring = find(planned.app.scene, "model/target/ring")
    ring.GetParentTransformNode().GetMatrixTransformToWorld(matrix)
    np.testing.assert_allclose(
        transforms.motion_of_vtk(matrix),
        motion @ np.array(planned.document["rings"]["proximal"]["matrix_lps"]),
        atol=1e-6,
    )


def test_a_target_that_moves_nothing_hides_its_ghosts(logic, a_phantom_case, a_recognised):
    case = a_phantom_case()
    logic.show_recognised(case, a_recognised)
    logic.show_target(np.eye(4), "proximal")
    ghost = find(logic.scene, "model/target/ring").GetDisplayNode()
    assert not ghost.GetVisibility()
    logic.show_target(np.diag([1.0, 1, 1, 1]) + np.eye(4, k=3), "proximal")
    assert ghost.GetVisibility()


def test_the_handles_never_scale_and_stand_at_the_cut(logic, a_phantom_case, a_recognised):
    case = a_phantom_case()
    logic.show_recognised(case, a_recognised)
    samples = bone_fragments(a_recognised)
    logic.show_fragments(samples, "proximal")
    logic.drag_fragment(True)
    node = find(logic.scene, transforms.TARGET)
    display = node.GetDisplayNode()
    assert display.GetEditorVisibility()
    assert not display.GetEditorScalingEnabled()
    assert not display.GetEditorScalingSliceEnabled()
    rings = a_recognised.proximal.pose.position_mm, a_recognised.distal.pose.position_mm
    at = lps_points(node.GetCenterOfTransformation())
    axis = (rings[0] - rings[1]) / np.linalg.norm(rings[0] - rings[1])
    share = (at - rings[1]) @ axis / np.linalg.norm(rings[0] - rings[1])
    assert 0.35 < share < 0.65, "at the cut, between the rings"
    logic.drag_fragment(False)
    assert not display.GetEditorVisibility()


@pytest.mark.parametrize("moving", ["proximal", "distal"])
def test_playback_puts_rings_struts_balls_and_bone_where_the_row_says(
    logic, a_phantom_case, a_recognised, a_judged, a_plan, layouts, moving
):
    import dataclasses

    case = a_phantom_case()
    logic.show_balls(a_recognised.balls, a_judged, layouts)
    logic.show_recognised(case, a_recognised)
    logic.show_fragments(bone_fragments(a_recognised), moving)
    film = playback(a_plan)
    row = film.rows[len(film.rows) // 2]
    shown = dataclasses.replace(film, moving=moving)
    logic.show_playback_row(shown, row.index)
    for ring in ("proximal", "distal"):
        node = find(logic.scene, transforms.RING[ring])
        np.testing.assert_allclose(
            transforms.motion_lps(node), getattr(row, f"{ring}_lps"), atol=1e-12
        )
        balls = find(logic.scene, f"markups/{ring}")
        world = [0.0] * 3
        balls.GetNthControlPointPositionWorld(0, world)
        still = [*markups.positions_lps_mm(balls)[0], 1]
        wanted = np.array(row.fragment_lps) @ still if ring == moving else still
        np.testing.assert_allclose(lps_points(world), wanted[:3], atol=1e-9)
        bone = find(logic.scene, f"model/bone/{ring}")
        assert (bone.GetParentTransformNode() is not None) == (ring == moving)
    joints = case.fixator.proximal.joints_mm, case.fixator.distal.joints_mm
    for number in range(6):
        top = (np.array(row.proximal_lps) @ [*joints[0][number], 1])[:3]
        low = (np.array(row.distal_lps) @ [*joints[1][number], 1])[:3]
        np.testing.assert_allclose(
            _center_lps(find(logic.scene, f"model/strut/{number + 1}")), (top + low) / 2, atol=3.0
        )
        offset = case.fixator.strut.scale_offset_mm
        length = np.linalg.norm(top - low) - offset
        np.testing.assert_allclose(length, row.strut_mm[number], atol=1e-6)
    logic.show_playback_row(None, None)
    node = find(logic.scene, transforms.RING["proximal"])
    np.testing.assert_allclose(
        transforms.motion_lps(node), a_recognised.proximal.pose.matrix, atol=1e-9
    )
    assert find(logic.scene, f"markups/{moving}").GetParentTransformNode() is None


# ---------------------------------------------------------------- plan, table, tree


def test_volume_node_in_gives_the_export_of_plan_and_export_byte_for_byte(planned, an_export):
    names = sorted(path.name for path in planned.export.iterdir())
    assert names == sorted(path.name for path in an_export.iterdir())
    for name in names:
        assert (planned.export / name).read_bytes() == (an_export / name).read_bytes()


def test_a_refused_plan_writes_nothing_and_changes_no_node(planned, a_phantom_case, tmp_path):
    with HeadlessMrmlApp() as app:
        logic = SceneLogic(app.scene)
        node = logic.add_volume(planned.logic.volume_of(planned.volume_node))
        before = sorted(n.GetID() for n in nodes_of(app.scene))
        readings = list(planned.case.strut_readings_mm)
        readings[2] += 8.0
        with pytest.raises(Refused):
            logic.plan(node, a_phantom_case(strut_readings_mm=readings), tmp_path / "export")
        assert sorted(n.GetID() for n in nodes_of(app.scene)) == before
        assert not (tmp_path / "export").exists()


def test_a_target_that_is_no_export_is_refused_before_the_work(planned, tmp_path):
    (tmp_path / "mine.txt").write_text("x")
    with pytest.raises(InputError) as refused:
        planned.logic.plan(planned.volume_node, planned.case, tmp_path)
    assert refused.value.faults[0].code == "target-not-an-export"


def test_the_table_has_the_characters_of_the_schedule(planned):
    text = (planned.export / "schedule.csv").read_text()
    node = find(planned.app.scene, "table/struts")
    assert table_rows(node) == list(csv.reader(io.StringIO(text)))
    assert node.GetColumnUnitLabel("strut_4_mm") == "mm"
    assert node.GetLocked()


def test_the_tree_is_patient_study_folders_and_names_the_case_alone(planned, roles_of):
    rows = tree_of(planned.app.scene)
    assert rows[0] == (0, planned.case.case_id)
    assert [name for depth, name in rows if depth == 0] == [planned.case.case_id]
    assert [name for depth, name in rows if depth == 1] == ["Planning"]
    folders = {name for depth, name in rows if depth == 2}
    assert folders == {"Image", "Balls and numbers", "Frame", "Bone", "Target", "Plan"}
    assert sum(depth == 3 for depth, _ in rows) == len(roles_of(planned.app.scene))


def test_arranging_again_changes_nothing(planned):
    before = tree_of(planned.app.scene)
    planned.logic.arrange(planned.case.case_id)
    assert tree_of(planned.app.scene) == before


def test_the_case_in_the_scene_is_the_case(planned):
    back = planned.logic.case_from_scene()
    assert dict(back.document) == dict(planned.case.document)
    assert back.case_sha256 == planned.case.case_sha256
    assert back.fixator_sha256 == planned.case.fixator_sha256


# ---------------------------------------------------------------- grey, hidden, gone


def test_what_is_stale_is_grey_and_gets_its_colour_back(logic, a_phantom_case, a_recognised):
    logic.show_recognised(a_phantom_case(), a_recognised)
    plate = find(logic.scene, "model/ring/proximal/plate").GetDisplayNode()
    label = find(logic.scene, "markups/frame/proximal").GetDisplayNode()
    logic.set_stale("frame", True)
    np.testing.assert_allclose(plate.GetColor(), STALE_COLOUR, atol=1e-6)
    np.testing.assert_allclose(label.GetSelectedColor(), STALE_COLOUR, atol=1e-6)
    logic.set_stale("frame", False)
    np.testing.assert_allclose(plate.GetColor(), ring_colour("proximal"), atol=1e-6)
    np.testing.assert_allclose(label.GetSelectedColor(), ring_colour("proximal"), atol=1e-6)


def test_clearing_a_group_removes_its_nodes_with_their_parts_and_no_others(
    logic, a_phantom_case, a_recognised, a_judged, layouts
):
    def count():
        return logic.scene.GetNumberOfNodes()

    empty = count()
    logic.show_balls(a_recognised.balls, a_judged, layouts)
    balls = count()
    logic.show_recognised(a_phantom_case(), a_recognised)
    held = {node.GetAttribute(ROLE) for node in nodes_of(logic.scene)}
    logic.clear("frame")
    left = {node.GetAttribute(ROLE) for node in nodes_of(logic.scene)}
    gone = held - left
    assert gone
    assert all(any(r == p or r.startswith(f"{p}/") for p in GROUPS["frame"]) for r in gone)
    assert any(role.startswith("markups/proximal") for role in left)
    logic.clear()
    assert not list(nodes_of(logic.scene))
    # the subject hierarchy and the transform of the playback were made on the way
    assert count() <= empty + 1
    assert balls > empty


def test_showing_the_same_again_changes_no_point(logic, a_recognised, a_judged, layouts):
    nodes = logic.show_balls(a_recognised.balls, a_judged, layouts)
    ids = [nodes["proximal"].GetNthControlPointID(k) for k in range(4)]
    times = nodes["proximal"].GetMTime()
    logic.show_balls(a_recognised.balls, a_judged, layouts)
    assert [nodes["proximal"].GetNthControlPointID(k) for k in range(4)] == ids
    assert nodes["proximal"].GetMTime() == times


def test_landmarks_are_shown_by_fragment(logic):
    logic.show_landmarks([[1.0, 2, 3], [4, 5, 6]], [[7.0, 8, 9]])
    node = find(logic.scene, "markups/landmarks/moving")
    assert [node.GetNthControlPointLabel(k) for k in (0, 1)] == ["m1", "m2"]
    np.testing.assert_array_equal(markups.positions_lps_mm(node), [[1, 2, 3], [4, 5, 6]])
    logic.show_landmarks([], [])
    assert node.GetNumberOfControlPoints() == 0


def test_the_logic_works_in_a_scene_without_any_application(a_recognised, a_phantom_case, layouts):
    import slicer

    logic = SceneLogic(slicer.vtkMRMLScene())
    logic.add_volume(a_recognised.volume)
    logic.show_balls(a_recognised.balls, None, layouts)
    logic.show_recognised(a_phantom_case(), a_recognised)
    assert find(logic.scene, "model/strut/6").GetPolyData().GetNumberOfPoints() > 50


def test_the_document_in_the_scene_is_json(planned):
    document = planned.logic.case_document_from_scene()
    assert json.dumps(document)
    assert document["image"] == {"path": "volume-node", "series_instance_uid": None}
