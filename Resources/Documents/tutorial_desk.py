"""The workstation in a Chromium, as `tutorial_run.py` uses it: started, spoken to, surely ended."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parents[2] / "HexaFixModule"
CHROMIUM = "/usr/bin/chromium"
FLAGS = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)

WIDE, NARROW = {"width": 1280, "height": 800}, {"width": 1060, "height": 720}
HIGH = {"width": 1060, "height": 900}
"""Sizes of the browser's window, CSS pixels."""

SCALE = 1.2
"""Pixels of a picture for one of them."""

LONG_MS = 60_000
QUIET_MS = 1500
QUIET = """quiet => new Promise(done => {
  const end = () => { watch.disconnect(); done(); };
  let timer = setTimeout(end, quiet);
  const watch = new MutationObserver(() => {
    clearTimeout(timer);
    timer = setTimeout(end, quiet);
  });
  watch.observe(document.body,
    {subtree: true, childList: true, attributes: true, characterData: true});
})"""
"""Ends once nothing on the page, the views' pictures among it, has changed for a while."""

FITTING = """() => [...document.querySelectorAll('img.image-display-area')].every(image => {
  const box = image.parentElement.getBoundingClientRect();
  return image.naturalHeight > 0
    && Math.abs(image.naturalWidth / image.naturalHeight - box.width / box.height) < 0.02;
})"""
"""Whether the views' pictures have the size of their places."""

LAYOUTS = {
    "Axial": {"Red"},
    "Sagittal": {"Yellow"},
    "3D": {"ThreeD"},
    "Four views": {"Red", "Green", "Yellow", "ThreeD"},
}
"""Layouts of the views and the tags of those that they show."""


def hexafix(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a command of HexaFix from this checkout; it must succeed."""
    run = subprocess.run(command(*arguments), capture_output=True, text=True, env=environment())
    if run.returncode:
        raise SystemExit(f"hexafix {arguments[0]} ended with {run.returncode}: {run.stderr}")
    return run


def command(*arguments: str | Path) -> list[str]:
    """Words of a command of HexaFix."""
    return [sys.executable, "-m", "hexafix", *map(str, arguments)]


def environment() -> dict[str, str]:
    """The environment that the commands run in."""
    return {**os.environ, "PYTHONPATH": str(PACKAGE), "OPENBLAS_NUM_THREADS": "1"}


@contextmanager
def workstation(case: Path) -> Iterator[str]:
    """Address of a workstation with the case open; its process surely ends."""
    process = subprocess.Popen(
        command("serve", case, "--no-browser"),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
        env=environment(),
    )
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        if not address.startswith("http://"):
            raise SystemExit("the workstation did not start: try hexafix serve by hand")
        yield address
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()


@contextmanager
def browser_page(address: str) -> Iterator[Any]:
    """The workstation's page in a Chromium of its own."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        try:
            context = browser.new_context(
                viewport=WIDE, device_scale_factor=SCALE, accept_downloads=True
            )
            page = context.new_page()
            page.goto(address)
            yield page
        finally:
            browser.close()


class Desk:
    """The workstation in the browser, spoken to by the names of its parts.

    Attributes
    ----------
    figures : dict of str to str
        What the steps read off the screen, by the names that the page's text uses.
    """

    def __init__(self, page: Any, folder: Path) -> None:
        self.page, self.folder = page, folder
        self.figures: dict[str, str] = {}

    def at(self, name: str) -> Any:
        """The part of that data-testid."""
        return self.page.locator(f'[data-testid="{name}"]')

    def words(self, name: str) -> str:
        """What a part says on the screen."""
        return self.at(name).first.inner_text()

    def wait(self, step: str, state: str) -> None:
        """Wait until a step is in a state."""
        found = f'[data-testid="step-{step}"][data-state="{state}"]'
        self.page.wait_for_selector(found, timeout=LONG_MS)

    def open(self, step: str) -> None:
        """Open a step."""
        if not self.at(f"body-{step}").is_visible():
            self.at(f"open-{step}").click()
        self.at(f"body-{step}").wait_for(timeout=LONG_MS)

    def run(self, step: str) -> None:
        """Open a step and run it by its button."""
        self.open(step)
        self.at(f"run-{step}").click()
        self.wait(step, "done")

    def layout(self, name: str) -> None:
        """Choose a layout; it is there when its views are and the others have gone."""
        option = self.page.get_by_role("option", name=name, exact=True)
        self.at("views-layout").click()
        option.click(timeout=LONG_MS)
        option.wait_for(state="hidden")
        for tag in LAYOUTS["Four views"]:
            state = "attached" if tag in LAYOUTS[name] else "detached"
            self.at(f"over-{tag}").wait_for(state=state, timeout=LONG_MS)

    def picture(self, name: str, size: dict[str, int], top: str) -> None:
        """Picture of a window of that size with a part at the top of the panel."""
        self.page.set_viewport_size(size)
        self.at(top).evaluate("part => part.scrollIntoView({block: 'start'})")
        self.page.mouse.move(2, 2)
        self.page.evaluate("document.activeElement && document.activeElement.blur()")
        self.page.wait_for_function(FITTING, timeout=LONG_MS)
        self.page.evaluate(QUIET, QUIET_MS)
        self.at(top).evaluate("part => part.scrollIntoView({block: 'start'})")
        self.page.screenshot(path=self.folder / f"{name}.png", animations="disabled")

    def rows(self, table: str) -> list[dict[str, str]]:
        """A table as the screen shows it: each row's cells by the heads of their columns."""
        part = self.at(f"table-{table}")
        part.wait_for(state="attached", timeout=LONG_MS)
        heads = [words.strip() for words in part.locator("thead th").all_inner_texts()]
        rows = []
        for row in part.locator("tbody tr").all():
            cells = [words.strip() for words in row.locator("td").all_inner_texts()]
            if len(cells) == len(heads):
                rows.append(dict(zip(heads, cells, strict=True)))
        return rows

    def value(self, table: str, name: str) -> str:
        """The second cell of the row with that name."""
        found = [list(row.values())[1] for row in self.rows(table) if name in row.values()]
        if len(found) != 1:
            raise SystemExit(f"the table {table} has {len(found)} rows {name!r}")
        return found[0]

    def say(self, **figures: object) -> None:
        """Keep figures for the page."""
        self.figures |= {name: str(words).strip() for name, words in figures.items()}

    def read(self, part: str, **patterns: str) -> None:
        """Keep figures that a text on the screen holds."""
        words = self.words(part)
        for name, pattern in patterns.items():
            if (match := re.search(pattern, words)) is None:
                raise SystemExit(f"{part} does not hold {pattern!r}: {words!r}")
            self.say(**{name: match[1]})
