"""The ten steps of the tutorial, done in the real workstation: pictures and figures.

`make_tutorial.py` is the command; this is what it does in Chromium, as a user would, by the names
of the parts on the page. Nothing waits for a time: a step ends when the page says so, and a
picture is taken once nothing on the page changes any more.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from tutorial_desk import (
    HIGH,
    LONG_MS,
    NARROW,
    PACKAGE,
    WIDE,
    Desk,
    browser_page,
    hexafix,
    workstation,
)

FILES = ("prescription.pdf", "schedule.csv", "plan.json", "markers.mrk.json", "manifest.json")


def open_the_case(desk: Desk) -> None:
    """1: the case is open and its CT is read."""
    desk.wait("load", "done")
    desk.open("load")
    desk.say(size=desk.value("image", "Size"), spacing=desk.value("image", "Spacing"))
    desk.picture("01-open", WIDE, "step-load")


def find_the_balls(desk: Desk) -> None:
    """2: find the balls and look at one of them."""
    desk.run("markers")
    desk.wait("numbering", "done")
    balls = desk.rows("balls")
    diameters = [float(row["Diameter mm"]) for row in balls]
    desk.say(
        balls=len(balls),
        diameter_min=f"{min(diameters):.3f}",
        diameter_max=f"{max(diameters):.3f}",
    )
    desk.read("rejected-summary", rejected=r"^(\d+) places")
    desk.layout("Axial")
    desk.at(f"balls-{row_of(1, balls)}").click()
    desk.picture("02-balls", NARROW, "step-markers")
    desk.at(f"balls-{row_of(1, balls)}").click()


def row_of(number: int, balls: list[dict[str, str]]) -> int:
    """Row of the ball with that number."""
    return [row["Number"] for row in balls].index(str(number))


def check_the_numbers(desk: Desk) -> None:
    """3: compare the numbers with the picture."""
    desk.open("numbering")
    desk.layout("3D")
    desk.page.get_by_title("Show all").click()
    for ring in ("proximal", "distal"):
        desk.read(
            f"ring-words-{ring}",
            **{f"rms_{ring}": r"RMS ([\d.]+) mm", f"next_{ring}": r"numbering ([\d.]+) mm"},
        )
    desk.picture("03-numbers", NARROW, "step-numbering")


def swap_two_numbers(desk: Desk) -> None:
    """4: swap two numbers, see the refusal, undo."""
    first = desk.at("number-1").get_attribute("data-ball")
    desk.at("number-1").click()
    desk.page.wait_for_selector('[data-testid="number-1"][aria-pressed="true"]')
    desk.at("number-2").click()
    desk.wait("numbering", "refused")
    desk.read("banner-message", swapped_rms=r"RMS ([\d.]+) mm", rms_limit=r"limit ([\d.]+) mm")
    desk.say(undo_label=desk.words("undo-label"))
    desk.picture("04-refused", NARROW, "banners")
    desk.at("undo").click()
    desk.wait("numbering", "done")
    if desk.at("number-1").get_attribute("data-ball") != first or desk.at("banner").count():
        raise SystemExit("undo did not bring the numbers back")


def recognise_the_poses(desk: Desk) -> None:
    """5: recognise the ring poses and confirm the front."""
    desk.run("poses")
    desk.read("gates-summary", gates=r"all (\d+) pass")
    desk.at("confirm-ring-front").click()
    desk.wait("poses", "done")
    desk.layout("Four views")
    desk.picture("05-poses", WIDE, "step-poses")


def compare_the_readings(desk: Desk) -> None:
    """6: the strut readings against the CT."""
    desk.open("readings")
    differences = [abs(float(row["CT - reading mm"])) for row in desk.rows("struts")]
    verdicts = {row["Verdict"] for row in desk.rows("struts")}
    desk.say(strut_difference=f"{max(differences):.3f}", strut_verdict=", ".join(verdicts))
    desk.layout("3D")
    desk.picture("06-readings", NARROW, "step-readings")


def look_at_the_correction(desk: Desk) -> None:
    """7: the correction that the case asks for."""
    desk.open("correction")
    desk.layout("Sagittal")
    desk.say(target_z=desk.value("target", "z mm"))
    desk.say(strut_1=desk.value("target", "Strut 1 at the end mm"))
    others = [desk.value("target", name) for name in ("x mm", "y mm", "α deg", "β deg", "γ deg")]
    if any(map(float, others)):
        raise SystemExit("the text says that the rings end parallel, straight above one another")
    desk.picture("07-correction", NARROW, "step-correction")


def play_the_plan(desk: Desk) -> None:
    """8: plan, and play to the middle."""
    desk.run("schedule")
    desk.layout("3D")
    desk.at("playback").wait_for(timeout=LONG_MS)
    for name in ("Start", "Days", "Adjustments a day", "Rate", "Rounding leaves at the end"):
        desk.say(**{name.split()[0].lower(): desk.value("schedule", name)})
    half, row = int(desk.figures["days"]) * int(desk.figures["adjustments"]) // 2, 0
    while row < half or "no turn" in desk.words("play-turn-1"):
        row += 1
        desk.at("play-next").click()
        desk.page.wait_for_selector(f'[data-testid="playback"][data-row="{row}"]', timeout=LONG_MS)
    desk.read("play-when", when_day=r"day (\d+)", when_adjustment=r"adjustment (\d+)")
    desk.say(when_strut_1=desk.words("play-value-1"))
    desk.read("play-turn-1", when_turn=r"([\d.]+)", when_way=r"(longer|shorter)")
    desk.picture("08-playback", WIDE, "step-schedule")


def make_the_prescription(desk: Desk) -> None:
    """9: make the prescription and give the side again."""
    desk.run("export")
    desk.say(blocked=desk.words("export-blocked").removeprefix("Blocked: "))
    desk.at("confirm-left").click()
    desk.at("files").wait_for(timeout=LONG_MS)
    desk.read("page-words", pages=r"of (\d+)")
    desk.picture("09-prescription", HIGH, "step-export")


def download(desk: Desk, folder: Path) -> None:
    """Take every file of the export, as a user does."""
    folder.mkdir()
    for name in FILES:
        with desk.page.expect_download() as taken:
            desk.at(f"download-{name}").click()
        taken.value.save_as(folder / name)


STEPS = (
    *(open_the_case, find_the_balls, check_the_numbers, swap_two_numbers, recognise_the_poses),
    *(compare_the_readings, look_at_the_correction, play_the_plan, make_the_prescription),
)
"""Steps one to nine; the tenth is the printed sheet."""


def run(folder: Path) -> dict[str, str]:
    """Do the tutorial.

    Parameters
    ----------
    folder : Path
        An empty folder for the case, the downloads in ``export`` and the raw pictures.

    Returns
    -------
    dict of str to str
        The figures for the page.
    """
    demo = json.loads(hexafix("demo", "--out", folder / "demo", "--json").stdout)
    case = folder / "demo" / "phantom" / "case.json"
    with workstation(case) as address, browser_page(address) as page:
        desk = Desk(page, folder)
        for step in STEPS:
            print(step.__name__.replace("_", " "), file=sys.stderr)
            step(desk)
        download(desk, folder / "export")
    verdict = json.loads(hexafix("verify", folder / "export", "--json").stdout)
    desk.say(
        checks=len(verdict["checks"]),
        truth_balls=f"{demo['errors']['ball_rms_mm']:.4f}",
        truth_end=f"{demo['errors']['end_mm']:.2f}",
    )
    sheet(folder)
    compare(desk.figures, json.loads((folder / "export" / "plan.json").read_text("utf-8")))
    return desk.figures


def sheet(folder: Path) -> None:
    """Picture of the prescription's first page as it is printed."""
    sys.path.insert(0, str(PACKAGE))
    from hexafix.pipeline import prescription_pages

    pages = prescription_pages((folder / "export" / "prescription.pdf").read_bytes(), dpi=150)
    (folder / "10-sheet.png").write_bytes(pages[0])


def compare(figures: dict[str, str], plan: dict[str, Any]) -> None:
    """Refuse figures of the screen that are not those of the plan, as far as they are shown."""
    schedule, rings = plan["schedule"], plan["rings"]
    when = (int(figures["when_day"]), int(figures["when_adjustment"]))
    shown = [(row["day"], row["adjustment"]) for row in schedule["rows"]].index(when)
    now, before = (schedule["rows"][k]["strut_mm"][0] for k in (shown, shown - 1))
    expected = {
        "balls": len(plan["balls"]),
        "rejected": len(plan["rejected"]),
        "diameter_min": min(ball["diameter_mm"] for ball in plan["balls"]),
        "diameter_max": max(ball["diameter_mm"] for ball in plan["balls"]),
        "rms_proximal": rings["proximal"]["rms_mm"],
        "rms_distal": rings["distal"]["rms_mm"],
        "strut_difference": max(map(abs, plan["mechanism"]["difference"]["struts_mm"])),
        "target_z": plan["correction"]["target"]["position_mm"][2],
        "days": schedule["days"],
        "adjustments": schedule["adjustments_per_day"],
        "when_strut_1": now,
        "when_turn": abs(now - before),
    }
    way = "longer" if now > before else "shorter"
    wrong = ["when_way"] if way != figures["when_way"] else []
    wrong += [name for name, value in expected.items() if not shows(figures[name], value)]
    if wrong:
        raise SystemExit(f"the screen and plan.json differ in: {', '.join(wrong)}")


def shows(words: str, value: float) -> bool:
    """Whether the words are the value, rounded to the digits that they have."""
    digits = len(words.partition(".")[2])
    return abs(float(words) - value) <= 0.5001 * 10.0**-digits
