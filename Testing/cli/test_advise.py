"""``hexafix advise`` at the command line, and ``check-layout`` with known holes."""

import json
from types import SimpleNamespace

import pytest
from hexafix.cli import main


@pytest.fixture
def hexafix(capsys):
    """Runs a command in this process: exit code, stdout, stderr."""

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return SimpleNamespace(returncode=ended.value.code, stdout=out, stderr=err)

    return run


def markers(sweeps, first=1):
    return [
        {"number": first + k, "radius_mm": 100.0, "sweep_deg": phi, "height_mm": 20.0}
        for k, phi in enumerate(sweeps)
    ]


@pytest.fixture
def a_layout_file(tmp_path):
    """Two even rings, which nothing can tell apart, on rings of 36 holes."""
    document = {
        "schema_version": 1,
        "proximal": markers([0.0, 120.0, 240.0]),
        "distal": markers([0.0, 120.0, 240.0], 4),
        "holes": {
            "proximal": {"count": 36, "radius_mm": 100.0, "occupied": [24]},
            "distal": {"count": 36, "radius_mm": 100.0, "heights_mm": [20.0]},
        },
    }
    path = tmp_path / "layout.json"
    path.write_text(json.dumps(document))
    return path


def test_both_rings_are_advised_together(hexafix, a_layout_file, tmp_path):
    picture = tmp_path / "rose.svg"
    run = hexafix("advise", a_layout_file, "--top", 3, "--json", "--picture", picture)
    assert run.returncode == 0, run.stderr
    document = json.loads(run.stdout)
    assert document["schema_version"] == 1
    assert document["rings"]["proximal"]["holes"]["occupied"] == [24]
    assert [entry["rank"] for entry in document["advised"]] == [1, 2, 3]
    errors = [entry["error_mm"] for entry in document["advised"]]
    assert errors == sorted(errors)
    for entry in document["advised"]:
        assert entry["exchange_mm"] >= 8.0
        for name, ring in entry["rings"].items():
            assert ring["uniqueness_mm"] >= 8.0
            assert ring["rule"] == "preferred"
            assert all(m["hole"] != 24 for m in ring["markers"]) or name == "distal"
    assert document["rings"]["proximal"]["weaker_because"][0]["term"] == "relabelling"
    assert picture.read_text().startswith("<svg")
    text = hexafix("advise", a_layout_file, "--top", 1)
    assert "weaker: numbers 1,2,3 turned" in text.stdout
    assert "1. error" in text.stdout


def test_check_layout_advises_free_holes_where_they_are_known(hexafix, a_layout_file):
    run = hexafix("check-layout", a_layout_file, "--json")
    assert run.returncode == 0, run.stderr
    document = json.loads(run.stdout)
    keys = {"included_angles_deg", "rule", "uniqueness_mm"}
    assert keys | {"predicted_error_mm", "predicted_error_deg"} <= document["proximal"].keys()
    sentence = document["advice"][0]
    assert sentence.startswith("proximal ring: not unique: numbers 1,2,3 turned")
    moved = sentence.split("; move ")[1]
    assert float(moved.split(" to ")[1].split()[0]) % 10.0 == 0.0


def test_a_bare_ring_needs_no_file(hexafix):
    run = hexafix("advise", "--n", 3, "--holes", 12, "--occupied", "1,2", "--heights-mm", "20",
                  "--radius-mm", 80, "--top", 1, "--json")  # fmt: skip
    assert run.returncode == 0, run.stderr
    ring = json.loads(run.stdout)["advised"][0]["rings"]["ring"]
    assert {m["radius_mm"] for m in ring["markers"]} == {80.0}
    assert not {m["hole"] for m in ring["markers"]} & {1, 2}


@pytest.mark.parametrize(
    ("options", "code"),
    [
        (["--n", "7"], 2),
        (["--occupied", "1,x"], 2),
        (["--occupied", "99"], 2),
        (["--holes", "36", "--picture", "rose.png"], 2),
        (["--margin-mm", "3"], 2),
        (["--only", "distal"], 2),
        (["no-such-file.json"], 2),
        (["--holes", "4", "--n", "4"], 3),
    ],
)
def test_what_cannot_be_served_is_told_with_its_exit_code(
    hexafix, options, code, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    run = hexafix("advise", *options, "--json")
    assert run.returncode == code, run.stdout + run.stderr
    assert json.loads(run.stdout)["refused" if code == 3 else "errors"]
    assert "Traceback" not in run.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_ring_file_with_a_key_that_is_not_known_is_refused_by_name(hexafix, tmp_path):
    path = tmp_path / "ring.json"
    document = {"schema_version": 1, "holes": {"count": 36, "radius_mm": 100.0, "hue": 1}}
    path.write_text(json.dumps(document))
    run = hexafix("advise", path, "--json")
    assert run.returncode == 2
    assert json.loads(run.stdout)["errors"][0]["where"] == "holes.hue"


def test_the_other_ring_keeps_its_layout_where_one_is_asked_for(hexafix, a_layout_file):
    run = hexafix("advise", a_layout_file, "--only", "distal", "--top", 1, "--json")
    document = json.loads(run.stdout)
    assert set(document["rings"]) == {"distal"}
    assert document["present"]["exchange_mm"] < 1e-6
    assert document["advised"][0]["exchange_mm"] >= 8.0
