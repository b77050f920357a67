"""The scenarios command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hexafix.progress import Progress


def run_catalogue(
    only: str, *, jobs: int, out: Path | None, progress: Progress
) -> tuple[dict[str, Any], str]:
    """Run the scenarios named, write the report if a folder is given; the document and its text."""
    from hexafix.scenarios.report import report_document, report_text, write_report
    from hexafix.scenarios.run import chosen, run_scenarios

    ids = [name.strip().upper() for name in only.split(",") if name.strip()]
    outcomes = run_scenarios(chosen(ids), jobs=jobs, progress=progress)
    document = report_document(outcomes)
    if out is not None:
        write_report(document, out)
    return document, report_text(document)
