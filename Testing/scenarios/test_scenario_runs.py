"""A varied slice of the catalogue end to end, and what a run makes of what goes wrong."""

import json
from dataclasses import replace

import pytest
from hexafix.cli import main
from hexafix.errors import Cancelled
from hexafix.scenarios import run
from hexafix.scenarios.report import report_document, report_markdown, report_text, write_report
from hexafix.scenarios.run import chosen, run_scenario, run_scenarios
from hexafix.scenarios.scenario import Refusal

SLICE = ("S24", "S45", "S46", "S62", "S66", "S70", "S82", "S85", "S97", "S106")
"""Tilted gantry feet first; carbon and streaks; saturated steel; an even layout settled by the
readings, and without them; fragment motion and deformity of the distal fragment, compensation
additive and none; a flat mirrored frame, a lost slice, readings in the reverse order."""

EMPTY = "S93"
"""A tiny image without balls: quick."""


@pytest.fixture(scope="module")
def a_slice():
    return run_scenarios(chosen(SLICE), jobs=2)


@pytest.mark.parametrize("place", range(len(SLICE)), ids=SLICE)
def test_the_scenario_ends_as_it_must(a_slice, place):
    outcome = a_slice[place]
    assert outcome.id == SLICE[place]
    assert outcome.came == outcome.due, [fault.message for fault in outcome.faults]
    wrong = [finding for finding in outcome.findings if not finding.passed]
    assert not wrong
    assert len(outcome.findings) >= (5 if outcome.due != "planned" else 17)


def test_the_report_holds_every_outcome_its_limits_and_no_path(a_slice, tmp_path):
    document = report_document(a_slice)
    assert document["totals"]["as_expected"] == document["totals"]["scenarios"] == len(SLICE)
    assert document["all_as_expected"] is True
    assert (document["totals"]["to_be_planned"], document["totals"]["to_be_refused"]) == (6, 4)
    write_report(document, tmp_path / "new")
    assert json.loads((tmp_path / "new" / "scenarios.json").read_text()) == document
    page = (tmp_path / "new" / "scenarios.md").read_text()
    assert "simulated" in page
    assert "not a medical device" in page
    assert "`hexafix scenarios" in page
    for outcome in a_slice:
        assert f"| {outcome.id} | {outcome.title} | {outcome.due} |" in page
    ball = next(f for f in a_slice[0].findings if f.name == "ball centre")
    assert f"{ball.value:.3f} ({ball.limit:.3f})" in page
    assert str(tmp_path) not in page
    assert "/tmp" not in page + json.dumps(document)
    assert "10 of 10 simulated scenarios as expected" in report_text(document)


def test_a_scenario_is_judged_the_same_twice_and_in_any_process(a_slice):
    again = run_scenario(chosen(["S85"])[0])
    before = a_slice[SLICE.index("S85")]
    assert again.findings == before.findings
    assert again.came == before.came


def test_a_refusal_where_a_plan_was_due_is_not_as_expected():
    outcome = run_scenario(replace(chosen([EMPTY])[0], refusal=None))
    assert (outcome.due, outcome.came) == ("planned", "refused: ring-not-found")
    assert not outcome.as_expected
    document = report_document([outcome])
    assert document["all_as_expected"] is False
    assert "**not as expected**" in report_markdown(document)
    assert "WRONG" in report_text(document)


def test_another_refusal_than_the_one_due_is_not_as_expected():
    due = Refusal({"ring-not-found": "H13"})
    outcome = run_scenario(replace(chosen([EMPTY])[0], refusal=due))
    assert outcome.came == outcome.due
    assert not outcome.as_expected


def test_a_plan_where_a_refusal_was_due_is_not_as_expected(monkeypatch):
    monkeypatch.setattr(run, "_asked", lambda *_: ({}, run.must("verified", True)))
    monkeypatch.setattr(run, "judge_plan", lambda *_, **__: iter(()))
    outcome = run_scenario(chosen([EMPTY])[0])
    assert outcome.came == "planned"
    assert not outcome.as_expected


def test_an_error_that_nobody_meant_is_told_as_a_defect_and_the_run_goes_on():
    def breaks(volume):
        return volume.no_such_thing

    outcome = run_scenario(replace(chosen([EMPTY])[0], volume=(breaks,)))
    assert outcome.came.startswith("defect: AttributeError")
    assert not outcome.as_expected


def test_a_run_can_be_stopped():
    def stop(step, fraction):
        raise Cancelled.of("cancelled", "stopped by the user")

    with pytest.raises(Cancelled):
        run_scenario(chosen([EMPTY])[0], progress=stop)
    with pytest.raises(Cancelled):
        run_scenarios(chosen([EMPTY]), progress=stop)


@pytest.mark.parametrize(
    ("arguments", "code"), [(["--only", "s93, S93"], 0), (["--only", "S999"], 2)]
)
def test_the_command_tells_by_its_exit_code(arguments, code, tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["scenarios", *arguments, "--out", str(tmp_path / "out"), "--json", "-q"])
    assert stopped.value.code == code
    printed = json.loads(capsys.readouterr().out)
    if code == 0:
        assert printed["totals"]["scenarios"] == 1
        assert (tmp_path / "out" / "scenarios.md").is_file()
    else:
        assert printed["errors"][0]["code"] == "scenario-unknown"
        assert not (tmp_path / "out").exists()


def test_the_command_exits_with_1_if_anything_is_not_as_expected(monkeypatch, capsys):
    wrong = replace(chosen([EMPTY])[0], refusal=None)
    monkeypatch.setattr(run, "CATALOGUE", (wrong,))
    with pytest.raises(SystemExit) as stopped:
        main(["scenarios", "-q"])
    assert stopped.value.code == 1
    assert "0 of 1 simulated scenarios as expected" in capsys.readouterr().out
