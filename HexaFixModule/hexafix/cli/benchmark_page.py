"""``hexafix benchmark --page``: HexaFix beside other tools, as a page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hexafix.cli.console import print_json, progress_bar


def make_page(
    names: Sequence[str], folder: Path, *, quick: bool, seed: int, json: bool, quiet: bool
) -> int:
    """Measure, write the page, print where it is; 1 if a control was not told apart."""
    from hexafix.benchmark.comparison import compare
    from hexafix.comparison.page import page, write_page
    from hexafix.study.plotting import require_matplotlib

    require_matplotlib()
    with progress_bar(quiet=quiet) as progress:
        document = compare(names, quick=quick, seed=seed, progress=progress)
        written = write_page(document, folder)
    if json:
        print_json(document)
    else:
        print(page(document))
        print(f"{len(written)} files in {folder}")
    return 0 if all(control["told_apart"] for control in document["controls"]) else 1
