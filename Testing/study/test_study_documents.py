"""The studies as JSON, tables and files, and at the command line."""

import csv
import io
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from hexafix.cli import main
from hexafix.errors import InputError
from hexafix.study.tables import (
    angles_csv,
    angles_page,
    angles_text,
    number_cells,
    number_csv,
    number_page,
    number_text,
    rule_cells,
    verdict_cells,
)
from hexafix.study.write import write_angles, write_number

DOCUMENTS = Path(__file__).resolve().parents[2] / "Resources" / "Documents" / "study"


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as end:
        main(["study", *map(str, arguments)])
    streams = capsys.readouterr()
    return end.value.code, streams.out, streams.err


def test_the_number_document_is_finite_json_with_units(a_number_study):
    document = json.loads(json.dumps(a_number_study.as_json(), allow_nan=False))
    assert document["schema_version"] == 1
    assert document["simulated"] is True
    assert [row["markers"] for row in document["rows"]] == sorted(2 * list(range(3, 11)))
    row = document["rows"][0]
    exact = a_number_study.by_count[3].exact[0, 0]
    assert row["method"] == "groups"
    assert row["exact"]["x_mm"] == exact[0]
    assert row["exact"]["gamma_deg"] == pytest.approx(np.degrees(exact[5]))
    assert row["exact"]["volume_mm"] == pytest.approx(np.linalg.norm(exact[:3]))
    assert set(row["sampled_standard_error"]) == set(row["exact"])
    assert len(document["verdicts"]) == 13


def test_the_angles_document_holds_every_layout_and_null_for_refused_ones(an_angles_study):
    document = json.loads(json.dumps(an_angles_study.as_json(), allow_nan=False))
    layouts = document["layouts"]
    assert {len(column) for column in layouts.values()} == {2485}
    refused = [value is None for value in layouts["groups_full_mm"]]
    assert refused == (~an_angles_study.found.layouts.recognisable).tolist()
    assert all(value is not None for value in layouts["groups_exact_mm"])
    assert np.allclose(np.sum(layouts["included_angles_deg"], axis=1), 360.0)


def test_the_rule_table_holds_the_worst_of_each_rule(an_angles_study):
    rows = {(r["rule"], r["method"]): r for r in an_angles_study.by_rule}
    counts = {rule: row["layouts"] for (rule, _), row in rows.items()}
    assert counts == {"all": 2485, "relaxed": 1501, "preferred": 1081, "above-preferred": 946,
                      "ninety": 190, "even": 1}  # fmt: skip
    assert rows["preferred", "groups"]["worst_mm_at_deg"] == [45, 45, 270]
    assert rows["relaxed", "groups"]["worst_deg_at_deg"] == [15, 100, 245]
    assert rows["even", "groups"]["worst_exact_mm"] == pytest.approx(0.2706, abs=1e-4)
    for row in rows.values():
        if row["rule"] != "all":
            assert row["worst_full_mm"] == pytest.approx(row["worst_exact_mm"], rel=0.04)


def test_csv_keeps_every_digit(a_number_study, an_angles_study):
    rows = list(csv.DictReader(io.StringIO(number_csv(a_number_study))))
    assert len(rows) == 8 * 2 * 4
    assert float(rows[0]["x_mm"]) == a_number_study.by_count[3].exact[0, 0, 0]
    rows = list(csv.DictReader(io.StringIO(angles_csv(an_angles_study))))
    assert len(rows) == 2485
    column = an_angles_study.columns["least-squares_full_deg"]
    for row, value in zip(rows[::50], column[::50], strict=True):
        assert row["least-squares_full_deg"] == ("" if np.isnan(value) else repr(float(value)))


def test_pages_and_texts_hold_every_verdict(a_number_study, an_angles_study):
    for study, page, text in (
        (a_number_study, number_page, number_text),
        (an_angles_study, angles_page, angles_text),
    ):
        for verdict in study.verdicts:
            for content in (page(study), text(study)):
                assert verdict.claim in content
                assert f"{verdict.exact:.3f}" in content
                assert verdict.words in content
    widths = {len(row) for row in number_cells(a_number_study)}
    assert widths == {11}
    assert {len(row) for row in rule_cells(an_angles_study)} == {10}


def test_files_are_the_same_bytes_again_and_others_stay(a_number_study, saved, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "number.md").write_text("an older study")
    paths = write_number(a_number_study, tmp_path)
    found = {path.name: path.read_bytes() for path in paths}
    figures = {f"figure-5.{suffix}" for suffix in ("svg", "pdf", "png")}
    assert set(found) == figures | {"number.md", "number.csv", "number.json"}
    for name in figures:
        assert found[name] == saved[name], name
    assert found["number.md"].decode() == number_page(a_number_study)
    assert json.loads(found["number.json"]) == a_number_study.as_json()
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_a_folder_that_cannot_be_made_is_told(an_angles_study, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_angles(an_angles_study, tmp_path / "file" / "study")


def test_study_number_prints_one_document(capsys):
    code, out, err = run(capsys, "number", "--json", "--quiet", "--samples", 50,
                         "--full-samples", 20, "--seed", 3, "--workers", 1)  # fmt: skip
    assert code == 0
    assert err == ""
    document = json.loads(out)
    assert document["settings"]["samples"] == 50
    assert document["settings"]["seed"] == 3


def test_study_angles_writes_its_folder_and_says_so(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("hexafix.study.write.FORMATS", ("png",))
    code, out, err = run(capsys, "angles", "--samples", 20, "--full-samples", 2, "--workers", 1,
                         "--out", tmp_path / "new")  # fmt: skip
    assert code == 0
    assert "optimistic" in out
    assert "5 files in" in out
    assert "hexafix: recognise" in err
    names = {path.name for path in (tmp_path / "new").iterdir()}
    assert names == {"figure-6.png", "figure-7.png", "angles.md", "angles.csv", "angles.json"}


def test_other_errors_scale_the_answer(capsys):
    found = []
    for image, place in ((0.3, 0.06), (0.15, 0.03)):
        _, out, _ = run(capsys, "number", "--json", "-q", "--samples", 2, "--full-samples", 2,
                        "--sigma-image-mm", image, image, image,
                        "--sigma-installation-mm", place, place, place)  # fmt: skip
        found.append(json.loads(out)["rows"][0]["exact"]["x_mm"])
    assert found[0] / found[1] == pytest.approx(2.0)


@pytest.mark.parametrize(
    "arguments",
    [
        ("number", "--samples", 1),
        ("number", "--sigma-image-mm", -1, 0.3, 0.3),
        ("angles", "--full-samples", 0),
        ("angles", "--seed", -1),
        ("number", "--workers", 0),
        ("number", "--workers", "many"),
        ("colour",),
    ],
)
def test_a_wrong_command_line_exits_with_2(capsys, arguments):
    code, _, _ = run(capsys, *arguments, "-q")
    assert code == 2


def test_a_cluster_without_its_library_is_told_before_the_work(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, out, err = run(capsys, "number", "--dask", "tcp://scheduler:8786", "-q")
    assert (code, out) == (2, "")
    assert "pip install distributed" in err


def test_figures_without_matplotlib_are_told_before_the_work(capsys, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    code, out, err = run(capsys, "number", "--out", tmp_path / "study", "-q")
    assert (code, out) == (2, "")
    assert "hexafix[study]" in err
    assert not (tmp_path / "study").exists()


def test_the_speed_command_compares_with_a_plain_loop(monkeypatch, capsys):
    from hexafix.study import speed

    small = speed.three_marker_layouts(40)
    monkeypatch.setattr(speed, "three_marker_layouts", lambda: small)
    monkeypatch.setattr(speed, "PAPER_SAMPLES", 50)
    code, out, _ = run(capsys, "speed", "--json", "--workers", 1)
    assert code == 0
    found = json.loads(out)
    assert found["layouts"] == len(small)
    assert found["ratio"] == pytest.approx(found["loop_s"] / found["sweep_s"])
    assert found["memory_ratio"] < 1.2
    from hexafix.study.tables import speed_text

    assert "plain loop" in speed_text(found)


def test_the_plain_loop_finds_the_same_expectation(a_number_study):
    from hexafix.study.error_model import error_maps
    from hexafix.study.jacobians import model_jacobians
    from hexafix.study.speed import plain_loop

    found = a_number_study.by_count[3]
    errors = a_number_study.settings.errors
    maps = error_maps(model_jacobians(found.layouts, errors), found.layouts, errors)[0, 0]
    mean = plain_loop(maps, 4000, np.random.default_rng(1))
    assert mean == pytest.approx(found.exact[0, 0], rel=0.06)


@pytest.mark.parametrize("name", ["number", "angles"])
def test_the_committed_pages_are_what_the_commands_make(name, a_number_study, an_angles_study):
    study = a_number_study if name == "number" else an_angles_study
    page = (DOCUMENTS / f"{name}.md").read_text()
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in page.split("## Verdict")[1].splitlines()
        if line.startswith("|")
    ]
    committed = {row[0]: row for row in rows[2:]}
    cells = verdict_cells(study.verdicts)
    assert set(committed) == {row[0] for row in cells[1:]}
    for row in cells[1:]:
        there = committed[row[0]]
        assert there[1:4] == row[1:4]
        assert there[8] == row[8]
        assert float(there[4]) == pytest.approx(float(row[4]), abs=1.1e-3)
        for mine, theirs in ((row[6], there[6]), (row[7], there[7])):
            if mine != "-":
                assert float(theirs) == pytest.approx(float(mine), rel=0.03)
    for figure in ("figure-5",) if name == "number" else ("figure-6", "figure-7"):
        assert f"{figure}.svg" in page
        for suffix in ("svg", "png"):
            assert (DOCUMENTS / f"{figure}.{suffix}").stat().st_size > 10_000
