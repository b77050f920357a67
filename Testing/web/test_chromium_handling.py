"""What a hand does in a real Chromium: stop, play, drag a bone by its handle, type the forms."""

import io
import json
import re

import numpy as np
import pytest
from playwright.sync_api import expect
from scipy.spatial.transform import Rotation

LONG_MS = 60_000

CHANGED = 40.0
"""Difference of grey values, out of 255, from which a pixel of two pictures is another one."""


def values(desk, *names):
    """What three fields of each name hold."""
    entries = [desk.at(f"draft-{name}-{k}").locator("input") for name in names for k in range(3)]
    return [entry.input_value() for entry in entries]


def become(desk, field, text):
    """Wait until a field holds a text."""
    expect(desk.at(field).locator("input")).to_have_value(text, timeout=LONG_MS)


def picture(desk, view):
    """What a view shows, shape (rows, columns, 3)."""
    from PIL import Image

    shown = desk.page.screenshot(clip=desk.at(f"over-{view}").bounding_box())
    return np.asarray(Image.open(io.BytesIO(shown)).convert("RGB"), float)


def saved(desk, path):
    """The case as the workstation saves it."""
    desk.click("save-as")
    desk.at("chooser-path").locator("input").fill(str(path))
    desk.click("chooser-accept")
    desk.at("chooser-path").wait_for(state="detached")
    desk.at("unsaved").wait_for(state="detached")
    return path.read_bytes()


def choose(desk, field, words):
    """Choose one of a drop-down's words."""
    desk.at(field).locator("input").click(force=True)
    desk.page.locator(".v-overlay--active .v-list-item").get_by_text(words, exact=True).click()
    desk.page.locator(".v-overlay--active .v-list-item").first.wait_for(state="detached")


def test_a_search_that_is_cancelled_leaves_nothing_and_can_be_run_again(a_desk):
    a_desk.open("markers")
    a_desk.click("run-markers")
    a_desk.click("cancel")
    a_desk.at("cancel").wait_for(state="detached", timeout=LONG_MS)
    a_desk.wait("markers", "ready")
    a_desk.wait_for('[data-testid="banner"][data-code="cancelled"]')
    assert a_desk.at("table-balls").count() == 0
    a_desk.click("run-markers")
    a_desk.wait("numbering", "done")
    assert a_desk.at("table-balls").locator("tbody tr").count() >= 8


def centres(desk):
    """Balls and their centres as the table tells them."""
    rows = desk.at("table-balls").locator("tbody tr").all()
    assert len(rows) >= 8
    return [[row.locator("td").nth(k).inner_text() for k in (0, 2, 3, 4)] for row in rows]


def test_after_a_cancelled_search_the_older_balls_stay_and_undo_makes_them_fresh(a_desk):
    a_desk.open("markers")
    balls = centres(a_desk)
    diameter = a_desk.at("ball-diameter").locator("input").input_value()
    a_desk.write("ball-diameter", f"{float(diameter) + 0.25:g}")
    a_desk.wait("markers", "stale")
    a_desk.click("run-markers")
    a_desk.click("cancel")
    a_desk.at("cancel").wait_for(state="detached", timeout=LONG_MS)
    a_desk.wait("markers", "stale")
    table = a_desk.at("table-balls")
    assert table.get_attribute("data-stale") == "true"
    assert centres(a_desk) == balls
    a_desk.click("undo")
    a_desk.wait("markers", "done")
    a_desk.wait("numbering", "done")
    assert centres(a_desk) == balls


def row(desk):
    return int(desk.at("playback").get_attribute("data-row"))


def test_the_playback_plays_pauses_and_stops_at_the_last_day(a_planned_desk):
    desk, page = a_planned_desk, a_planned_desk.page
    play = desk.at("play")
    desk.click("play-first")
    desk.wait_for('[data-testid="playback"][data-row="0"]')
    today, frame = desk.at("play-when").inner_text(), picture(desk, "ThreeD")
    play.click()
    desk.wait_for('[data-testid="play"][aria-label="Pause"]')
    page.wait_for_function(
        "Number(document.querySelector('[data-testid=playback]').dataset.row) >= 4",
        timeout=LONG_MS,
    )
    play.click()
    desk.wait_for('[data-testid="play"][aria-label="Play"]')
    stood, when = row(desk), desk.at("play-when").inner_text()
    assert stood >= 4
    assert today != when
    assert re.match(r"day [0-9]+ of [0-9]+ · ", when)
    page.wait_for_timeout(1500)  # four adjustments, were it still playing
    assert row(desk) == stood
    assert np.count_nonzero(np.abs(picture(desk, "ThreeD") - frame).max(2) > CHANGED) > 50
    desk.at("play-slider").locator('[role="slider"]').press("End")
    page.wait_for_function(
        f"document.querySelector('[data-testid=playback]').dataset.row > {stood}"
    )
    last = row(desk)
    desk.click("play-back")
    desk.click("play-back")
    desk.wait_for(f'[data-testid="playback"][data-row="{last - 2}"]')
    play.click()
    desk.wait_for(f'[data-testid="playback"][data-row="{last}"]')
    desk.wait_for('[data-testid="play"][aria-label="Play"]')
    total = re.match(r"day ([0-9]+) of \1 ·", desk.at("play-when").inner_text())
    assert total, desk.at("play-when").inner_text()
    desk.click("play-first")


def test_the_bone_dragged_by_its_handle_moves_along_it_and_undo_takes_it_back(a_planned_desk):
    desk, page = a_planned_desk, a_planned_desk.page
    desk.open("correction")
    before, target = values(desk, "translation", "angles"), desk.at("table-target").inner_text()
    unmoved = picture(desk, "ThreeD")
    desk.click("drag-fragment")
    arrow = blue_arrow(desk, unmoved)
    box = desk.at("over-ThreeD").bounding_box()
    x, y = box["x"] + arrow[0], box["y"] + arrow[1]
    page.mouse.move(x - 4, y - 2)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 30, steps=6)
    assert values(desk, "translation", "angles") == before  # not while it is held
    page.mouse.up()
    desk.at("undo-label").wait_for(timeout=LONG_MS)
    desk.wait("schedule", "stale")
    after = values(desk, "translation", "angles")
    assert after[3:] == before[3:]
    moved = np.array(after[:3], float) - np.array(before[:3], float)
    # The handle's third axis, turned as the bone is: about x, then y, then z, fixed axes.
    axis = Rotation.from_euler("xyz", np.array(before[3:], float), degrees=True).apply([0, 0, 1])
    assert moved @ axis > 5.0
    assert np.cross(moved, axis) == pytest.approx([0, 0, 0], abs=0.02)
    expect(desk.at("table-target")).not_to_have_text(target)
    desk.click("undo")
    become(desk, "draft-translation-2", before[2])
    assert values(desk, "translation", "angles") == before
    desk.wait("export", "done")
    desk.click("drag-fragment")
    desk.at("drag-fragment").get_by_text("Drag the bone").wait_for()
    page.mouse.move(5, 5)
    for _ in range(40):
        if np.count_nonzero(np.abs(picture(desk, "ThreeD") - unmoved).max(2) > CHANGED) < 20:
            break
        page.wait_for_timeout(250)
    else:
        pytest.fail("the 3D view does not show the bone where it was before the drag")


def blue_arrow(desk, before):
    """A pixel of the handle along the third axis: the blue that was not there before."""
    for _ in range(40):
        shown = picture(desk, "ThreeD")
        new = np.abs(shown - before).max(2) > CHANGED
        blue = new & (shown[..., 2] > shown[..., :2].max(2) + 25.0)
        if np.count_nonzero(blue) > 80:
            rows, columns = np.nonzero(blue)
            return float(np.median(columns)), float(np.median(rows))
        desk.page.wait_for_timeout(250)
    raise AssertionError("no handle is shown")


@pytest.fixture
def a_case_by_presenter(a_planned_desk, tmp_path):
    """The bytes of the same case, edited by the presenter: `edited(correction)`."""
    from hexafix.presenter import Presenter

    def edited(correction):
        presenter = Presenter(threaded=False)
        assert presenter.open_case(a_planned_desk.case)
        assert presenter.set_correction(correction)
        path = tmp_path / "by-presenter.json"
        assert presenter.save_case(path)
        presenter.close()
        return path.read_bytes()

    return edited


DEFORMITY = {
    "kind": "deformity",
    "moving": "proximal",
    "origin_lps_mm": [25.5, -211.0, 940.25],
    "ap_angulation_deg": 7.5,
    "ap_angulation": "varus",
    "lateral_angulation_deg": 4.0,
    "lateral_angulation": "apex-posterior",
    "axial_rotation_deg": 3.25,
    "axial_rotation": "internal",
    "ap_translation_mm": 6.0,
    "ap_translation": "lateral",
    "lateral_translation_mm": 2.0,
    "lateral_translation": "anterior",
    "axial_translation_mm": 1.5,
    "axial_translation": "short",
}


def test_a_deformity_typed_in_the_page_is_the_presenters_case(
    a_planned_desk, a_case_by_presenter, tmp_path
):
    desk = a_planned_desk
    desk.open("correction")
    desk.click("kind-deformity")
    desk.at("form-deformity").wait_for()
    for key, value in DEFORMITY.items():
        name, _, unit = key.rpartition("_")
        if unit in ("deg", "mm") and name != "origin_lps":
            desk.write(f"draft-{name}", f"{value:g}")
        elif isinstance(value, str) and key != "kind":
            choose(desk, key if key == "moving" else f"draft-{key}-word", value)
    for k, value in enumerate(DEFORMITY["origin_lps_mm"]):
        desk.write(f"draft-origin-{k}", f"{value:g}")
    desk.click("set-correction")
    desk.at("correction-pending").wait_for(state="detached")
    given = saved(desk, tmp_path / "by-page.json")
    assert json.loads(given)["correction"] == DEFORMITY
    assert given == a_case_by_presenter(DEFORMITY)


TARGET = {
    "kind": "target-pose",
    "position_mm": [1.25, -2.5, 171.0],
    "angles_deg": [0.5, -1.0, 2.75],
}


def test_a_target_pose_typed_in_the_page_is_the_presenters_case(
    a_planned_desk, a_case_by_presenter, tmp_path
):
    desk = a_planned_desk
    desk.open("correction")
    desk.click("kind-target-pose")
    desk.at("form-target").wait_for()
    for name, key in (("position", "position_mm"), ("target_angles", "angles_deg")):
        for k, value in enumerate(TARGET[key]):
            desk.write(f"draft-{name}-{k}", f"{value:g}")
    desk.click("set-correction")
    desk.at("correction-pending").wait_for(state="detached")
    given = saved(desk, tmp_path / "by-page.json")
    assert json.loads(given)["correction"] == TARGET
    assert given == a_case_by_presenter(TARGET)


CUT = """() => [...document.querySelectorAll(
    '.v-select__selection-text, .v-field-label--floating, .v-btn__content, .hxp-notice, .hxp-when')]
  .filter(e => e.offsetParent && e.clientWidth && e.scrollWidth > e.clientWidth + 1)
  .map(e => e.innerText)"""
"""Words of fields and buttons for which there is no room."""

STEPS = ("load", "markers", "numbering", "poses", "readings", "correction", "schedule", "export")


def test_on_a_small_screen_nothing_is_cut_and_the_opened_step_is_in_view(a_planned_desk):
    desk, page = a_planned_desk, a_planned_desk.page
    page.set_viewport_size({"width": 1280, "height": 800})
    bar = desk.at("views-bar").bounding_box()
    assert bar["height"] < 60.0  # one line
    for step in STEPS:
        # as low as it goes: a tall step above it closes and pulls it up
        desk.at(f"open-{step}").evaluate("head => head.scrollIntoView({block: 'end'})")
        desk.open(step)
        expect(desk.at(f"open-{step}")).to_be_in_viewport(ratio=0.9)
        assert page.evaluate(CUT) == [], step


def test_where_no_ct_is_loaded_no_view_tells_a_place(a_planned_desk):
    desk = a_planned_desk
    assert desk.at("Red-position").is_visible()
    desk.click("new-case")
    desk.page.get_by_text("No CT is loaded").wait_for(timeout=LONG_MS)
    for view in ("Red", "Green", "Yellow"):
        for what in ("position", "left", "top"):
            desk.at(f"{view}-{what}").wait_for(state="hidden")


def test_the_console_is_clean_after_all_this(a_planned_desk):
    assert a_planned_desk.page.said == []
