"""A decoder that dies, hangs or eats memory costs a child process, never the program."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.errors import ImageRefused, Refused
from hexafix.imaging import decoding, isolation, read_volume
from hexafix.imaging.isolation import run_isolated
from pydicom.uid import RLELossless

GIGABYTE = 1 << 30


def stand_in(monkeypatch, tmp_path, body):
    """Lets the child run `body` instead of the worker."""
    script = tmp_path / "stand_in.py"
    script.write_text(body)
    popen = isolation.subprocess.Popen

    def start(command, **options):
        return popen([command[0], str(script)], **options)

    monkeypatch.setattr(isolation.subprocess, "Popen", start)


def first_result(**limits):
    options = {"memory_bytes": 4 * GIGABYTE, "seconds": 30.0} | limits
    with closing(run_isolated("decode", [], **options)) as results:
        return next(results)


def refusal(**limits):
    with pytest.raises(ImageRefused) as caught:
        first_result(**limits)
    (fault,) = caught.value.faults
    return fault.code, fault.hazard


def test_a_crash_is_a_refusal(monkeypatch, tmp_path):
    stand_in(monkeypatch, tmp_path, "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    assert refusal() == ("decoder-died", "H52")


def test_a_hang_ends_at_the_time_limit(monkeypatch, tmp_path):
    stand_in(monkeypatch, tmp_path, "import time; time.sleep(600)")
    assert refusal(seconds=0.5) == ("decoder-died", "H52")


def test_the_time_limit_is_for_each_result_and_not_for_all(monkeypatch, tmp_path):
    head = json.dumps({"shape": [1], "dtype": "|u1"})
    body = f"""
import sys, time
for turn in range(5):
    time.sleep(0.6)
    sys.stdout.write({head!r} + "\\nx"); sys.stdout.flush()
"""
    stand_in(monkeypatch, tmp_path, body)
    with closing(run_isolated("decode", [], memory_bytes=GIGABYTE, seconds=2.5)) as results:
        assert len(list(results)) == 5


def test_what_the_caller_does_between_results_is_not_counted(monkeypatch, tmp_path):
    head = json.dumps({"shape": [1], "dtype": "|u1"})
    body = f"""
import sys
sys.stdout.write(({head!r} + "\\nx") * 2); sys.stdout.flush()
"""
    stand_in(monkeypatch, tmp_path, body)
    with closing(run_isolated("decode", [], memory_bytes=GIGABYTE, seconds=2.0)) as results:
        next(results)
        time.sleep(2.5)
        next(results)


@pytest.mark.parametrize(
    "line",
    ["no json", "[]", '{"shape": [-1, 4], "dtype": "<i2"}', '{"shape": [1], "dtype": "O"}',
     '{"shape": ["x"], "dtype": "<i2"}', '{"shape": [4]}', "x" * (1 << 21)],
    ids=["text", "list", "negative", "objects", "words", "short", "endless"],
)  # fmt: skip
def test_an_answer_that_is_none_is_a_refusal(monkeypatch, tmp_path, line):
    stand_in(monkeypatch, tmp_path, f"print({line!r})")
    assert refusal() == ("decoder-died", "H52")


def test_a_result_cut_short_is_a_refusal(monkeypatch, tmp_path):
    head = json.dumps({"shape": [4, 4], "dtype": "<i2"})
    stand_in(monkeypatch, tmp_path, f"print({head!r}); print('short', end='')")
    assert refusal() == ("decoder-died", "H52")


def test_a_result_beyond_the_limit_is_not_taken(monkeypatch, tmp_path):
    head = json.dumps({"shape": [100, 100], "dtype": "<i2"})
    stand_in(monkeypatch, tmp_path, f"print({head!r}); print('x' * 30000)")
    assert refusal(memory_bytes=10_000) == ("decoder-died", "H52")


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="the system enforces no address limit")
def test_memory_beyond_the_limit_is_refused(tmp_path, writer, grid, monkeypatch):
    items = writer.slices(grid)
    writer.save(tmp_path, items)
    for item in items:
        item.compress(RLELossless)
    folder = writer.save(tmp_path, items, syntax=RLELossless)
    assert read_volume(folder).size_ijk == (7, 6, 5)
    monkeypatch.setattr(decoding, "_BASE_MEMORY", 100 << 20)
    with pytest.raises(Refused) as caught:
        read_volume(folder)
    # the known pixels that the child decodes first are what it dies of
    assert {fault.hazard for fault in caught.value.faults} == {"H54"}


def test_the_reader_of_image_files_runs_outside_this_process(tmp_path, grid, coded_image):
    path = tmp_path / "image.nrrd"
    sitk.WriteImage(coded_image(grid), str(path))
    program = f"""
import sys
from hexafix.imaging import read_volume
assert read_volume({str(path)!r}).size_ijk == (7, 6, 5)
assert "SimpleITK" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


def test_leaving_early_ends_the_child(monkeypatch, tmp_path):
    mark = tmp_path / "alive"
    head = json.dumps({"shape": [1], "dtype": "|u1"})
    body = f"""
import sys, time, pathlib
sys.stdout.write({head!r} + "\\nx"); sys.stdout.flush()
time.sleep(1.0)
pathlib.Path({str(mark)!r}).touch()
"""
    stand_in(monkeypatch, tmp_path, body)
    assert first_result()[1].tolist() == [ord("x")]
    time.sleep(1.2)
    assert not mark.exists()


def test_the_byte_that_kills_simpleitk_does_not_kill_the_program(ct_corpus):
    path = ct_corpus / "crasher/sitk257_segfault_one_byte.dcm"
    arguments = [str(path), "GDCMImageIO"]
    options = {"memory_bytes": 4 * GIGABYTE, "seconds": 60.0}
    results = run_isolated("itk", arguments, **options)
    with closing(results), pytest.raises(ImageRefused) as caught:
        next(results)
    assert caught.value.faults[0].hazard == "H52"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="pipes have a size on Linux only")
def test_a_user_whose_pipes_may_not_grow_gets_his_result_too(monkeypatch, tmp_path):
    import fcntl

    asked = []

    def refuse(_, what, size):
        asked.append((what, size))
        raise PermissionError("pipe-user-pages-soft")

    monkeypatch.setattr(fcntl, "fcntl", refuse)
    head = json.dumps({"shape": [3], "dtype": "|u1"})
    body = f"import sys; sys.stdin.read(); sys.stdout.write({head!r} + chr(10) + 'abc')"
    stand_in(monkeypatch, tmp_path, body)
    _, array = first_result()
    assert array.tobytes() == b"abc"
    assert asked == [(fcntl.F_SETPIPE_SZ, 1 << 20)]
