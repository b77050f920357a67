"""A writer killed anywhere leaves the older export or the new one, complete, and blocks nobody."""

import hashlib
import json
import os
import random
import signal
import sys
import time

import pytest
from hexafix import export

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="the system cannot fork")

FILES = {name: (name + "a" * 20_000).encode() for name in export.FILES}
OTHER = {name: (name + "b" * 20_000).encode() for name in export.FILES}
POINTS = 60
"""Places to be killed at, for each of a first export and one over an older one."""


def in_child(work):
    """The process id of a child that does `work` and ends without any clearing up."""
    child = os.fork()
    if child:
        return child
    try:
        work()
    finally:
        os._exit(0)


def killed_at_call(number, files, target):
    """Whether a child that writes `files` reached its call number `number`, where it is killed.

    Every call of a Python or C function and every return of one counts, so that there is a place
    before and behind each write, flush, rename and removal.
    """

    def work():
        left = number

        def count(*_):
            nonlocal left
            left -= 1
            if left == 0:
                os.kill(os.getpid(), signal.SIGKILL)

        sys.setprofile(count)
        export.write_export(files, target)
        sys.setprofile(None)

    _, status = os.waitpid(in_child(work), 0)
    return os.WIFSIGNALED(status)


def calls_of_an_export(target):
    """How many such places an export has."""
    calls = 0

    def count(*_):
        nonlocal calls
        calls += 1

    sys.setprofile(count)
    try:
        export.write_export(FILES, target)
    finally:
        sys.setprofile(None)
    return calls


def content(folder):
    """Files of an export that its own manifest vouches for."""
    files = {p.name: p.read_bytes() for p in folder.iterdir() if p.name != export.MANIFEST}
    hashes = json.loads((folder / export.MANIFEST).read_text())["sha256"]
    assert hashes == {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    return files


def assert_next_export_works(target):
    export.write_export(FILES, target)
    assert content(target) == FILES
    assert [path.name for path in target.parent.iterdir()] == [target.name]


@pytest.mark.parametrize("older", [True, False], ids=["over-an-older-one", "for-the-first-time"])
def test_killed_at_any_call_it_is_old_or_new_and_the_next_one_works(tmp_path, older):
    target = tmp_path / "out"
    if older:
        export.write_export(FILES, target)
    calls = calls_of_an_export(target)
    rng = random.Random(46)
    places = rng.sample(range(1, calls + 1), POINTS)
    seen = set()
    for number in places:
        if not older:
            for path in target.iterdir():
                path.unlink()
            target.rmdir()
        assert killed_at_call(number, OTHER, target)
        if target.exists():
            found = content(target)
            assert found == OTHER or (older and found == FILES)
            seen.add("new" if found == OTHER else "old")
        else:
            assert not older
            seen.add("none")
        assert_next_export_works(target)
    assert seen == ({"old", "new"} if older else {"none", "new"})


def test_killed_at_any_time_within_large_writes_it_is_old_or_new(tmp_path):
    target = tmp_path / "out"
    large = {name: os.urandom(1 << 20) for name in export.FILES}
    export.write_export(FILES, target)
    rng = random.Random(47)
    for _ in range(20):
        child = in_child(lambda: export.write_export(large, target))
        time.sleep(rng.uniform(0.0, 0.02))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        assert content(target) in (FILES, large)
        assert_next_export_works(target)


def test_where_names_cannot_be_exchanged_the_older_one_comes_back(tmp_path, monkeypatch):
    monkeypatch.setattr(export, "_exchange", lambda *_: False)
    target = tmp_path / "out"
    export.write_export(FILES, target)
    calls = calls_of_an_export(target)
    missing = 0
    for number in random.Random(48).sample(range(1, calls + 1), POINTS):
        assert killed_at_call(number, OTHER, target)
        if not target.exists():
            # The one moment in which neither stands there: the older one lies beside, complete.
            missing += 1
            (aside,) = tmp_path.glob(".out.old-*")
            assert content(aside) == FILES
            export._clear_leftovers(target)
        assert content(target) in (FILES, OTHER)
        assert_next_export_works(target)
    assert missing < POINTS // 4


def test_killed_while_clearing_up_after_a_killed_one_nothing_is_lost(tmp_path):
    target = tmp_path / "out"
    export.write_export(FILES, target)
    rng = random.Random(49)
    for _ in range(10):
        for _ in range(3):
            killed_at_call(rng.randrange(1, 400), OTHER, target)
        assert content(target) in (FILES, OTHER)
        assert_next_export_works(target)
