"""The demo runs as printed, and again in the same folder."""

import json

import pytest
from hexafix.cli import demo
from hexafix.errors import InputError
from hexafix.phantom import PhantomSpec
from hexafix.progress import silent


@pytest.fixture
def a_small_phantom(monkeypatch):
    """The demo's phantom with coarse voxels, so that it is quick."""

    def spec(**given):
        return PhantomSpec(size_ijk=(250, 260, 200), spacing_mm=(1.15, 1.1, 1.45), **given)

    monkeypatch.setattr("hexafix.phantom.PhantomSpec", spec)


def test_the_demo_plans_verifies_and_tells_its_errors_and_can_be_repeated(
    a_small_phantom, tmp_path
):
    summary, text = demo.run_demo(tmp_path / "demo", seed=5, progress=silent)
    errors = summary["errors"]
    assert summary["simulated"] is True
    assert errors["balls_found"] == errors["balls"] == 8
    assert errors["ball_worst_mm"] < 0.08
    assert errors["recognised_mm"] < 1.0
    assert errors["end_mm"] < 1.0
    assert "not a medical device" in text
    plan = json.loads((tmp_path / "demo" / "prescription" / "plan.json").read_text())
    assert plan["approval"] == "not approved"
    again, _ = demo.run_demo(tmp_path / "demo", seed=5, progress=silent)
    assert again["errors"] == errors


def test_a_folder_with_other_files_is_not_cleared(tmp_path):
    folder = tmp_path / "demo" / "phantom"
    folder.mkdir(parents=True)
    (folder / "truth.json").write_text("{}")
    (folder / "thesis.txt").write_text("mine")
    with pytest.raises(InputError):
        demo.run_demo(tmp_path / "demo", seed=5, progress=silent)
    assert (folder / "thesis.txt").read_text() == "mine"
