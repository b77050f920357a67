"""The export folder appears complete or not at all."""

import errno
import hashlib
import json
import os
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


def test_what_a_killed_writer_left_is_cleared_or_restored(tmp_path):
    (tmp_path / ".out.staging-x").mkdir()
    export.write_export(FILES, tmp_path / "out")
    assert leftovers(tmp_path / "out") == []
    (tmp_path / "out").rename(tmp_path / ".out.old-1")
    export._clear_leftovers(tmp_path / "out")
    assert content(tmp_path / "out") == FILES


def test_a_folder_named_with_brackets_is_cleared_and_restored_too(tmp_path):
    target = tmp_path / "case [1]*"
    export.write_export(FILES, target)
    target.rename(tmp_path / ".case [1]*.old-1")
    (tmp_path / ".case [1]*.staging-x").mkdir()
    export._clear_leftovers(target)
    assert content(target) == FILES
    assert leftovers(target) == []


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW"), reason="the system cannot refuse links")
def test_a_link_in_the_locks_place_is_not_followed(tmp_path):
    mine = tmp_path / "thesis.txt"
    mine.write_text("mine")
    (tmp_path / ".out.lock").symlink_to(mine)
    with pytest.raises(InputError, match="could not be written"):
        export.write_export(FILES, tmp_path / "out")
    assert mine.read_text() == "mine"


@pytest.mark.parametrize("older", [True, False], ids=["over an older one", "for the first time"])
@pytest.mark.parametrize("full_at", range(5))
def test_a_disk_full_in_the_middle_of_any_file_changes_nothing(
    tmp_path, monkeypatch, full_at, older
):
    if older:
        export.write_export(FILES, tmp_path / "out")
    written = []
    whole = export._write_synced

    def half(path, data):
        written.append(path)
        if len(written) <= full_at:
            return whole(path, data)
        path.write_bytes(data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(export, "_write_synced", half)
    with pytest.raises(InputError, match="No space left") as refusal:
        export.write_export(OTHER, tmp_path / "out")
    assert refusal.value.faults[0].hazard == "H46"
    assert len(written) == full_at + 1
    if older:
        assert content(tmp_path / "out") == FILES
    assert (tmp_path / "out").exists() == older
    monkeypatch.undo()
    export.write_export(OTHER, tmp_path / "out")
    assert content(tmp_path / "out") == OTHER
    assert leftovers(tmp_path / "out") == []


@pytest.mark.parametrize("call", ["mkdtemp", "open"])
def test_a_read_only_place_is_named_as_such(tmp_path, monkeypatch, call):
    def refuse(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(export.tempfile if call == "mkdtemp" else export.os, call, refuse)
    with pytest.raises(InputError, match="Read-only file system") as refusal:
        export.write_export(FILES, tmp_path / "out")
    assert refusal.value.faults[0].hazard == "H46"
    assert not (tmp_path / "out").exists()


def test_the_lock_of_a_dead_process_does_not_block(tmp_path):
    with run_child(HOLDER, tmp_path / "out") as child:
        child.stdout.readline()
        child.kill()
    assert (tmp_path / ".out.lock").read_text().count("process") == 1
    export.write_export(FILES, tmp_path / "out")
    assert content(tmp_path / "out") == FILES
    assert leftovers(tmp_path / "out") == []
