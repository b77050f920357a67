"""The workstation's four views, drawn without a browser: what is seen, clicked and dragged."""

import asyncio
import json

import numpy as np
import pytest

SIZE = (400, 320)

SETTLED_S = 60.0


@pytest.fixture(scope="module")
def a_loop():
    loop = asyncio.new_event_loop()
    asyncio.set_event_loop(loop)
    yield loop
    loop.run_until_complete(asyncio.sleep(0))
    pending = asyncio.all_tasks(loop)
    for task in pending:
        task.cancel()
    loop.run_until_complete(asyncio.gather(*pending, return_exceptions=True))
    asyncio.set_event_loop(None)
    loop.close()


@pytest.fixture(scope="module")
def a_workstation(a_loop, a_case_on_disk):
    """The phantom's case, worked through to the ring poses and the target."""
    from hexafix.presenter import Step
    from hexafix.web.app import start_workstation
    from hexafix.web.run import prepare_environment
    from trame_slicer.views.render_scheduler import NoScheduleRendering

    prepare_environment()

    async def make():
        workstation = start_workstation(a_case_on_disk)
        presenter = workstation.presenter
        await settled(presenter)
        presenter.run(Step.POSES)
        await settled(presenter)
        return workstation

    workstation = a_loop.run_until_complete(make())
    for view in workstation.app.view_manager.get_views():
        view.set_scheduled_render(NoScheduleRendering())
        view.update_size(*SIZE)
        view.fit_view_to_content()
    yield workstation
    workstation.close()


async def settled(presenter):
    await asyncio.sleep(0)
    for _ in range(int(SETTLED_S / 0.01)):
        if not presenter.snapshot.busy:
            break
        await asyncio.sleep(0.01)
    await asyncio.sleep(0)
    assert not presenter.snapshot.busy


@pytest.fixture(scope="module")
def run(a_loop):
    """Runs a callable as the event loop would."""

    def run(call):
        async def inside():
            result = call()
            await asyncio.sleep(0)
            await asyncio.sleep(0)
            return result

        return a_loop.run_until_complete(inside())

    return run


@pytest.fixture(scope="module")
def look(a_workstation):
    """A view's picture as rows from the top, shape (rows, columns, 3)."""
    from hexafix.web.measure import Picture

    def look(tag):
        view = a_workstation.app.view_manager.get_view(tag)
        window = Picture(view, a_workstation.state)._window
        pixels, _, _ = window.img_cols_rows
        return np.asarray(pixels)[..., :3].astype(float)

    return look


@pytest.fixture
def a_view(a_workstation):
    return a_workstation.app.view_manager.get_view


@pytest.fixture(scope="module")
def balls(a_workstation):
    """Centres of the balls found, LPS mm, shape (n, 3)."""
    from hexafix.presenter import Step

    return np.array([b.center_mm for b in a_workstation.presenter.value(Step.MARKERS).balls])


def pixel_of(view, lps):
    """Where a slice view shows a patient point, by the inverse of the node's own matrix."""
    import vtk

    inverse = vtk.vtkMatrix4x4()
    vtk.vtkMatrix4x4.Invert(view.get_view_node().GetXYToRAS(), inverse)
    x, y, depth, _ = inverse.MultiplyPoint((-lps[0], -lps[1], lps[2], 1.0))
    return round(x), round(y), depth


def pixel_in_space(view, lps):
    renderer = view.first_renderer()
    renderer.SetWorldPoint(-lps[0], -lps[1], lps[2], 1.0)
    renderer.WorldToDisplay()
    x, y, _ = renderer.GetDisplayPoint()
    return round(x), round(y)


def press(view, x, y, *, then=None):
    """Left button down, moved on the way, and up again."""
    interactor = view.interactor()
    end = then or (x, y)
    interactor.SetEventInformation(x, y, 0, 0)
    interactor.InvokeEvent("MouseMoveEvent")
    interactor.InvokeEvent("LeftButtonPressEvent")
    for share in (0.3, 0.6, 1.0) if then else ():
        at = round(x + share * (end[0] - x)), round(y + share * (end[1] - y))
        interactor.SetEventInformation(*at, 0, 0)
        interactor.InvokeEvent("MouseMoveEvent")
    interactor.SetEventInformation(*end, 0, 0)
    interactor.InvokeEvent("LeftButtonReleaseEvent")


def test_every_slice_view_shows_the_ball_that_is_selected(a_workstation, a_view, balls, look, run):
    run(lambda: a_workstation.views.select_ball(2))
    for tag in ("Red", "Green", "Yellow"):
        view = a_view(tag)
        x, y, depth = pixel_of(view, balls[2])
        assert abs(depth) < 1.5
        picture = look(tag)
        around = picture[SIZE[1] - 1 - y - 3 : SIZE[1] - 1 - y + 4, x - 3 : x + 4]
        assert around.max() > 200
        # Air beside the limb is black: the picture is a CT's and not white all over.
        assert np.median(picture) < 30
    run(lambda: a_workstation.views.select_ball(None))


def test_the_3d_view_shows_frame_bone_and_balls_and_hides_what_it_is_told(a_workstation, look, run):
    views = a_workstation.views
    run(lambda: views.show_only([]))
    empty = look("ThreeD")
    changed = {}
    for group in ("bone", "frame", "balls"):
        run(lambda group=group: views.show_only([group]))
        changed[group] = int((np.abs(look("ThreeD") - empty).max(axis=2) > 20).sum())
    run(lambda: views.show_only(["bone", "frame", "balls"]))
    assert min(changed.values()) > 300


def test_the_3d_view_takes_all_in_when_the_balls_and_when_the_rings_come(monkeypatch):
    from types import SimpleNamespace

    from hexafix.presenter import Step
    from hexafix.web.views import Views

    values, taken_in = {}, []
    views = Views.__new__(Views)
    views._presenter, views._volume, views._framed = SimpleNamespace(value=values.get), None, 0
    monkeypatch.setattr(views, "reset_space", lambda: taken_in.append(set(values)))
    views.update(None)
    for step in (Step.MARKERS, Step.NUMBERING, Step.POSES, Step.SCHEDULE):
        values[step] = object()
        views.update(None)
    found = {Step.MARKERS}
    assert taken_in == [found, {*found, Step.NUMBERING, Step.POSES}]


def test_the_patient_is_seen_from_the_front_with_the_head_up(a_workstation, a_view):
    for view in a_workstation.app.view_manager.get_threed_views():
        view.reset_view()
    view = a_view("ThreeD")
    right, middle = pixel_in_space(view, (-50, 0, 0)), pixel_in_space(view, (0, 0, 0))
    head = pixel_in_space(view, (0, 0, 50))
    assert right[0] < middle[0]
    assert head[1] > middle[1]


@pytest.mark.parametrize("tag", ["Red", "Green", "Yellow"])
def test_a_click_on_a_ball_in_a_slice_picks_that_ball(a_workstation, a_view, balls, run, tag):
    picked = []
    views = a_workstation.views
    before, views.ball_clicked = views.ball_clicked, picked.append
    for index in (0, 5):
        run(lambda index=index: views.select_ball(index))
        x, y, _ = pixel_of(a_view(tag), balls[index])
        run(lambda x=x, y=y: press(a_view(tag), x, y))
    views.ball_clicked = before
    assert picked == [0, 5]


def test_a_click_beside_every_ball_and_a_drag_from_one_pick_nothing(
    a_workstation, a_view, balls, run
):
    picked = []
    views = a_workstation.views
    before, views.ball_clicked = views.ball_clicked, picked.append
    run(lambda: views.select_ball(0))
    view = a_view("Red")
    x, y, _ = pixel_of(view, balls[0])
    run(lambda: press(view, 3, 3))
    run(lambda: a_view("Green").interactor())
    # From a place without a ball onto one: a drag, not a click.
    run(lambda: press(view, 5, SIZE[1] - 5, then=(x, y)))
    views.ball_clicked = before
    assert picked == []


def test_a_click_on_a_ball_in_3d_picks_the_one_in_front(a_workstation, a_view, balls, run):
    picked = []
    views = a_workstation.views
    before, views.ball_clicked = views.ball_clicked, picked.append
    run(views.reset_space)
    view = a_view("ThreeD")
    pixels = np.array([pixel_in_space(view, ball) for ball in balls], float)
    apart = np.linalg.norm(pixels[:, None] - pixels[None], axis=2) + 1e9 * np.eye(len(balls))
    free = [k for k in range(len(balls)) if apart[k].min() > 25.0]
    assert free
    for index in free:
        x, y = pixel_in_space(view, balls[index])
        run(lambda x=x, y=y: press(view, x, y))
    views.ball_clicked = before
    assert picked == free


def test_both_of_two_clicks_add_a_marker_where_they_were(
    a_workstation, a_view, balls, run, monkeypatch
):
    added = []
    monkeypatch.setattr(a_workstation.presenter, "add_marker", lambda lps: added.append(lps))
    views = a_workstation.views
    run(lambda: views.select_ball(1))
    run(lambda: views.place_marker(True))
    assert a_workstation.state.views_hint
    view = a_view("Red")
    x, y, _ = pixel_of(view, balls[1])
    run(lambda: press(view, x, y))
    run(lambda: press(view, x + 30, y))
    run(lambda: press(a_view("ThreeD"), 200, 160))
    run(lambda: views.place_marker(False))
    run(lambda: press(view, x, y))
    assert len(added) == 2
    spacing = view.get_view_node().GetFieldOfView()[0] / SIZE[0]
    assert np.linalg.norm(np.array(added[0]) - balls[1]) < spacing + 1.0
    # Right on an axial screen is the patient's left, +x.
    step = np.array(added[1]) - np.array(added[0])
    assert step[0] == pytest.approx(30 * spacing, rel=0.05)
    assert not a_workstation.state.views_hint


def test_a_ball_dragged_in_a_slice_is_moved_in_the_case(
    a_workstation, a_view, balls, run, monkeypatch
):
    moved = []
    monkeypatch.setattr(
        a_workstation.presenter, "move_marker", lambda index, lps: moved.append((index, lps))
    )
    run(lambda: a_workstation.views.select_ball(4))
    view = a_view("Red")
    x, y, _ = pixel_of(view, balls[4])
    run(lambda: press(view, x, y, then=(x + 12, y)))
    spacing = view.get_view_node().GetFieldOfView()[0] / SIZE[0]
    ((index, place),) = moved
    assert index == 4
    # To the right on an axial screen: to the patient's left.
    assert np.array(place) - balls[4] == pytest.approx([12 * spacing, 0, 0], abs=1.5 * spacing)


def test_a_point_that_is_asked_for_is_given_once(a_workstation, a_view, run):
    given = []
    views = a_workstation.views
    run(lambda: views.pick_point(given.append))
    view = a_view("Yellow")
    run(lambda: press(view, 111, 99))
    run(lambda: press(view, 50, 60))
    assert len(given) == 1
    assert pixel_of(view, given[0])[:2] == (111, 99)


def test_presets_and_typed_numbers_change_the_grey_values(a_workstation, look, run):
    window = a_workstation.views.window
    run(lambda: window.use("soft tissue"))
    soft = look("Red").mean()
    run(lambda: window.use("metal"))
    metal = look("Red").mean()
    assert soft > 1.5 * metal
    assert a_workstation.state.views_preset == "metal"
    run(lambda: window.ask("1500", "300"))
    shown = a_workstation.logic.volume_node().GetDisplayNode()
    assert (shown.GetWindow(), shown.GetLevel()) == (1500.0, 300.0)
    assert a_workstation.state.views_preset == "own"
    for wrong in (("", "1"), ("0", "1"), ("-5", "1"), ("nan", "1"), ("1e9", "1"), (None, None)):
        run(lambda wrong=wrong: window.ask(*wrong))
    assert (shown.GetWindow(), shown.GetLevel()) == (1500.0, 300.0)
    run(lambda: window.use("suggested"))


def test_a_drag_changes_the_grey_values_only_while_that_is_on(a_workstation, a_view, run):
    shown = a_workstation.logic.volume_node().GetDisplayNode()
    view = a_view("Red")
    before = shown.GetWindow(), shown.GetLevel()
    run(lambda: press(view, 30, 30, then=(90, 60)))
    assert (shown.GetWindow(), shown.GetLevel()) == before
    run(lambda: a_workstation.views.drag_window(True))
    run(lambda: press(view, 30, 30, then=(90, 60)))
    run(lambda: a_workstation.views.drag_window(False))
    assert (shown.GetWindow(), shown.GetLevel()) != before
    assert a_workstation.state.views_preset == "own"
    assert a_workstation.state.views_window == round(shown.GetWindow())
    run(lambda: a_workstation.views.window.use("suggested"))


def test_position_and_letters_follow_the_slice(a_workstation, a_view, run):
    state, view = a_workstation.state, a_view("Red")
    assert (state.Red_left, state.Red_right) == ("R", "L")
    assert (state.Red_top, state.Red_bottom) == ("A", "P")
    assert (state.Green_left, state.Green_top) == ("R", "H")
    assert (state.Yellow_left, state.Yellow_top) == ("A", "H")
    before = state.Red_position
    run(lambda: view.set_slice_value(view.get_slice_value() + 5 * view.get_slice_step()))
    assert state.Red_position != before
    assert state.Red_position.startswith("S ")


def test_what_the_handles_leave_becomes_the_correction_when_they_are_let_go(
    a_workstation, a_view, run
):
    import vtk
    from hexafix.mrml.nodes import find
    from hexafix.mrml.transforms import TARGET

    presenter, views = a_workstation.presenter, a_workstation.views
    before = json.dumps(presenter.snapshot.document["correction"], default=list)
    run(lambda: views.drag_fragment(True))
    moved = vtk.vtkMatrix4x4()
    moved.SetElement(0, 3, -4.0)  # 4 mm to the patient's left: +x in LPS
    run(lambda: find(a_workstation.logic.scene, TARGET).SetMatrixTransformToParent(moved))
    assert json.dumps(presenter.snapshot.document["correction"], default=list) == before
    run(lambda: press(a_view("ThreeD"), 5, 5))
    run(lambda: views.drag_fragment(False))
    correction = presenter.snapshot.document["correction"]
    assert correction["kind"] == "fragment-motion"
    assert np.array(correction["matrix_lps"])[:3, 3] == pytest.approx([4.0, 0.0, 0.0])
    run(presenter.undo)
    assert json.dumps(presenter.snapshot.document["correction"], default=list) == before


def test_the_handle_in_a_slice_drags_the_fragment_within_the_slice(
    a_workstation, a_view, look, run
):
    from hexafix.mrml.nodes import find
    from hexafix.mrml.screen import jump_to, point_under
    from hexafix.mrml.transforms import TARGET

    presenter, views = a_workstation.presenter, a_workstation.views
    run(lambda: views.drag_fragment(True))
    node = find(a_workstation.logic.scene, TARGET)
    center = node.GetCenterOfTransformation()
    view = a_view("Red")
    before = np.array(a_workstation.logic.fragment_motion_lps())
    # The handles stand where their centre was moved to.
    place = (before @ [-center[0], -center[1], center[2], 1.0])[:3]
    run(lambda: jump_to(view.get_view_node(), place))
    look("Red")
    x, y, _ = pixel_of(view, place)
    place_under = point_under(view.get_view_node(), x, y)
    run(lambda: press(view, x, y, then=(x + 10, y - 6)))
    run(lambda: views.drag_fragment(False))
    correction = presenter.snapshot.document["correction"]
    matrix = np.array(correction["matrix_lps"]) @ np.linalg.inv(before)
    # What the image's own slices, a little oblique, have 10 pixels to the right and 6 down.
    wanted = np.array(point_under(view.get_view_node(), x + 10, y - 6)) - place_under
    assert matrix[:3, 3] == pytest.approx(wanted, abs=0.02)
    assert wanted[0] > 5.0
    assert wanted[1] > 3.0
    assert matrix[:3, :3] == pytest.approx(np.eye(3))
    run(presenter.undo)


def test_no_picture_is_drawn_while_the_views_are_made(a_loop, monkeypatch):
    from hexafix.web.app import Workstation
    from trame_slicer.views import AbstractView

    drawn = []
    monkeypatch.setattr(AbstractView, "render", lambda self: drawn.append(self))

    async def make():
        Workstation().close()

    a_loop.run_until_complete(make())
    assert drawn == []
