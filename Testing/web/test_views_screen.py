"""Which side of the patient stands at which edge, and which point is under a pixel."""

import re

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

SIZE, FIELD_MM = (200, 100), (100.0, 50.0)


def slice_node(right_ras, up_ras, origin_ras):
    """A slice view's node: what points right and up on its screen, and its middle, in RAS."""
    import slicer
    import vtk

    node = slicer.vtkMRMLSliceNode()
    node.SetDimensions(*SIZE, 1)
    node.SetFieldOfView(*FIELD_MM, 1.0)
    matrix = vtk.vtkMatrix4x4()
    columns = (right_ras, up_ras, np.cross(right_ras, up_ras), origin_ras)
    for column, values in enumerate(columns):
        for row, value in enumerate(values):
            matrix.SetElement(row, column, float(value))
    node.GetSliceToRAS().DeepCopy(matrix)
    node.UpdateMatrices()
    return node


# Radiological convention: what is right on the screen, what is up, and the edges' letters.
STANDARD = {
    "axial": ((-1, 0, 0), (0, 1, 0), {"left": "R", "right": "L", "top": "A", "bottom": "P"}),
    "coronal": ((-1, 0, 0), (0, 0, 1), {"left": "R", "right": "L", "top": "H", "bottom": "F"}),
    "sagittal": ((0, -1, 0), (0, 0, 1), {"left": "A", "right": "P", "top": "H", "bottom": "F"}),
    "axial from above": (
        (1, 0, 0),
        (0, 1, 0),
        {"left": "L", "right": "R", "top": "A", "bottom": "P"},
    ),
    "upside down": ((1, 0, 0), (0, 0, -1), {"left": "L", "right": "R", "top": "F", "bottom": "H"}),
}


@pytest.mark.parametrize("name", STANDARD)
def test_the_edges_name_the_patients_sides(name):
    from hexafix.mrml.screen import edge_letters

    right, up, letters = STANDARD[name]
    assert edge_letters(slice_node(right, up, (10.0, 20.0, 30.0))) == letters


def test_an_oblique_slice_names_the_second_axis_too():
    from hexafix.mrml.screen import edge_letters

    for degrees, expected in ((10.0, "R"), (25.0, "RA"), (65.0, "AR"), (80.0, "A")):
        turn = np.radians(degrees)
        left = np.array([np.cos(turn), np.sin(turn), 0.0])
        node = slice_node(-left, (0, 0, 1), (0.0, 0.0, 0.0))
        assert edge_letters(node)["left"] == expected


def test_a_slice_says_the_coordinate_that_a_ball_in_it_has():
    from hexafix.mrml.screen import slice_position

    # RAS (5, 61, 7) is LPS (-5, -61, 7)
    axial = slice_node((-1, 0, 0), (0, 1, 0), (5.0, 6.0, -123.46))
    assert slice_position(axial) == "S -123.5 mm"
    coronal = slice_node((-1, 0, 0), (0, 0, 1), (5.0, 61.0, 7.0))
    assert slice_position(coronal) == "P -61.0 mm"
    sagittal = slice_node((0, -1, 0), (0, 0, 1), (5.0, 61.0, 7.0))
    assert slice_position(sagittal) == "L -5.0 mm"
    assert slice_position(slice_node((0, 1, 0), (0, 0, 1), (-5.0, 61.0, 7.0))) == "L 5.0 mm"
    assert slice_position(slice_node((-1, 0, 0), (0, 1, 0), (5.0, 6.0, 0.04))) == "S 0.0 mm"
    assert slice_position(slice_node((-1, 0, 0), (0, 1, 0), (5.0, 6.0, -0.04))) == "S 0.0 mm"


TOLD = re.compile(r"([LPS]) (-?[0-9]+\.[0-9]) mm in the middle\ntilted ([0-9]+\.[0-9])°")


@settings(max_examples=40, deadline=None)
@given(
    angles=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    origin=st.tuples(*[st.floats(-400.0, 400.0)] * 3),
    pan=st.tuples(st.floats(-40.0, 40.0), st.floats(-40.0, 40.0)),
)
def test_a_tilted_slice_says_the_coordinate_of_its_middle_and_its_tilt(angles, origin, pan):
    from hexafix.mrml.screen import slice_position
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("xyz", angles)
    right, up, normal = (turn.apply(axis) for axis in np.eye(3))
    node = slice_node(right, up, origin)
    node.SetXYZOrigin(*pan, 0.0)
    node.UpdateMatrices()
    # the middle of the view by hand, in LPS, and the angle to the axis by the sine
    middle = (np.array(origin) + pan[0] * right + pan[1] * up) * (-1, -1, 1)
    axis = max(range(3), key=lambda k: abs(normal[k]))
    assume(sorted(abs(normal))[2] - sorted(abs(normal))[1] > 1e-6)
    tilt = np.degrees(np.arctan2(np.linalg.norm(np.delete(normal, axis)), abs(normal[axis])))
    assume(tilt > 0.5)
    letter, value, told = TOLD.fullmatch(slice_position(node)).groups()
    assert letter == "LPS"[axis]
    assert float(value) == pytest.approx(middle[axis], abs=0.051)
    assert float(told) == pytest.approx(tilt, abs=0.051)


def test_a_slice_is_called_tilted_only_where_its_coordinate_shows_it():
    from hexafix.mrml.screen import slice_position
    from scipy.spatial.transform import Rotation

    def at(degrees):
        turn = Rotation.from_euler("x", degrees, degrees=True)
        axes = turn.apply(np.eye(3))
        return slice_position(slice_node(axes[0], axes[1], (0.0, 0.0, 20.0)))

    # 25 mm from the middle to an edge: 0.05 mm at 0.1146 degrees
    assert at(0.11) == "S 20.0 mm"
    assert at(0.12) == "S 20.0 mm in the middle\ntilted 0.1°"


def test_a_pixel_of_an_axial_slice_is_the_patient_point_under_it():
    from hexafix.mrml.screen import point_under

    # The middle shows RAS (10, 20, 30): LPS (-10, -20, 30). Half a millimetre a pixel; to the
    # right is the patient's left (+x in LPS), up is anterior (-y in LPS).
    node = slice_node((-1, 0, 0), (0, 1, 0), (10.0, 20.0, 30.0))
    assert point_under(node, 100, 50) == pytest.approx((-10.0, -20.0, 30.0))
    assert point_under(node, 120, 50) == pytest.approx((0.0, -20.0, 30.0))
    assert point_under(node, 100, 70) == pytest.approx((-10.0, -30.0, 30.0))


@settings(max_examples=30, deadline=None)
@given(
    angles=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    pixel=st.tuples(st.integers(0, 199), st.integers(0, 99)),
    away_mm=st.floats(0.0, 12.0),
)
def test_the_nearest_ball_in_reach_of_a_pixel_is_picked(angles, pixel, away_mm):
    from hexafix.mrml.screen import nearest_in_slice, point_under
    from scipy.spatial.transform import Rotation

    axes = Rotation.from_euler("xyz", angles).as_matrix()
    node = slice_node(axes[:, 0], axes[:, 1], (10.0, -20.0, 30.0))
    point = np.array(point_under(node, *pixel))
    normal_lps = axes[:, 2] * (-1, -1, 1)
    balls = [point + 40.0 * normal_lps, point + away_mm * normal_lps, point - 30.0 * normal_lps]
    picked = nearest_in_slice(node, *pixel, balls, within_mm=8.0)
    assert picked == (1 if away_mm <= 8.0 else None)


def test_of_balls_behind_each_other_a_pixel_of_the_3d_view_picks_the_front_one():
    import vtk
    from hexafix.mrml.screen import nearest_in_space

    renderer, window = vtk.vtkRenderer(), vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(300, 200)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    # From the front (anterior is +y in RAS, -y in LPS), head up.
    camera.SetPosition(0.0, 500.0, 0.0)
    camera.SetFocalPoint(0.0, 0.0, 0.0)
    camera.SetViewUp(0.0, 0.0, 1.0)
    camera.SetClippingRange(1.0, 2000.0)
    behind, front, aside = [0.0, 100.0, 0.0], [0.0, -100.0, 0.0], [60.0, 0.0, 0.0]
    assert nearest_in_space(renderer, 150, 100, [behind, front, aside], within_mm=5.0) == 1
    assert nearest_in_space(renderer, 150, 100, [behind, aside], within_mm=5.0) == 0
    assert nearest_in_space(renderer, 150, 199, [behind, front, aside], within_mm=5.0) is None
    # The patient's left (+x in LPS) stands on the right of the screen.
    renderer.SetWorldPoint(-60.0, 0.0, 0.0, 1.0)
    renderer.WorldToDisplay()
    x, y, _ = renderer.GetDisplayPoint()
    assert x > 150
    assert nearest_in_space(renderer, x, y, [behind, front, aside], within_mm=5.0) == 2
    window.Finalize()


def test_no_ball_is_picked_where_there_is_none():
    from hexafix.mrml.screen import nearest_in_slice

    node = slice_node((-1, 0, 0), (0, 1, 0), (0.0, 0.0, 0.0))
    assert nearest_in_slice(node, 10, 10, [], within_mm=8.0) is None
