"""Asked a second time before an export: side (H37), readings (H24), rings' front (H22)."""

import pytest
from hexafix.case import load_case
from hexafix.errors import InputError
from hexafix.presenter import Step

AGAIN = [180.0, 174.5, 167.0, 168.0, 157.0, 181.5]


@pytest.fixture
def a_computed(a_presenter):
    a_presenter.run_all()
    return a_presenter


def refused(presenter):
    return [banner for banner in presenter.snapshot.banners if banner.kind == "refused"]


def test_without_the_side_said_twice_nothing_is_exported(a_computed, tmp_path, codes):
    assert a_computed.snapshot.export_blocked_by == "say the side of the limb a second time"
    assert "side-to-confirm" in codes(a_computed)
    assert not a_computed.export(tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert a_computed.confirm_side("left")
    assert a_computed.snapshot.confirmed["side"]
    assert a_computed.export(tmp_path / "out")


def test_another_side_is_a_conflict_that_stays_until_it_is_resolved(a_computed):
    a_computed.confirm_side("right")
    a_computed.go_to(Step.EXPORT)
    (banner,) = refused(a_computed)
    assert (banner.code, banner.hazard, banner.step) == ("side-not-confirmed", "H37", Step.LOAD)
    assert banner.next_step
    assert not a_computed.snapshot.can_export
    a_computed.set_limb(side="right")
    assert not refused(a_computed)
    assert a_computed.snapshot.confirmed["side"]


def test_a_side_changed_after_it_was_confirmed_is_asked_again(a_computed):
    a_computed.confirm_side("left")
    a_computed.set_limb(side="right")
    a_computed.run_all()
    assert not a_computed.snapshot.confirmed["side"]
    assert not a_computed.snapshot.can_export


def test_another_ct_asks_for_the_side_again(a_computed, tmp_path):
    a_computed.confirm_side("left")
    (tmp_path / "other.txt").write_text("another patient")
    a_computed.load_image(tmp_path / "other.txt")
    a_computed.run_all()
    assert a_computed.snapshot.export_blocked_by == "say the side of the limb a second time"


def test_a_case_opened_anew_asks_for_the_side_again(a_planned, a_case_file):
    a_planned.open_case(a_case_file)
    a_planned.run_all()
    assert not a_planned.snapshot.confirmed["side"]


def test_readings_of_a_file_are_not_asked_twice(a_planned):
    confirmed = a_planned.snapshot.confirmed
    assert not confirmed["readings_needed"]
    assert confirmed["readings"]


def test_a_reading_typed_here_blocks_the_export_until_it_is_repeated(a_planned, tmp_path, codes):
    a_planned.set_reading(2, 174.5)
    a_planned.run_all()
    assert a_planned.snapshot.confirmed["readings_needed"]
    assert "second time" in a_planned.snapshot.export_blocked_by
    assert "readings-to-repeat" in codes(a_planned)
    assert not a_planned.export(tmp_path / "out")
    assert a_planned.repeat_readings(AGAIN)
    assert a_planned.snapshot.can_export
    assert a_planned.export(tmp_path / "out")


def test_two_readings_that_differ_are_told_strut_by_strut_and_none_is_taken(a_planned):
    a_planned.set_reading(2, 174.5)
    a_planned.run_all()
    before = a_planned.version.raw
    a_planned.repeat_readings([180.0, 147.5, 167.0, 168.0, 157.0, 185.1])
    banners = refused(a_planned)
    assert [banner.code for banner in banners] == ["reading-not-repeated"] * 2
    assert "strut 2 differ (value 147.500 mm, limit 174.500 mm)" in banners[0].message
    assert {banner.hazard for banner in banners} == {"H24"}
    assert a_planned.version.raw == before
    assert not a_planned.snapshot.can_export


def test_a_reading_changed_after_it_was_repeated_is_asked_again(a_planned):
    a_planned.set_reading(2, 174.5)
    a_planned.repeat_readings(AGAIN)
    assert a_planned.snapshot.confirmed["readings"]
    a_planned.set_reading(2, 175.5)
    a_planned.run_all()
    assert not a_planned.snapshot.confirmed["readings"]
    assert not a_planned.snapshot.can_export


def test_readings_typed_back_to_those_of_the_file_need_no_second_entry(a_planned):
    a_planned.set_reading(2, 174.5)
    a_planned.undo()
    assert a_planned.snapshot.can_export


def test_readings_saved_before_they_were_repeated_stay_asked_for(a_planned, tmp_path):
    a_planned.set_reading(2, 174.5)
    a_planned.save_case()
    a_planned.run_all()
    assert a_planned.snapshot.confirmed["readings_needed"]
    assert not a_planned.snapshot.can_export


def test_readings_typed_once_and_saved_are_asked_for_when_the_case_is_opened_again(
    a_planned, make_presenter, an_engine, tmp_path
):
    a_planned.set_reading(2, 174.5)
    assert a_planned.save_case()
    assert not a_planned.snapshot.edited
    again = make_presenter(engine=an_engine, threaded=False)
    assert again.open_case(a_planned.case_path)
    assert not again.snapshot.edited
    again.run_all()
    again.confirm_side("left")
    assert again.snapshot.confirmed["readings_needed"]
    assert "second time" in again.snapshot.export_blocked_by
    assert not again.export(tmp_path / "out")
    again.repeat_readings(AGAIN)
    assert again.export(tmp_path / "out")


def test_no_door_plans_a_file_whose_readings_were_typed_once(a_planned):
    a_planned.set_reading(2, 174.5)
    a_planned.save_case()
    with pytest.raises(InputError) as error:
        load_case(a_planned.case_path)
    (fault,) = error.value.faults
    assert (fault.code, fault.hazard) == ("readings-to-repeat", "H24")
    assert load_case(a_planned.case_path, plannable=False).strut_readings_mm[1] == 174.5
    a_planned.repeat_readings(AGAIN)
    assert a_planned.snapshot.edited
    a_planned.save_case()
    assert a_planned.case_path.read_bytes() == a_planned.version.raw
    load_case(a_planned.case_path)


def test_a_file_whose_readings_were_repeated_is_opened_as_settled(
    a_planned, make_presenter, an_engine
):
    a_planned.set_reading(2, 174.5)
    a_planned.repeat_readings(AGAIN)
    a_planned.save_case()
    again = make_presenter(engine=an_engine, threaded=False)
    again.open_case(a_planned.case_path)
    assert not again.snapshot.confirmed["readings_needed"]


def test_readings_of_a_new_case_are_asked_twice(make_presenter, an_engine):
    presenter = make_presenter(engine=an_engine, threaded=False)
    presenter.set_readings([180.0] * 6)
    assert presenter.snapshot.confirmed["readings_needed"]
    assert not presenter.snapshot.confirmed["readings"]


@pytest.mark.parametrize("values", [[180.0] * 5, [180.0] * 7, []])
def test_a_second_entry_of_other_than_six_readings_is_refused(values, a_planned, codes):
    assert not a_planned.repeat_readings(values)
    assert codes(a_planned)[0] == "six-readings"


def test_the_rings_front_is_asked_for_where_the_case_holds_it(a_planned, codes):
    assert not a_planned.snapshot.confirmed["ring_front_needed"]
    a_planned.confirm_ring_front(False)
    a_planned.run_all()
    assert "front of both rings" in a_planned.snapshot.export_blocked_by
    assert "ring-front-to-confirm" in codes(a_planned)
    a_planned.confirm_ring_front(True)
    a_planned.run_all()
    assert a_planned.snapshot.can_export
    assert a_planned.snapshot.document["schema_version"] == 2


def test_a_new_case_asks_for_the_rings_front(make_presenter, an_engine):
    confirmed = make_presenter(engine=an_engine).snapshot.confirmed
    assert confirmed["ring_front_needed"]
    assert not confirmed["ring_front"]


def test_a_doubtful_reading_is_a_warning_with_its_strut(a_planned, an_engine, monkeypatch):
    good = an_engine.weigh_document

    def doubtful(case, recognised):
        document = good(case, recognised)
        document["struts"][2] |= {"difference_mm": -1.25, "verdict": "read-again"}
        return document

    monkeypatch.setattr(an_engine, "weigh_document", doubtful)
    a_planned.set_reading(2, 174.5)
    (banner,) = (b for b in a_planned.snapshot.banners if b.kind == "warning")
    assert (banner.code, banner.hazard, banner.step) == ("reading-doubtful", "H24", Step.READINGS)
    assert "strut 3 by the CT differs from its reading (value -1.250 mm)" in banner.message
    assert a_planned.snapshot.view(Step.READINGS).summary == "read again: strut 3"
    assert a_planned.snapshot.view(Step.READINGS).state == "done"
