"""The libraries that run in child processes, proved on the files the chain proves them on."""

from __future__ import annotations

from contextlib import closing
from typing import Any

from hexafix.errors import MissingLibrary
from hexafix.imaging.decoding import require_decoder
from hexafix.imaging.golden_image_files import READERS, ItkProof
from hexafix.imaging.golden_streams import SYNTAXES, DecoderProof, golden_stream
from hexafix.imaging.isolation import run_isolated
from hexafix.selftest.check import Check, Measure

MEMORY_BYTES, SECONDS = 2 << 30, 60.0


def image_file_checks() -> list[Check]:
    """SimpleITK on each format of one file."""
    return [
        Check(f"image files ({reader})", "SimpleITK", "every voxel in its place", _reads(reader))
        for reader in READERS
    ]


def codec_checks() -> list[Check]:
    """Pydicom and its plugins on each kind of compression that they can decode here."""
    found = []
    for syntax, name in SYNTAXES.items():
        stream = golden_stream(syntax)
        if stream is None or not _installed(syntax):
            continue
        title = f"compressed pixels ({name})"
        found.append(Check(title, stream.library, "the known pixels", _decodes(syntax)))
    return found


def _installed(transfer_syntax: str) -> bool:
    try:
        return not require_decoder(transfer_syntax)
    except MissingLibrary:
        return False


def _reads(reader: str) -> Measure:
    def measure() -> str:
        with ItkProof(reader) as proof, _child("itk", proof.request) as results:
            proof.check(results)
        return ""

    return measure


def _decodes(transfer_syntax: str) -> Measure:
    def measure() -> str:
        with (
            DecoderProof([transfer_syntax]) as proof,
            _child("decode", proof.requests) as results,
        ):
            proof.check(results)
        return ""

    return measure


def _child(task: str, arguments: list[Any]) -> Any:
    results = run_isolated(task, arguments, memory_bytes=MEMORY_BYTES, seconds=SECONDS)
    return closing(results)
