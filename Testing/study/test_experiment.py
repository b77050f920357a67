"""The model experiment on simulated CT: sound chain, right statistics, able to fail."""

import json
import re
import statistics
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hexafix.cli import main
from hexafix.correction import compensation as compensation_module
from hexafix.errors import InputError, MissingLibrary
from hexafix.study import experiment, experiment_chain
from hexafix.study.experiment import study_experiment
from hexafix.study.experiment_chain import (
    ALL,
    ALONE,
    HAND_MM,
    MOTOR_MM,
    OURS,
    PAPER,
    Sources,
    Way,
    bones,
    enact,
    vector,
)
from hexafix.study.experiment_document import experiment_document
from hexafix.study.experiment_figure import experiment_figure
from hexafix.study.experiment_floor import installation_floor
from hexafix.study.experiment_goals import budgets, goals
from hexafix.study.experiment_scan import FITS, ImageError, Seen, measured
from hexafix.study.experiment_statistics import TABLE_2, Summary
from hexafix.study.experiment_tables import experiment_page, experiment_text
from hexafix.study.experiment_trial import (
    BEFORE_DEG,
    BEFORE_MM,
    MECHANISM_MM,
    ExperimentSettings,
    draw_trial,
)
from hexafix.study.write import write_experiment

DOCUMENTS = Path(__file__).resolve().parents[2] / "Resources" / "Documents" / "study"

SMALL = ExperimentSettings(poses=2, drawn=4, seed=3, voxel_mm=1.6, jobs=1)
NOTHING = Sources(image=False, installation=False, rounding=False, mechanism=False)
EXACT = {fit: Seen(np.zeros((2, 4, 3)), None) for fit in FITS}
COLUMNS = ("x_mm", "y_mm", "z_mm", "alpha_deg", "beta_deg", "gamma_deg")


@pytest.fixture(scope="module")
def small():
    return study_experiment(SMALL)


@pytest.fixture(scope="module")
def trials():
    return [draw_trial(SMALL, number, rendered=False) for number in range(1, 31)]


def volumes(trials, way, kind, sources=ALL, seen=EXACT):
    """Mean lengths of position and of orientation errors of one way, mm and degrees."""
    found = [
        getattr(enact(trial, seen, sources, roads=(), ways=(way,)), kind)[way] for trial in trials
    ]
    return (
        np.mean([np.linalg.norm(v[:3]) for v in found]),
        np.degrees(np.mean([np.linalg.norm(v[3:]) for v in found])),
    )


def test_without_any_error_every_chain_reduces_the_bones_exactly(trials):
    for trial in trials[:3]:
        found = enact(trial, EXACT, NOTHING)
        for error in (*found.recognised.values(), *found.measured.values(),
                      *found.compensated.values(), *found.after.values()):  # fmt: skip
            assert np.abs(error).max() < 1e-8
        assert np.linalg.norm(found.before[:3]) > 5.0


def test_bones_start_in_the_printed_range_and_ring_frames_follow_them(trials):
    low, high = np.array(BEFORE_MM).T
    low_deg, high_deg = np.array(BEFORE_DEG).T
    for trial in trials:
        before = vector(bones(trial, trial.spec.mechanism_pose))
        assert np.all((before[:3] >= low - 1e-9) & (before[:3] <= high + 1e-9))
        degrees = np.degrees(before[3:])
        assert np.all((degrees >= low_deg - 1e-9) & (degrees <= high_deg + 1e-9))
        assert np.allclose(
            (trial.rings[1].inverse() @ trial.rings[0]).matrix, trial.spec.mechanism_pose.matrix
        )
    # every frame is reduced elsewhere, else one strut length would decide over the rounding
    ends = {tuple(trial.spec.target_pose.position_mm) for trial in trials}
    assert len(ends) == len(trials)


def test_installation_alone_sets_the_floor_that_its_covariance_predicts():
    drawn = [draw_trial(SMALL, number, rendered=False) for number in range(1, 161)]
    errors = np.concatenate([trial.installation_mm.ravel() for trial in drawn])
    assert errors.std() == pytest.approx(0.4 / 6, rel=0.04)
    found = [
        enact(t, EXACT, ALONE["installation"], roads=(OURS,), ways=()).recognised[OURS]
        for t in drawn
    ]
    # the rings stand 155 mm apart on average
    mm = np.linalg.norm(np.array(found)[:, :3], axis=1)
    deg = np.degrees(np.linalg.norm(np.array(found)[:, 3:], axis=1))
    assert abs(mm.mean() - 0.128) < 3.5 * mm.std() / np.sqrt(len(mm))
    assert abs(deg.mean() - 0.065) < 3.5 * deg.std() / np.sqrt(len(deg))


def test_the_floor_is_that_of_plain_fits_by_singular_values():
    rng = np.random.default_rng(2)
    angles = np.radians([0.0, 120.0, 240.0])
    ring = np.stack([100 * np.cos(angles), 100 * np.sin(angles), np.full(3, 20.0)], axis=-1)

    def fitted(count):
        balls = ring + rng.normal(0.0, 0.4 / 6, (count, 3, 3))
        middle, centre = balls.mean(axis=1), ring.mean(axis=0)
        u, _, vt = np.linalg.svd(np.einsum("ni,knj->kij", ring - centre, balls - middle[:, None]))
        flip = np.ones((count, 3))
        flip[:, 2] = np.linalg.det(u) * np.linalg.det(vt)
        rotation = np.einsum("kai,ka,kja->kij", vt, flip, u)
        return rotation, middle - rotation @ centre

    turned_a, moved_a = fitted(20_000)
    turned_b, moved_b = fitted(20_000)
    for distance in (120.0, 155.0, 190.0):
        apart = np.array([0.0, 0.0, distance])
        position = np.einsum("kji,kj->ki", turned_b, moved_a + apart - moved_b) - apart
        between = np.einsum("kji,kjl->kil", turned_b, turned_a)
        angle = np.arccos((np.trace(between, axis1=1, axis2=2) - 1.0) / 2.0)
        mm, rad = installation_floor(distance)
        assert np.linalg.norm(position, axis=1).mean() == pytest.approx(mm, rel=0.02)
        assert angle.mean() == pytest.approx(rad, rel=0.02)


def test_the_mechanism_alone_errs_as_the_paper_says(trials):
    way = Way(PAPER, "none", MOTOR_MM)
    found = [enact(t, EXACT, ALONE["mechanism"], roads=(), ways=(way,)).after[way] for t in trials]
    twists = np.array([t.mechanism_twists for t in trials]) / MECHANISM_MM
    assert twists[..., :3].std() == pytest.approx(1.0, abs=0.2)
    # without struts in the plan only the error at the end acts, turned into the bones' frame
    for trial, error in zip(trials, found, strict=True):
        assert np.linalg.norm(error[3:]) == pytest.approx(
            np.linalg.norm(trial.mechanism_twists[1, 3:]), rel=1e-3
        )


@pytest.mark.parametrize(("mode", "road"), [("additive", PAPER), ("calibrated", OURS)])
def test_a_sign_error_in_the_compensation_is_seen(mode, road, trials, monkeypatch):
    way = Way(road, mode, MOTOR_MM)
    sources = ALONE["installation"]
    right = volumes(trials, way, "after", sources)
    if mode == "additive":
        right_difference = vars(compensation_module.Compensation)["pose_vector_difference"].fget
        monkeypatch.setattr(
            compensation_module.Compensation,
            "pose_vector_difference",
            property(lambda self: -right_difference(self)),
        )
    else:
        compensate = experiment_chain.compensate

        def turned(rings, **knobs):
            found = compensate(rings, **knobs)
            wrong = {
                side: seen @ getattr(found, side).inverse() @ seen
                for side, seen in (("proximal", rings.proximal), ("distal", rings.distal))
            }
            return replace(found, **wrong)

        monkeypatch.setattr(experiment_chain, "compensate", turned)
    wrong = volumes(trials, way, "after", sources)
    assert wrong[0] > 3.0 * right[0]
    assert wrong[1] > 3.0 * right[1]
    assert wrong[0] > 0.2


def test_compensation_beats_none_and_hand_scales_are_coarser(trials):
    errors = {
        (mode, scale): volumes(trials, Way(OURS, mode, scale), "compensated")
        for mode in ("none", "fused", "calibrated")
        for scale in (MOTOR_MM, HAND_MM)
    }
    assert errors["calibrated", MOTOR_MM][0] < errors["fused", MOTOR_MM][0]
    assert errors["fused", MOTOR_MM][0] < 0.85 * errors["none", MOTOR_MM][0]
    assert errors["calibrated", MOTOR_MM][0] < 0.75 * errors["calibrated", HAND_MM][0]
    assert errors["none", HAND_MM] == errors["none", MOTOR_MM]
    best = volumes(trials, Way(OURS, "calibrated", HAND_MM), "after", ALONE["rounding"])
    plain = volumes(trials, Way(PAPER, "additive", HAND_MM), "after", ALONE["rounding"])
    assert best[0] < 0.85 * plain[0]


def test_summaries_are_those_of_the_standard_library(small):
    document = experiment_document(small)
    parts = [document["rendered"]["before"]]
    parts += [row["error"] for row in document["rendered"]["recognised"]]
    parts += [row[kind] for row in document["rendered"]["corrected"]
              for kind in ("measured", "compensated", "after")]  # fmt: skip
    assert len(parts) == 1 + 5 + 3 * len(experiment_chain.WAYS)
    for part in parts:
        columns = list(zip(*part["values"], strict=True))
        for name, column in zip(COLUMNS, columns, strict=True):
            assert part["low"][name] == min(column)
            assert part["high"][name] == max(column)
            assert part["mean"][name] == pytest.approx(statistics.mean(column), abs=1e-12)
            assert part["deviation"][name] == pytest.approx(statistics.stdev(column), abs=1e-12)
        for unit, rows in (("mm", slice(0, 3)), ("deg", slice(3, 6))):
            lengths = [sum(v**2 for v in pose[rows]) ** 0.5 for pose in part["values"]]
            every = [v for pose in part["values"] for v in pose[rows]]
            assert part[f"volume_mean_{unit}"] == pytest.approx(statistics.mean(lengths))
            assert part[f"volume_deviation_{unit}"] == pytest.approx(statistics.stdev(lengths))
            assert part[f"pooled_mean_{unit}"] == pytest.approx(statistics.mean(every), abs=1e-12)
            assert part[f"pooled_deviation_{unit}"] == pytest.approx(statistics.stdev(every))


def test_pooling_gives_the_figures_printed_under_table_2():
    # ten poses that have exactly the printed means and deviations of each column
    pattern = np.array([-1.0, 1.0] * 5) * np.sqrt(9 / 10)
    values = np.array(TABLE_2.mean) + pattern[:, None] * np.array(TABLE_2.deviation)
    values[:, 3:] = np.radians(values[:, 3:])
    found = Summary.of(values)
    assert found.deviation == pytest.approx(TABLE_2.deviation)
    assert found.pooled_mean == pytest.approx([0.214, -0.031], abs=1e-3)
    assert found.pooled_deviation == pytest.approx([0.573, 0.161], abs=2e-3)


def test_a_drawn_image_error_has_the_measured_mean_and_covariance(trials):
    rng = np.random.default_rng(5)
    root = np.array([[0.02, 0, 0], [0.01, 0.03, 0], [0, -0.01, 0.05]])
    scans = []
    for _ in range(60):
        error = np.array([0.01, 0.0, -0.09]) + rng.normal(size=(2, 4, 3)) @ root.T
        scans.append({fit: Seen(error, None) for fit in FITS})
    found = measured(scans)["isosurface"]
    assert found.balls == 480
    assert found.bias_mm == pytest.approx([0.01, 0.0, -0.09], abs=0.01)
    assert found.covariance_mm2 == pytest.approx(root @ root.T, abs=6e-4)
    assert found.rms_mm**2 == pytest.approx(
        np.mean(np.sum([s["rays"].error_mm ** 2 for s in scans], axis=-1)), rel=0.01
    )
    assert found.worst_mm == max(
        np.linalg.norm(ball) for s in scans for ball in s["rays"].error_mm.reshape(-1, 3)
    )
    sharp = ImageError(found.bias_mm, found.covariance_mm2, None, 480, 1.0)
    drawn = np.concatenate([sharp.draw(t).error_mm.reshape(-1, 3) for t in trials])
    assert drawn.mean(axis=0) == pytest.approx(found.bias_mm, abs=0.015)
    assert np.cov(drawn.T) == pytest.approx(found.covariance_mm2, abs=1.2e-3)


def test_the_whole_ct_gives_every_ball_to_both_fits(small):
    assert small.image["rays"].balls == 2 * 8
    assert small.image["rays"].rms_mm < 0.04
    assert 0.05 < small.image["isosurface"].rms_mm < 0.15
    assert small.image["isosurface"].worst_mm < 0.2
    # the sphere fit is drawn towards the rod, which ends in the ball from below
    assert small.image["isosurface"].bias_mm[2] < -0.05
    assert small.image["rays"].stated_mm2 is not None


def test_the_number_of_jobs_changes_nothing(small):
    again = study_experiment(replace(SMALL, jobs=2))
    assert json.dumps(experiment_document(again)) == json.dumps(experiment_document(small))


def test_another_seed_draws_other_poses():
    first, second = (
        draw_trial(replace(SMALL, seed=seed), 1, rendered=True).spec for seed in (3, 4)
    )
    assert not np.allclose(first.mechanism_pose.matrix, second.mechanism_pose.matrix)
    with_ct, without = (draw_trial(SMALL, 1, rendered=flag).spec for flag in (True, False))
    assert with_ct.seed != without.seed


def test_the_budget_switches_one_source_on_at_a_time(small):
    found = budgets(small.drawn)
    assert {budget.name for budget in found} == {"recognised", "compensated", "after"}
    for budget in found:
        assert np.sum(list(budget.shares.values()), axis=0) == pytest.approx([1.0, 1.0])
        if budget.name == "recognised":
            # readings and mechanism have no part in what the image shows
            assert budget.alone["rounding"][0] < 1e-9
            assert budget.alone["mechanism"][0] < 1e-9
            assert 0.0 < budget.alone["image"][0] < budget.alone["installation"][0]
        if budget.name == "compensated" and budget.way.mode == "additive":
            assert budget.alone["installation"][0] < 1e-9
    reached = {(g.name, g.unit): g for g in goals(small)}
    assert len(reached) == 14
    first = reached["Table 1, image alone, mean volume error", "mm"]
    assert first.drawn == small.drawn.recognised(OURS).volume_mean[0]
    assert "installation alone" in first.bound


def test_every_output_says_that_it_is_simulated(small):
    document = json.loads(json.dumps(experiment_document(small), allow_nan=False))
    assert document["simulated"] is True
    assert "jobs" not in document["settings"]
    text, page = experiment_text(small), experiment_page(small)
    for section in page.split("\n## ")[1:]:
        assert "Simulated" in section.split("|")[0]
    assert text.count("(simulated)") == page.count("\n## ")
    for row in text.splitlines():
        if row.startswith("paper"):
            assert "physical" in row
    figure = experiment_figure(small)
    assert "Simulated" in figure.get_suptitle()


def test_files_are_the_same_bytes_again(small, tmp_path, monkeypatch):
    monkeypatch.setattr("hexafix.study.write.FORMATS", ("svg",))
    both = []
    for name in ("one", "two"):
        paths = write_experiment(small, tmp_path / name)
        both.append({path.name: path.read_bytes() for path in paths})
    assert both[0] == both[1]
    assert set(both[0]) == {"experiment.md", "experiment.json", "experiment.svg"}


def test_the_command_hands_its_settings_on(small, capsys, monkeypatch):
    asked = []

    def recorded(settings, *, progress):
        asked.append(settings)
        return small

    monkeypatch.setattr(experiment, "study_experiment", recorded)
    with pytest.raises(SystemExit) as end:
        main(["study", "experiment", "--poses", "3", "--drawn", "7", "--seed", "5", "--voxel-mm",
              "1.0", "--jobs", "2", "--json", "-q"])  # fmt: skip
    assert end.value.code == 0
    assert asked == [ExperimentSettings(poses=3, drawn=7, seed=5, voxel_mm=1.0, jobs=2)]
    assert json.loads(capsys.readouterr().out)["study"] == "experiment"
    with pytest.raises(SystemExit):
        main(["study", "experiment", "-q"])
    assert asked[-1] == ExperimentSettings()
    assert "simulated" in capsys.readouterr().out


@pytest.mark.parametrize(
    "wrong", [{"poses": 1}, {"drawn": 1}, {"seed": -1}, {"jobs": 0}, {"voxel_mm": 3.0}]
)
def test_impossible_settings_are_refused(wrong):
    with pytest.raises(InputError, match="out of range"):
        ExperimentSettings(**wrong)


def test_a_missing_isosurface_is_told_before_any_ct(monkeypatch):
    monkeypatch.setitem(sys.modules, "skimage.measure", None)
    monkeypatch.setattr(experiment, "scan", lambda trial: pytest.fail("rendered"))
    with pytest.raises(MissingLibrary, match="scikit-image"):
        study_experiment(SMALL)


def test_the_committed_page_is_of_the_default_run(small):
    page = (DOCUMENTS / "experiment.md").read_text(encoding="utf-8")
    default = ExperimentSettings()
    mine = experiment_page(small)
    titles = [re.findall(r"^# .*$", text, re.MULTILINE) for text in (page, mine)]
    assert titles[0] == titles[1]
    assert page.count("\n## ") == mine.count("\n## ")
    assert page.count("\n| ") == mine.count("\n| ")
    for printed in re.findall(r"^\| paper, physical.*$", mine, re.MULTILINE):
        assert printed in page
    floor = mine.split("## Floor")[1].split("## Goals")[0]
    assert floor in page
    assert f"{default.poses} poses through a whole rendered CT" in page
    assert f"{default.drawn} poses without CT" in page
    assert f"voxels {default.voxel_mm:g} mm" in page
    assert f"seed {default.seed}." in page
