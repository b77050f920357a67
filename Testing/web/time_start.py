"""Time the workstation's start as a user sees it, in a real Chromium.

    python Testing/web/time_start.py CASE [TIMES]

Prints, for each start and as median, the seconds from the command to the page, to the first picture
of the CT, and to the first slice view with more than six shades of grey. Chromium runs already.
"""

import json
import os
import signal
import statistics
import subprocess
import sys
import time
from pathlib import Path

from playwright.sync_api import sync_playwright

CHROMIUM = "/usr/bin/chromium"
FLAGS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
LONG_MS = 120_000

FIRST = "() => document.querySelector('#hexafix-starting-image')?.naturalWidth > 100"
SHADES = Path(__file__).with_name("shades.js").read_text("utf-8").partition("\n")[2].strip()
VIEWS = f"() => ({SHADES})().some(shades => shades > 6)"


def one_start(browser, case):
    """Seconds to page, first picture and views."""
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    page, began = context.new_page(), time.perf_counter()
    server = subprocess.Popen(
        [sys.executable, "-m", "hexafix", "serve", case, "--no-browser"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        seconds = {}
        page.goto(server.stdout.readline().strip(), timeout=LONG_MS)
        seconds["page_s"] = time.perf_counter() - began
        for name, shown in (("first_picture_s", FIRST), ("views_s", VIEWS)):
            page.wait_for_function(shown, timeout=LONG_MS, polling=30)
            seconds[name] = time.perf_counter() - began
        return {name: round(value, 2) for name, value in seconds.items()}
    finally:
        server.send_signal(signal.SIGINT)
        server.wait(30)
        context.close()


def main(case, times):
    """Print every start and the medians as JSON."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        starts = [one_start(browser, case) for _ in range(times)]
        browser.close()
    median = {name: statistics.median(start[name] for start in starts) for name in starts[0]}
    print(json.dumps({"starts": starts, "median": median, "cores": os.cpu_count()}, indent=2))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5)
