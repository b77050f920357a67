"""The advisor's picture: both layouts, holes, sectors; the same bytes every time."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hexafix.accuracy import ErrorTarget, RingTask, advise
from hexafix.case import load_rings
from hexafix.hardware import HoleCircle, MarkerLayout, MarkerSite, SiteList
from hexafix.paths import resources
from hexafix.pipeline.layout import advise_layouts
from hexafix.report.layout_picture import BETTER, NOW, OVERLAP, REACH_MM, layout_picture

SVG = "{http://www.w3.org/2000/svg}"


def ring(sweep_deg, holes=None, name="ring", first_number=1):
    present = None
    if sweep_deg is not None:
        count = len(sweep_deg)
        present = MarkerLayout.of(
            radius_mm=[100.0] * count,
            sweep_deg=sweep_deg,
            height_mm=[20.0] * count,
            first_number=first_number,
        )
    holes = holes or HoleCircle(36, 100.0, occupied=(2, 20))
    return RingTask(name, holes, 3, ErrorTarget.of_radius(100.0), present, first_number)


def drawn(*tasks):
    return ET.fromstring(layout_picture(advise(tasks, top=1)))


def texts(picture):
    return [text.text for text in picture.iter(f"{SVG}text")]


def balls(picture, colour):
    return [
        np.array([float(c.get("cx")), float(c.get("cy"))])
        for c in picture.iter(f"{SVG}circle")
        if c.get("stroke") == colour and c.get("stroke-width") == "0.7"
    ]


def test_each_ball_stands_at_its_angle_with_y_upwards():
    picture = drawn(ring([0.0, 100.0, 220.0]))
    places = balls(picture, NOW)
    assert len(places) == 3
    middle = places[0] - [REACH_MM, 0.0]
    for place, sweep in zip(places, np.radians([0.0, 100.0, 220.0]), strict=True):
        wanted = middle + REACH_MM * np.array([np.cos(sweep), -np.sin(sweep)])
        assert place == pytest.approx(wanted, abs=2e-3)
    assert {"1", "2", "3"} <= set(texts(picture))
    assert {"100°", "120°", "140°"} <= set(texts(picture))


def test_sectors_overlap_only_where_the_rule_is_broken():
    def overlaps(sweeps):
        # One more stands in the legend.
        return sum(p.get("fill") == OVERLAP for p in drawn(ring(sweeps)).iter(f"{SVG}path")) - 1

    assert overlaps([0.0, 100.0, 220.0]) == 0
    assert overlaps([0.0, 45.0, 220.0]) == 0
    assert overlaps([0.0, 44.0, 220.0]) == 1
    assert overlaps([0.0, 30.0, 60.0]) == 2


def test_present_and_proposed_of_both_rings_are_shown():
    tasks = (
        ring([0.0, 120.0, 240.0], name="proximal"),
        ring([0.0, 120.0, 240.0], name="distal", first_number=4),
    )
    picture = drawn(*tasks)
    assert len(balls(picture, NOW)) == len(balls(picture, BETTER)) == 6
    words = " | ".join(texts(picture))
    for title in ("proximal ring: now", "proximal ring: proposed", "distal ring: proposed"):
        assert title in words
    assert "can be renumbered, like the other ring" in words


def test_a_ring_without_markers_has_one_rose():
    picture = drawn(ring(None))
    assert balls(picture, NOW) == []
    assert len(balls(picture, BETTER)) == 3


def test_single_sites_are_drawn_too():
    sites = tuple(MarkerSite(k + 1, 90.0 + k, float(np.radians(20.0 * k)), 20.0) for k in range(18))
    picture = drawn(ring(None, SiteList(sites)))
    assert sum(c.get("r") == "0.85" for c in picture.iter(f"{SVG}circle")) >= 18


def test_the_same_advice_is_the_same_picture():
    one, two = (layout_picture(advise([ring([0.0, 20.0, 150.0])], top=1)) for _ in range(2))
    assert one == two
    assert "nan" not in one


DOCUMENTS = resources() / "Documents"
COMMAND = re.compile(r"^hexafix (advise Resources/\S+) --top \d+ --picture (Resources/\S+)$", re.M)


def test_the_documented_pictures_are_what_their_commands_draw():
    page = (DOCUMENTS / "layout-advisor.md").read_text(encoding="utf-8")
    commands = COMMAND.findall(page)
    assert len(commands) == 2
    for command, picture in commands:
        rings = load_rings(resources().parent / command.split()[1])
        shown = ET.parse(resources().parent / picture).getroot()
        new = ET.fromstring(layout_picture(advise_layouts(rings, top=1)))
        assert texts(shown) == texts(new)
        assert [part.tag for part in shown.iter()] == [part.tag for part in new.iter()]
