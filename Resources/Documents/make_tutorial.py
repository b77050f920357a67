"""Make the tutorial: pictures and figures from the real workstation, then the page.

``python Resources/Documents/make_tutorial.py`` makes the demo's case in a temporary folder, opens
it with ``hexafix serve``, does the ten steps in Chromium (`tutorial_run.py`), writes the pictures
and ``figures.json`` into ``images/tutorial`` and fills the figures into ``tutorial.in.md`` to make
``tutorial.md``. ``--page`` only fills the page anew after an edit of its text; ``--check`` tells
what is wrong with page, pictures and figures, and runs nothing.

A figure is read off the screen, where the reader sees it, and compared with the plan that was
downloaded; ``hexafix verify`` has recomputed that plan by another road.
"""

from __future__ import annotations

import argparse
import json
import re
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
PACKAGE = HERE.parents[1] / "HexaFixModule"
sys.path.insert(0, str(PACKAGE))

COMMAND = "python Resources/Documents/make_tutorial.py"
IMAGES = "images/tutorial"
PICTURES = (
    *("01-open", "02-balls", "03-numbers", "04-refused", "05-poses"),
    *("06-readings", "07-correction", "08-playback", "09-prescription", "10-sheet"),
)
"""One picture a step, in order."""

CONTROLS = {
    "Load the CT": "load-image",
    "Side": "limb-side",
    "Find the balls": "run-markers",
    "Add by click": "add-marker",
    "Number automatically": "number-automatically",
    "Undo": "undo",
    "Recognise the ring poses": "run-poses",
    "In the picture, the front of both rings (notch) is where their x axis points": (
        "confirm-ring-front"
    ),
    "Fragment motion": "kind-fragment-motion",
    "Landmarks": "kind-landmarks",
    "Deformity": "kind-deformity",
    "Target pose": "kind-target-pose",
    "Set the correction": "set-correction",
    "Plan": "run-schedule",
    "Play": "play",
    "Next adjustment": "play-next",
    "Show all": None,
    "Make the prescription": "run-export",
    "left": "confirm-left",
    "Next page": "page-next",
    "prescription.pdf": "download-prescription.pdf",
    "Export to a folder": "export-folder",
    "Save the case": "save-case",
    "Layout": "views-layout",
    "Plan all steps": "run-all",
}
"""Every control that the page names, in bold: its words on the screen and its data-testid, if any.
"""

WIDTH_PX = 1200
LIMIT_BYTES = 2_500_000
ALL_S = 900
"""After so many seconds everything is ended, whatever it does."""

FIGURE = re.compile(r"\d[\d.]* ?(?:mm|°|deg|days?|balls|pages|checks|HU|slices|voxels|%)")
"""A figure of a run: in the text it stands only as a name in braces."""


def shrink(raw: Path, target: Path) -> None:
    """A picture of the right width with 256 colours, as a small PNG."""
    from PIL import Image

    with Image.open(raw) as image:
        image = image.convert("RGB")
        height = round(image.height * WIDTH_PX / image.width)
        image = image.resize((WIDTH_PX, height), Image.Resampling.LANCZOS)
        image.quantize(palette=_palette(image), dither=Image.Dither.NONE).save(
            target, optimize=True
        )


def _palette(image: Any) -> Any:
    """Colours that keep also what is small: a strut's badge counts as much as a large face."""
    from PIL import Image

    held = image.getcolors(image.width * image.height)
    pixels = [colour for count, colour in held for _ in range(1 + round(count**0.6 / 2))]
    strip = Image.new("RGB", (len(pixels), 1))
    strip.putdata(pixels)
    return strip.quantize(256, Image.Quantize.MEDIANCUT, kmeans=2)


def page(folder: Path) -> str:
    """The text with its figures filled in.

    Parameters
    ----------
    folder : Path
        Holds ``tutorial.in.md`` and the pictures' folder.
    """
    text = (folder / "tutorial.in.md").read_text("utf-8")
    return text.format_map(figures(folder))


def figures(folder: Path) -> dict[str, str]:
    """The figures of the run that made the pictures."""
    return json.loads((folder / IMAGES / "figures.json").read_text("utf-8"))


def faults(folder: Path) -> list[str]:
    """What is wrong with the tutorial in a folder; nothing, if all is well.

    Parameters
    ----------
    folder : Path
        Holds ``tutorial.in.md``, ``tutorial.md`` and the pictures' folder.
    """
    raw = (folder / "tutorial.in.md").read_text("utf-8")
    text = (folder / "tutorial.md").read_text("utf-8")
    return [
        *_faults_of_figures(folder, raw, text),
        *_faults_of_pictures(folder, text),
        *_faults_of_controls(text),
        *_faults_of_commands(text),
    ]


def _faults_of_figures(folder: Path, raw: str, text: str) -> Iterator[str]:
    known = figures(folder)
    named = set(re.findall(r"\{(\w+)\}", raw))
    yield from (f"no figure {name}" for name in sorted(named - set(known)))
    yield from (f"unused figure {name}" for name in sorted(set(known) - named))
    yield from (f"figure typed by hand: {words}" for words in FIGURE.findall(_prose(raw)))
    if named <= set(known) and raw.format_map(known) != text:
        yield f"tutorial.md is not tutorial.in.md with the figures of the run: {COMMAND} --page"


def _faults_of_pictures(folder: Path, text: str) -> Iterator[str]:
    titles = [int(number) for number in re.findall(r"^## (\d+)\. ", text, re.MULTILINE)]
    if titles != list(range(1, 11)):
        yield f"not ten steps in order: {titles}"
    shown = [re.findall(r"!\[[^\]]{20,}\]\(([^)]+)\)", part) for part in _steps(text)]
    if shown != [[f"{IMAGES}/{name}.png"] for name in PICTURES]:
        yield f"not one described picture a step, in order: {shown}"
    held = sorted(path.name for path in (folder / IMAGES).iterdir())
    if held != sorted([*(f"{name}.png" for name in PICTURES), "figures.json"]):
        yield f"missing or left over in {IMAGES}: {held}"
    size = sum(path.stat().st_size for path in (folder / IMAGES).iterdir())
    if size > LIMIT_BYTES:
        yield f"{size} bytes of pictures, limit {LIMIT_BYTES}"


def _steps(text: str) -> list[str]:
    return re.split(r"^## ", re.split(r"^## (?!\d)", text, flags=re.MULTILINE)[0], flags=re.M)[1:]


def _prose(text: str) -> str:
    return re.sub(r"```.*?```", "", text, flags=re.DOTALL)


def _faults_of_controls(text: str) -> Iterator[str]:
    named = set(re.findall(r"\*\*(.+?)\*\*", _prose(text).replace("\n", " ")))
    yield from (f"no control {words!r} is known" for words in sorted(named - set(CONTROLS)))
    yield from (f"control {words!r} is not named" for words in sorted(set(CONTROLS) - named))


def _faults_of_commands(text: str) -> Iterator[str]:
    from cyclopts import CycloptsError
    from hexafix.cli.app import app

    lines = [*re.findall(r"^hexafix .*$", text, re.MULTILINE)]
    lines += re.findall(r"`(hexafix \w[^`]*)`", text)
    if not lines:
        yield "no command is named"
    for line in lines:
        try:
            app.parse_args(line.split()[1:], exit_on_error=False, print_error=False)
        except CycloptsError as error:
            yield f"{line}: {error}"
    for line in re.findall(r"python (Resources/\S+\.py[^`\n]*)", text):
        script, *options = line.split()
        known = _parser().parse_known_args(options)[1] == []
        if HERE / Path(script).name != Path(__file__).resolve() or not known:
            yield f"no such command: python {line}"


def make(folder: Path) -> None:
    """Run the tutorial; write pictures, figures and page into a folder."""
    import tutorial_run

    def stop(number: int, _: Any) -> None:
        raise SystemExit(f"stopped by signal {number}")

    for number in (signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, stop)
    signal.alarm(ALL_S)
    images = folder / IMAGES
    with tempfile.TemporaryDirectory(prefix="hexafix-tutorial-") as work:
        measured = tutorial_run.run(Path(work))
        images.mkdir(parents=True, exist_ok=True)
        for name in PICTURES:
            shrink(Path(work) / f"{name}.png", images / f"{name}.png")
    words = json.dumps(measured, indent=1, ensure_ascii=False, sort_keys=True)
    (images / "figures.json").write_text(words + "\n", "utf-8")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    only = parser.add_mutually_exclusive_group()
    only.add_argument("--page", action="store_true", help="only fill the page's text anew")
    only.add_argument("--check", action="store_true", help="only tell what is wrong")
    return parser


def main() -> int:
    """Make, fill or check."""
    wanted = _parser().parse_args()
    if not wanted.check:
        if not wanted.page:
            make(HERE)
        (HERE / "tutorial.md").write_text(page(HERE), "utf-8")
    wrong = faults(HERE)
    print("\n".join(wrong) or "the tutorial is as it should be")
    return int(bool(wrong))


if __name__ == "__main__":
    raise SystemExit(main())
