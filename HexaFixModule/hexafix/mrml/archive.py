"""The scene bundle as an archive: written whole or not at all, unpacked only if nothing is wrong.

Python's own extraction drops what it does not like of a name and goes on; here one wrong entry
refuses the whole bundle (H48).
"""

from __future__ import annotations

import contextlib
import os
import stat
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from hexafix.errors import Fault, InputError, Refused
from hexafix.progress import Progress, silent

MAX_RATIO = 100
"""An entry may inflate to so many times its packed size, and so may all together."""

MAX_TOTAL_BYTES = 4 * 1024**3
"""All entries together, unpacked."""

MAX_ENTRIES = 20_000

SMALL_BYTES = 64 * 1024
"""Below this an entry's ratio says nothing: a short text of spaces packs well, too."""

MAX_NAME = 200

IMAGE = ".nrrd"
"""Ending of an image, whose voxels are packed inside its own file."""

_BLOCK = 1 << 20
_LEVEL = 1
"""Of the packing: a CT is mostly noise, and more time makes it no smaller."""

_GZIP = 31
"""zlib's name for a gzip stream; it holds no time and no name."""

_END_RECORD = struct.Struct("<4s4H2LH")
_DATE = (1980, 1, 1, 0, 0, 0)
"""Of every entry: when a scene was saved tells nothing, and the same scene packs the same."""

_DEFLATED = zipfile.ZIP_DEFLATED
_METHODS = (zipfile.ZIP_STORED, _DEFLATED)
NEXT_STEP = "open only bundles that HexaFix saved, and that came a way you trust"


def pack(folder: Path, target: Path, *, progress: Progress = silent) -> None:
    """Write everything below `folder` as the archive `target`, all or nothing (H46).

    Parameters
    ----------
    folder : Path
        Its images are packed in place first: noise shrinks once, and an image of air alone, packed
        twice, would unpack like an attack (H48).
    target : Path
    progress : Progress, optional

    Raises
    ------
    InputError
        If it cannot be written; an older file is left as it was.
    """
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    beside: Path | None = None
    try:
        for path in files:
            if path.suffix == IMAGE:
                _pack_image(path, progress)
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        beside = Path(name)
        with os.fdopen(handle, "wb") as stream:
            _write_entries(stream, folder, files)
            stream.flush()
            os.fsync(stream.fileno())
        beside.replace(target)
    except (OSError, zipfile.LargeZipFile) as error:
        raise not_written(getattr(error, "strerror", None) or str(error)) from error
    finally:
        if beside is not None:
            with contextlib.suppress(OSError):
                beside.unlink(missing_ok=True)


def not_written(why: str) -> InputError:
    """H46: nothing was written, and an older bundle is as it was."""
    return InputError.of(
        "bundle-not-written",
        f"the scene bundle could not be written: {why}",
        hazard="H46",
        next_step="free disk space or choose another file; an older one is unchanged",
    )


def _write_entries(stream: BinaryIO, folder: Path, files: list[Path]) -> None:
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, allowZip64=False) as archive:
        for path in files:
            entry = zipfile.ZipInfo(path.relative_to(folder).as_posix(), _DATE)
            entry.compress_type = zipfile.ZIP_STORED if path.suffix == IMAGE else _DEFLATED
            entry.external_attr = (stat.S_IFREG | 0o644) << 16
            archive.writestr(entry, path.read_bytes(), compresslevel=1)


def _pack_image(path: Path, progress: Progress) -> None:
    """Pack the voxels of an image as it was written plain; the same ones pack the same.

    Block by block, so that other threads go on and the user can stop it.
    """
    packed = path.with_suffix(".packed")
    size, packer = path.stat().st_size, zlib.compressobj(_LEVEL, wbits=_GZIP)
    with path.open("rb") as plain, packed.open("wb") as file:
        while (line := plain.readline()) not in (b"\n", b"\r\n", b""):
            file.write(b"encoding: gzip\n" if line.rstrip() == b"encoding: raw" else line)
        file.write(b"\n")
        while block := plain.read(_BLOCK):
            file.write(packer.compress(block))
            progress("pack the CT", plain.tell() / size)
        file.write(packer.flush())
    packed.replace(path)


def unpack(source: Path, folder: Path) -> list[PurePosixPath]:
    """Write the entries of an archive below `folder`, after all of them were checked.

    Parameters
    ----------
    source : Path
    folder : Path
        Empty, and thrown away by the caller if this fails.

    Returns
    -------
    list of PurePosixPath
        The files, relative to `folder`.

    Raises
    ------
    InputError
        If the file cannot be read or is no archive.
    Refused
        If an entry leaves the folder, is no plain file, or unpacks beyond reason (H48).
    """
    with _opened(source) as archive:
        entries = archive.infolist()
        faults = [*_count_faults(entries), *_name_faults(entries), *_size_faults(entries)]
        if faults:
            raise Refused(*faults)
        files = [entry for entry in entries if not entry.is_dir()]
        for entry in files:
            _extract(archive, entry, folder / entry.filename)
    return [PurePosixPath(entry.filename) for entry in files]


@contextlib.contextmanager
def _opened(source: Path) -> Iterator[zipfile.ZipFile]:
    """The archive; whatever its parser raises becomes one refusal without the path (H51)."""
    try:
        if not source.is_file():
            raise InputError.of(
                "bundle-unreadable", "there is no scene bundle at this path", next_step="check it"
            )
        _require_small_directory(source)
        with zipfile.ZipFile(source) as archive:
            yield archive
    except (OSError, zipfile.BadZipFile, zlib.error, NotImplementedError, EOFError) as error:
        raise InputError.of(
            "bundle-unreadable",
            f"the file is no scene bundle, or damaged: {type(error).__name__}",
            hazard="H48",
            next_step="copy or save the bundle again",
        ) from error


def _require_small_directory(source: Path) -> None:
    """Refuse a table of contents too long to be read into memory at all."""
    size = source.stat().st_size
    with source.open("rb") as file:
        file.seek(max(0, size - 65_557))
        tail = file.read()
    at = tail.rfind(b"PK\x05\x06")
    if at < 0 or len(tail) - at < _END_RECORD.size:
        raise zipfile.BadZipFile("no end record")
    record = _END_RECORD.unpack_from(tail, at)
    length, limit = record[5], MAX_ENTRIES * (46 + MAX_NAME)
    if length > limit:
        raise Refused(_too_large("bytes of its table of contents", str(length), str(limit)))


def _count_faults(entries: list[zipfile.ZipInfo]) -> list[Fault]:
    if len(entries) <= MAX_ENTRIES:
        return []
    return [_too_large("entries", str(len(entries)), str(MAX_ENTRIES))]


def _name_faults(entries: list[zipfile.ZipInfo]) -> list[Fault]:
    """Names that lead out of the folder, name two files, or stand for no plain file."""
    faults, seen = [], set()
    for entry in entries:
        # The parser cuts a name at a zero; the other one is what was written.
        for name in {entry.filename, entry.orig_filename}:
            if not _plain(name):
                faults.append(_fault("bundle-path", "an entry's name leads out of the bundle"))
        folded = entry.filename.rstrip("/").casefold()
        if folded in seen:
            faults.append(_fault("bundle-path", "two entries have one name"))
        seen.add(folded)
        kind = stat.S_IFMT(entry.external_attr >> 16)
        if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
            faults.append(_fault("bundle-link", "an entry is a link or a device, not a file"))
        if entry.flag_bits & 0x1 or entry.compress_type not in _METHODS:
            faults.append(_fault("bundle-unreadable", "an entry is encrypted or packed unusually"))
    return list(dict.fromkeys(faults))


def _plain(name: str) -> bool:
    """Whether a name stays below its folder on every system."""
    if not name or len(name) > MAX_NAME or not name.isprintable():
        return False
    if any(sign in name for sign in '\\:*?"<>|') or name.startswith("/"):
        return False
    parts = name.rstrip("/").split("/")
    return all(part not in ("", ".", "..") and part == part.strip(" .") for part in parts)


def _size_faults(entries: list[zipfile.ZipInfo]) -> list[Fault]:
    """Sizes as the table of contents states them; no entry is unpacked further."""
    faults = []
    total = sum(entry.file_size for entry in entries)
    packed = sum(entry.compress_size for entry in entries)
    if total > MAX_TOTAL_BYTES:
        faults.append(_too_large("bytes unpacked", str(total), str(MAX_TOTAL_BYTES)))
    pairs = [(entry.file_size, entry.compress_size) for entry in entries]
    worst = max(
        (size / max(1, small) for size, small in [*pairs, (total, packed)] if size > SMALL_BYTES),
        default=0.0,
    )
    if worst > MAX_RATIO:
        faults.append(_too_large("unpacked over packed size", f"{worst:.0f}", str(MAX_RATIO)))
    ends = sorted((entry.header_offset, entry.compress_size) for entry in entries)
    if any(a + size > b for (a, size), (b, _) in pairwise(ends)):
        faults.append(_fault("bundle-too-large", "entries share their packed bytes"))
    return faults


def _extract(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, target: Path) -> None:
    """Unpack one entry; its parser reads no more than is stated, and compares the checksum."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with archive.open(entry) as packed, target.open("xb") as file:
        while block := packed.read(_BLOCK):
            file.write(block)


def _too_large(what: str, value: str, limit: str) -> Fault:
    return Fault(
        "bundle-too-large",
        f"the scene bundle unpacks beyond reason: {what}",
        value=value,
        limit=limit,
        hazard="H48",
        next_step=NEXT_STEP,
    )


def _fault(code: str, what: str) -> Fault:
    return Fault(code, what, hazard="H48", next_step=NEXT_STEP)
