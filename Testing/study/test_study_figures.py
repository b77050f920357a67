"""Figures 5, 6 and 7: the same bytes every time, readable, and of the study's own numbers."""

import subprocess
import sys

import matplotlib
import numpy as np
import pytest
from hexafix.errors import MissingLibrary
from hexafix.study import plotting
from hexafix.study.figures import figure_6, figure_7
from hexafix.study.plotting import drawing, require_matplotlib, save
from hexafix.study.verdicts import EQUATION_26


def test_a_second_drawing_gives_the_same_bytes_whatever_the_users_style(
    saved, an_angles_study, tmp_path
):
    with matplotlib.rc_context({"font.size": 20, "savefig.dpi": 31, "svg.hashsalt": "other"}):
        for name, draw in (("figure-6.png", figure_6), ("figure-7.svg", figure_7)):
            save(draw(an_angles_study), tmp_path / name)
            assert (tmp_path / name).read_bytes() == saved[name], name


def test_no_date_and_no_place_stands_in_a_file(saved):
    for name, content in saved.items():
        assert b"CreationDate" not in content, name
        assert b"dc:date" not in content, name
        assert b"/work" not in content, name
        assert len(content) < 450_000, name
    assert saved["figure-6.png"].startswith(b"\x89PNG")
    assert saved["figure-7.pdf"].startswith(b"%PDF")


def test_every_axis_is_named_with_its_unit(drawn):
    for name, figure in drawn.items():
        axes = figure.findobj(matplotlib.axes.Axes)
        labels = [axis.get_ylabel() for axis in axes]
        assert sum("(mm)" in text for text in labels) == 1, name
        assert sum("(°)" in text and "error" in text for text in labels) == 1, name
        titles = {axis.get_title(loc="left") for axis in axes}
        assert {"(a) position", "(b) orientation"} <= titles, name
        assert any(axis.get_xlabel() for axis in figure.axes), name


def is_number(text):
    try:
        float(text.replace("\N{MINUS SIGN}", "-"))
    except ValueError:
        return False
    return True


def test_no_word_is_cut_off_or_smaller_than_seven_points(drawn):
    for name, figure in drawn.items():
        with drawing():
            figure.canvas.draw()
            renderer = figure.canvas.get_renderer()
        frame = figure.bbox
        texts = [t for t in figure.findobj(matplotlib.text.Text) if t.get_text()]
        words = [t for t in texts if t.get_visible() and not is_number(t.get_text())]
        assert len(words) >= 10
        for text in words:
            box = text.get_window_extent(renderer)
            assert frame.x0 <= box.x0 <= box.x1 <= frame.x1, (name, text.get_text())
            assert frame.y0 <= box.y0 <= box.y1 <= frame.y1, (name, text.get_text())
        assert min(text.get_fontsize() for text in texts) >= 7.0, name


def lines(axis, count):
    return [
        np.asarray(line.get_ydata(), float) for line in axis.lines if len(line.get_xdata()) == count
    ]


def test_figure_5_shows_the_studys_numbers_and_the_printed_ones(drawn, a_number_study):
    for axis, rows, scale in zip(
        drawn["figure-5"].axes, (slice(0, 3), slice(3, 6)), (1.0, 180 / np.pi), strict=True
    ):
        found = a_number_study.by_count.values()
        shown = lines(axis, 8)
        for q in range(rows.start, rows.stop):
            exact = [e.exact[0, 0, q] * scale for e in found]
            fit = [e.exact[0, 1, q] * scale for e in found]
            sampled = [e.sampled.mean[0, 0, q] * scale for e in found]
            for wanted in (exact, fit, sampled):
                assert any(np.allclose(line, wanted) for line in shown)
        stars = [float(line[0]) for line in lines(axis, 1)]
        assert stars == [value for _, value, _ in EQUATION_26][rows]


def test_figure_6_shows_each_layout_at_its_angles(drawn, an_angles_study):
    from matplotlib.collections import QuadMesh

    columns = an_angles_study.columns
    gaps = np.degrees(an_angles_study.found.layouts.included_angles_rad)
    panels = [a for a in drawn["figure-6"].axes if a.get_title(loc="left")]
    for axis, unit in zip(panels, ("mm", "deg"), strict=True):
        (mesh,) = [c for c in axis.collections if isinstance(c, QuadMesh)]
        grid = np.ma.filled(mesh.get_array(), np.nan)
        assert np.count_nonzero(np.isfinite(grid)) == 2485
        values = columns[f"groups_exact_{unit}"]
        for k in range(0, 2485, 101):
            row, column = round(gaps[k, 1] / 5), round(gaps[k, 0] / 5)
            assert grid[row, column] == pytest.approx(values[k], rel=1e-12)


def test_figure_7_shows_every_layout_once(drawn, an_angles_study):
    columns = an_angles_study.columns
    for axis, unit in zip(drawn["figure-7"].axes, ("mm", "deg"), strict=True):
        points = np.concatenate([np.asarray(c.get_offsets()) for c in axis.collections])
        points = points[np.argsort(points[:, 0])]
        assert np.array_equal(points[:, 0], np.arange(2485))
        assert np.allclose(points[:, 1], columns[f"groups_sampled_{unit}"])
        assert {text.get_text() for text in axis.get_legend().get_texts()} == {
            "neither rule",
            "relaxed rule",
            "45° rule",
        }


def luminance(colour):
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
              for c in matplotlib.colors.to_rgb(colour)]  # fmt: skip
    return np.array(linear)


def test_the_colours_stay_apart_for_colour_blind_readers():
    # Viénot's dichromats on linear RGB
    protan = np.array([[0.1124, 0.8876, 0.0], [0.1124, 0.8876, 0.0], [0.004, -0.004, 1.0]])
    deutan = np.array([[0.2928, 0.7072, 0.0], [0.2928, 0.7072, 0.0], [-0.0223, 0.0223, 1.0]])
    for sight in (protan, deutan, np.eye(3)):
        seen = [sight @ luminance(c) for c in (plotting.BLUE, plotting.VERMILLION, plotting.GREEN)]
        for a in range(3):
            for b in range(a):
                assert np.abs(seen[a] - seen[b]).max() > 0.1


def test_nothing_optional_is_loaded_before_it_is_used():
    code = (
        "import sys, hexafix.study, hexafix.cli.study, hexafix.study.tables, hexafix.study.write;"
        "print([n for n in ('matplotlib', 'joblib', 'distributed') if n in sys.modules])"
    )
    env = {"PYTHONPATH": ":".join(p for p in sys.path if p), "PATH": ""}
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env)
    assert run.stdout.strip() == "[]", run.stderr


def test_without_matplotlib_figures_are_refused_with_the_way_out(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingLibrary, match="matplotlib") as error:
        require_matplotlib()
    assert error.value.exit_code == 2
    assert "hexafix[study]" in str(error.value)
