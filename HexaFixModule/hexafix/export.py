"""Writing the export folder: complete or not at all, never two writers, older results kept.

The folder is written beside its target, flushed to disk, and put in place by one rename. Where
an older export stands there, the two folders change places in one step where the system can do
that, else the older one is moved aside and comes back if anything fails.
"""

from __future__ import annotations

import contextlib
import ctypes
import datetime
import getpass
import glob
import hashlib
import json
import os
import shutil
import socket
import stat
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from hexafix.errors import InputError

MANIFEST = "manifest.json"
FILES = ("plan.json", "schedule.csv", "prescription.pdf", "markers.mrk.json")
"""What an export holds besides its manifest."""

_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


def write_export(files: Mapping[str, bytes], folder: Path, *, private: bool = False) -> None:
    """Put `files` and their manifest in place as `folder`, all or nothing.

    Parameters
    ----------
    files : mapping of str to bytes
        File names (no folders) and contents.
    folder : Path
        Target; created, or replaced if it holds an older export.
    private : bool
        Whether only the owner may enter the folder (a file names the patient); else the user's
        umask decides.

    Raises
    ------
    InputError
        If `folder` is something else than an export, cannot be written (H46), or another writer
        is at work there (H47).
    """
    folder = Path(os.path.abspath(folder))  # noqa: PTH100 - a link as target stays a link
    check_target(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with _only_writer(folder):
            _clear_leftovers(folder)
            staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}.staging-", dir=folder.parent))
            try:
                staging.chmod(0o700 if private else 0o777 & ~_umask())
                for name, content in {**files, MANIFEST: manifest(files)}.items():
                    _write_synced(staging / name, content)
                _sync_folder(staging)
                _put_in_place(staging, folder)
                _sync_folder(folder.parent)
            finally:
                shutil.rmtree(staging, ignore_errors=True)
    except OSError as error:
        raise InputError.of(
            "export-not-written",
            f"the export could not be written: {error.strerror}",
            where="--out",
            hazard="H46",
            next_step="free disk space or choose another --out; older results are unchanged",
        ) from error


def replace_file(path: Path, content: bytes) -> None:
    """Put one file in place, all or nothing, with an export's care; an older one is replaced.

    Who may read it stays as it was.

    Raises
    ------
    InputError
        If it cannot be written (H46), or another writer is at work there (H47).
    """
    path = Path(os.path.abspath(path))  # noqa: PTH100 - a link as target stays a link
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with _only_writer(path):
            for leftover in path.parent.glob(f".{glob.escape(path.name)}.staging-*"):
                leftover.unlink(missing_ok=True)
            descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.staging-", dir=path.parent)
            staging = Path(name)
            try:
                with os.fdopen(descriptor, "wb") as file:
                    file.write(content)
                    file.flush()
                    os.fsync(file.fileno())
                mode = path.stat().st_mode if path.exists() else 0o666 & ~_umask()
                staging.chmod(stat.S_IMODE(mode))
                staging.replace(path)
                _sync_folder(path.parent)
            finally:
                staging.unlink(missing_ok=True)
    except OSError as error:
        raise InputError.of(
            "file-not-written",
            f"the file could not be written: {error.strerror}",
            where="case file",
            hazard="H46",
            next_step="free disk space or choose another place; the older file is unchanged",
        ) from error


def check_target(folder: Path) -> None:
    """Refuse a target that holds anything but an older export.

    Raises
    ------
    InputError
        If it is a file, or a folder with other content.
    """
    if not folder.exists() and not folder.is_symlink():
        return
    held = {path.name for path in folder.iterdir()} if folder.is_dir() else None
    if folder.is_symlink() or held is None or (held and MANIFEST not in held):
        raise InputError.of(
            "target-not-an-export",
            "the target exists and is not an export of HexaFix; nothing there was touched",
            where="--out",
            next_step="choose another --out",
        )
    foreign = held - {*FILES, MANIFEST}
    if foreign:
        raise InputError.of(
            "target-holds-other-files",
            "the target holds files that are not part of an export and would be lost",
            value=f"{len(foreign)} files",
            where="--out",
            next_step="move them away or choose another --out",
        )


def manifest(files: Mapping[str, bytes]) -> bytes:
    """The manifest: SHA-256 of each file."""
    content = {
        "schema_version": 1,
        "kind": "hexafix-manifest",
        "sha256": {name: hashlib.sha256(files[name]).hexdigest() for name in sorted(files)},
    }
    return (json.dumps(content, indent=2) + "\n").encode()


@contextlib.contextmanager
def _only_writer(folder: Path) -> Iterator[None]:
    """Hold the target's lock file; the system frees it when the process ends, however it ends."""
    lock = folder.parent / f".{folder.name}.lock"
    # A link in the lock's place would let somebody else's file be overwritten.
    no_link = getattr(os, "O_NOFOLLOW", 0)
    descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | no_link, 0o644)
    try:
        _take_lock(descriptor, lock)
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        owner = f"{_user()} on {socket.gethostname()}, process {os.getpid()}, since {now}"
        os.ftruncate(descriptor, 0)
        os.write(descriptor, owner.encode())
        yield
        with contextlib.suppress(OSError):
            lock.unlink()
    finally:
        os.close(descriptor)


def _take_lock(descriptor: int, lock: Path) -> None:
    if sys.platform == "win32":
        import msvcrt

        def take() -> None:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        def take() -> None:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

    try:
        take()
        still_there = lock.exists() and os.fstat(descriptor).st_ino == lock.stat().st_ino
    except OSError:
        still_there = False
    if not still_there:
        with contextlib.suppress(OSError):
            owner = lock.read_text("utf-8", "replace")
            raise InputError.of(
                "another-writer",
                "another HexaFix is writing this export",
                value=owner or "starting now",
                where="--out",
                hazard="H47",
                next_step="wait until it is done",
            )
        raise InputError.of(
            "another-writer",
            "another HexaFix has just written this export",
            where="--out",
            hazard="H47",
            next_step="try again",
        )


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return "unknown user"


def _umask() -> int:
    """The user's own choice of who may read new files."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


def _clear_leftovers(folder: Path) -> None:
    """Remove what a killed writer left beside the target; called by the only writer."""
    name = glob.escape(folder.name)
    aside = sorted(folder.parent.glob(f".{name}.old-*"))
    if aside and not folder.exists():
        aside.pop().rename(folder)
    for leftover in [*aside, *folder.parent.glob(f".{name}.staging-*")]:
        shutil.rmtree(leftover, ignore_errors=True)


def _write_synced(path: Path, content: bytes) -> None:
    with path.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    if sys.platform == "win32":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _put_in_place(staging: Path, folder: Path) -> None:
    """Rename `staging` to `folder`; an older folder ends up under the staging name or aside."""
    if not folder.exists():
        staging.rename(folder)
        return
    if _exchange(staging, folder):
        return
    aside = folder.with_name(f".{folder.name}.old-{os.getpid()}")
    folder.rename(aside)
    try:
        staging.rename(folder)
    except OSError:
        aside.rename(folder)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def _exchange(one: Path, other: Path) -> bool:
    """Let two folders change names in one step; False where the system cannot."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):
        return False
    return rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE) == 0
