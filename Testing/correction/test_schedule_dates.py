"""Dates of the schedule are calendar dates, whatever the clocks do."""

import datetime
import time

import numpy as np
import pytest
from hexafix.correction import make_schedule
from hexafix.kinematics import strut_lengths


@pytest.mark.skipif(not hasattr(time, "tzset"), reason="the system has no tzset")
@pytest.mark.parametrize(
    ("zone", "start"),
    [
        ("Europe/Berlin", datetime.date(2026, 10, 20)),
        ("Europe/Berlin", datetime.date(2027, 3, 24)),
        ("America/New_York", datetime.date(2026, 10, 28)),
        ("Pacific/Apia", datetime.date(2028, 2, 26)),
    ],
)
def test_dates_do_not_depend_on_the_time_zone(
    zone, start, rules, fixator, pose, path_of, monkeypatch
):
    path = path_of(pose(), pose((6.0, -3.0, 191.0), (3.0, -2.0, 4.0)))
    readings = np.round(strut_lengths(path.start, fixator), 3)
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    try:
        plan = rules(start_date=start)
        schedule = make_schedule(path, fixator, plan, readings_mm=readings)
    finally:
        monkeypatch.undo()
        time.tzset()
    assert schedule.days > 5
    for row in schedule.rows[1:]:
        assert row.date == start + datetime.timedelta(days=row.day - 1)
