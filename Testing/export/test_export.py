"""The export folder appears complete or not at all."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import textwrap

import pytest
from hexafix import export
from hexafix.errors import InputError

FILES = {name: f"{name} one".encode() for name in export.FILES}
OTHER = {name: f"{name} two".encode() for name in export.FILES}


def content(folder):
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.name != export.MANIFEST}


def leftovers(folder):
    return [p.name for p in folder.parent.iterdir() if p != folder]


def test_every_file_and_a_manifest_of_their_hashes_appear(tmp_path):
    export.write_export(FILES, tmp_path / "out")
    assert content(tmp_path / "out") == FILES
    hashes = json.loads((tmp_path / "out" / export.MANIFEST).read_text())["sha256"]
    assert hashes == {n: hashlib.sha256(c).hexdigest() for n, c in FILES.items()}
    assert leftovers(tmp_path / "out") == []


def test_an_older_export_is_replaced_whole(tmp_path):
    export.write_export(FILES, tmp_path / "out")
    export.write_export(OTHER, tmp_path / "out")
    assert content(tmp_path / "out") == OTHER
    assert leftovers(tmp_path / "out") == []


def test_it_is_replaced_whole_where_the_system_cannot_exchange_names(tmp_path, monkeypatch):
    export.write_export(FILES, tmp_path / "out")
    monkeypatch.setattr(export, "_exchange", lambda *_: False)
    export.write_export(OTHER, tmp_path / "out")
    assert content(tmp_path / "out") == OTHER
    assert leftovers(tmp_path / "out") == []


def test_a_failing_disk_leaves_the_older_export_whole(tmp_path, monkeypatch):
    export.write_export(FILES, tmp_path / "out")

    def full(path, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(export, "_write_synced", full)
    with pytest.raises(InputError, match="No space left"):
        export.write_export(OTHER, tmp_path / "out")
    assert content(tmp_path / "out") == FILES
    assert [n for n in leftovers(tmp_path / "out") if not n.endswith(".lock")] == []


@pytest.mark.parametrize("kind", ["file", "foreign folder", "export with a stranger", "link"])
def test_a_target_that_is_no_export_is_refused_and_untouched(tmp_path, kind):
    target = tmp_path / "out"
    if kind == "file":
        target.write_text("mine")
    elif kind == "link":
        (tmp_path / "else").mkdir()
        target.symlink_to(tmp_path / "else")
    else:
        target.mkdir()
        (target / "thesis.txt").write_text("mine")
        if "stranger" in kind:
            (target / export.MANIFEST).write_text("{}")
    with pytest.raises(InputError, match="export"):
        export.write_export(FILES, target)
    if target.is_dir() and not target.is_symlink():
        assert (target / "thesis.txt").read_text() == "mine"


HOLDER = """
    import sys, time
    from pathlib import Path
    from hexafix import export
    with export._only_writer(Path(sys.argv[1])):
        print("held", flush=True)
        time.sleep(60)
"""


def run_child(code, *arguments):
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, arguments)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )


def test_a_second_writer_is_refused_by_name_and_time(tmp_path):
    with run_child(HOLDER, tmp_path / "out") as child:
        assert child.stdout.readline().strip() == "held"
        with pytest.raises(InputError, match=rf"process {child.pid}, since 20\d\d-") as refusal:
            export.write_export(FILES, tmp_path / "out")
        child.kill()
    assert refusal.value.faults[0].hazard == "H47"
    export.write_export(FILES, tmp_path / "out")


LOOP = """
    import sys
    from pathlib import Path
    from hexafix import export
    files = [{n: (n + tag * 20000).encode() for n in export.FILES} for tag in "ab"]
    print("go", flush=True)
    for turn in range(10**9):
        export.write_export(files[turn % 2], Path(sys.argv[1]))
"""


def test_kill_at_any_moment_leaves_the_old_or_the_new_export_complete(tmp_path):
    expected = [{n: (n + tag * 20000).encode() for n in export.FILES} for tag in "ab"]
    target = tmp_path / "out"
    export.write_export(expected[0], target)
    for turn in range(12):
        with run_child(LOOP, target) as child:
            child.stdout.readline()
            with pytest.raises(subprocess.TimeoutExpired):
                child.wait(0.02 + 0.013 * turn)
            child.send_signal(signal.SIGKILL)
        assert content(target) in expected
        hashes = json.loads((target / export.MANIFEST).read_text())["sha256"]
        assert hashes == {n: hashlib.sha256(c).hexdigest() for n, c in content(target).items()}


def test_what_a_killed_writer_left_is_cleared_or_restored(tmp_path):
    (tmp_path / ".out.staging-x").mkdir()
    export.write_export(FILES, tmp_path / "out")
    assert leftovers(tmp_path / "out") == []
    (tmp_path / "out").rename(tmp_path / ".out.old-1")
    export._clear_leftovers(tmp_path / "out")
    assert content(tmp_path / "out") == FILES
