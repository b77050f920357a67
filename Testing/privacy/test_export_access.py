"""Who may read an export: the user's umask decides, an identified one is its owner's alone."""

import os
import stat

import pytest
from hexafix.export import FILES, write_export

CONTENT = dict.fromkeys(FILES, b"content")


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.fixture
def umask():
    """Sets the process's umask and puts the old one back."""
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


@pytest.mark.parametrize(("mask", "folder", "file"), [(0o022, 0o755, 0o644), (0o077, 0o700, 0o600),
                                                      (0o027, 0o750, 0o640)])  # fmt: skip
def test_an_export_is_readable_to_whom_the_umask_allows(mask, folder, file, umask, tmp_path):
    umask(mask)
    write_export(CONTENT, tmp_path / "export")
    assert mode(tmp_path / "export") == folder
    assert {mode(path) for path in (tmp_path / "export").iterdir()} == {file}
    assert umask(mask) == mask


def test_an_export_that_names_the_patient_is_entered_by_its_owner_only(umask, tmp_path):
    umask(0o022)
    write_export(CONTENT, tmp_path / "export", private=True)
    assert mode(tmp_path / "export") == 0o700


def test_an_identified_export_closes_the_folder_of_an_older_one(umask, tmp_path):
    umask(0o022)
    write_export(CONTENT, tmp_path / "export")
    write_export(CONTENT, tmp_path / "export", private=True)
    assert mode(tmp_path / "export") == 0o700
