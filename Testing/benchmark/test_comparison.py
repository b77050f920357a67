"""A quick slice of the comparison with other tools: its document, its page, and its power."""

import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hexafix.benchmark import comparison_balls, comparison_pose, comparison_race
from hexafix.benchmark.comparison import compare
from hexafix.errors import InputError


@pytest.fixture(scope="module")
def a_document():
    """Two groups, few tools, small samples."""
    return compare(
        ("balls", "kinematics"),
        quick=True,
        only=("simpleitk-centroid", "careless", "least-squares"),
    )


def tools(document, group):
    rows = next(one["tools"] for one in document["groups"] if one["name"] == group)
    return {row["name"]: row for row in rows}


def test_the_document_has_every_key_and_no_other(a_document, check_schema):
    check_schema(a_document)
    assert {"hexafix", "simpleitk-centroid", "careless"} == set(tools(a_document, "balls"))
    assert {"hexafix", "least-squares"} == set(tools(a_document, "kinematics"))


def test_a_hexafix_made_worse_comes_out_worse(a_document):
    found = {row["name"]: row for row in a_document["controls"]}
    assert {"careless: 3D RMS, fine", "careless: 3D RMS, clinical", "careless: 3D RMS, thick",
            "careless: memory", "careless: processor time"} >= set(found)  # fmt: skip
    accuracy = [row for name, row in found.items() if "3D RMS" in name]
    assert len(accuracy) == 3
    assert all(row["told_apart"] for row in accuracy)
    if "careless: memory" in found:
        assert found["careless: memory"]["told_apart"]


def test_a_control_that_is_as_good_as_hexafix_is_not_called_worse(monkeypatch):
    from hexafix.benchmark import comparison

    fine = {"case": "fine", "balls": 1, "missed": 0, "invented": 0, "rms_3d_mm": 0.004}
    row = {"name": "same", "against": "hexafix", "control": False, "accuracy": [fine],
           "peak_mb": 20.0, "cpu_ratio": 1.0}  # fmt: skip
    rows = [{**row, "name": "hexafix"}, {**row, "control": True}]
    found = comparison._controls([{"tools": rows, "data": {"voxels_mb": 200.0}}])
    assert len(found) == 3
    assert not any(control["told_apart"] for control in found)


def test_the_rivals_find_the_ball_beside_their_bias(a_document):
    rows = tools(a_document, "balls")
    for name in ("hexafix", "simpleitk-centroid"):
        for case in rows[name]["accuracy"]:
            assert case["missed"] == 0
            assert case["rms_3d_mm"] < 0.25
    ours, theirs = (rows[n]["accuracy"][0] for n in ("hexafix", "simpleitk-centroid"))
    assert theirs["bias_along_rod_mm"] > 5.0 * abs(ours["bias_along_rod_mm"])


def test_both_solvers_find_every_mechanism_pose(a_document):
    for row in tools(a_document, "kinematics").values():
        assert row["accuracy"][0]["wrong"] == 0
        assert row["accuracy"][0]["largest_mm"] < 1e-6


def test_missed_and_invented_balls_are_counted():
    truth = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    centers = np.array([[0.3, 0.0, 0.4], [0.0, 40.0, 0.0], [0.0, 0.0, 2.6]])
    found = comparison_balls.compared(centers, truth)
    assert (found["missed"], found["invented"]) == (1, 2)
    assert found["rms_3d_mm"] == pytest.approx(0.5)
    nothing = comparison_balls.compared(np.zeros((0, 3)), truth)
    assert (nothing["missed"], nothing["invented"], nothing["rms_3d_mm"]) == (2, 0, None)


@pytest.mark.parametrize("name", [n for n in comparison_balls.FINDERS if n != "careless"])
def test_every_finder_finds_a_ball_without_a_rod(name):
    from hexafix.phantom.local import Scene, render_ball

    tool = next(tool for tool in comparison_balls.TOOLS if tool.name == name)
    if tool.missing:
        pytest.skip(f"{tool.missing} is not installed")
    finder = comparison_balls.FINDERS[name]
    volume, truth = render_ball(Scene(rod_diameter_mm=0.0), np.random.default_rng(4))
    centers = finder.find(finder.hold(volume), comparison_balls.DIAMETER_MM)
    assert centers.shape == (1, 3)
    assert np.linalg.norm(centers[0] - truth.center_mm) < 0.08


def test_equal_errors_give_every_pose_solver_the_same_pose(tmp_path):
    comparison_pose.write_data(tmp_path, quick=True, seed=3)
    held = comparison_pose._prepare(tmp_path)
    found = {tool.name: tool.run(held) for tool in comparison_pose.TOOLS}
    count = len(held[0][0])
    for name, poses in found.items():
        assert poses[:count] == pytest.approx(found["hexafix"][:count], abs=1e-6), name
    assert np.abs(found["kabsch-batch"] - found["hexafix"])[count:].max() > 0.01


def test_a_tool_that_is_not_installed_is_named_and_left_out(monkeypatch):
    monkeypatch.setattr(comparison_race, "find_spec", lambda name: None if name == "cc3d" else True)
    names = [tool.name for tool in comparison_balls.TOOLS if tool.missing]
    assert names == ["cc3d-centroid"]


def test_an_unknown_comparison_is_refused():
    with pytest.raises(InputError) as caught:
        compare(("nothing",))
    assert caught.value.faults[0].code == "benchmark-unknown"


def test_the_command_line_refuses_an_unknown_comparison_and_writes_nothing(tmp_path):
    command = [sys.executable, "-m", "hexafix", "benchmark", "nothing", "--page", tmp_path / "page"]
    env = os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    run = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "benchmark-unknown" in run.stderr or "no such comparison" in run.stderr
    assert not (tmp_path / "page").exists()


def test_the_page_says_where_another_tool_is_better(a_document):
    from hexafix.comparison.page import page

    document = json.loads(json.dumps(a_document))
    rows = tools(document, "balls")
    rows["simpleitk-centroid"].update(ratio=0.5, ratio_low=0.4, ratio_high=0.6)
    rows["simpleitk-centroid"]["accuracy"][0]["rms_3d_mm"] = 1e-6
    text = page(document)
    line = next(x for x in text.splitlines() if x.startswith("- SimpleITK"))
    assert "better in 3D RMS (fine)" in line
    assert "time (0.50 ×)" in line
    assert "balls missed (fine, clinical, thick, raced)" in line.split("equal in")[1]


def test_the_page_names_neither_this_machine_nor_its_folders(a_document):
    from hexafix.comparison.page import document_text, page

    text = page(a_document) + document_text(a_document)
    assert platform.node() not in text or len(platform.node()) < 3
    for word in (str(Path.home()), str(Path.cwd()), "/tmp", "site-packages"):
        assert word not in text


def test_page_and_pictures_are_written(a_document, tmp_path):
    pytest.importorskip("matplotlib")
    from hexafix.comparison.page import write_page

    written = write_page(a_document, tmp_path)
    names = ["benchmark.json", "benchmark.md", "benchmark.svg", "benchmark.png"]
    assert [path.name for path in written] == names
    assert all(path.stat().st_size > 1000 for path in written)


def test_the_same_document_gives_the_same_bytes(a_document, tmp_path):
    pytest.importorskip("matplotlib")
    from hexafix.comparison.page import write_page

    small = {**a_document, "groups": a_document["groups"][1:]}
    pairs = zip(write_page(small, tmp_path / "a"), write_page(small, tmp_path / "b"), strict=True)
    for path, again in pairs:
        assert path.read_bytes() == again.read_bytes()
