"""The tutorial: its steps, pictures, figures, controls and commands are real and whole."""

import ast
import importlib.util
import json
import re
import shutil
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = ROOT / "Resources" / "Documents"
PACKAGE = ROOT / "HexaFixModule" / "hexafix"


def loaded(name):
    spec = importlib.util.spec_from_file_location(name, DOCUMENTS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    # as in a run of the command, whose folder the interpreter puts first
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(DOCUMENTS)
        spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def make():
    return loaded("make_tutorial")


@pytest.fixture(scope="module")
def run():
    return loaded("tutorial_run")


@pytest.fixture
def a_copy(make, tmp_path):
    """The tutorial in a folder of its own, to be spoiled."""
    for name in ("tutorial.in.md", "tutorial.md"):
        shutil.copy(DOCUMENTS / name, tmp_path / name)
    shutil.copytree(DOCUMENTS / make.IMAGES, tmp_path / make.IMAGES)
    return tmp_path


def rewrite(folder, old, new, *names):
    for name in names or ("tutorial.in.md", "tutorial.md"):
        text = (folder / name).read_text(encoding="utf-8")
        assert old in text
        (folder / name).write_text(text.replace(old, new, 1), encoding="utf-8")


@cache
def texts(room):
    """Every text of a room's sources; in a made one, `\\0` stands for what is put in."""
    held = []
    for path in sorted((PACKAGE / room).rglob("*.py")):
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        told = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        for node in nodes:
            if id(node) in told:
                continue
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                held.append(node.value)
            elif isinstance(node, ast.JoinedStr):
                parts = [v.value if isinstance(v, ast.Constant) else "\0" for v in node.values]
                held.append("".join(parts))
    return held


def is_made(name):
    """Whether a source of the browser's page makes a part of that name.

    It stands there as it is, with parts put in by Python (``f"run-{step}"``), or as an expression
    of the page (``'number-' + item.number``).
    """
    for text in texts("web"):
        known, made, rest = text.partition("\0")
        if text in (name, f'data-testid="{name}"') or (
            made and not rest and len(known) > 3 and name.startswith(known)
        ):
            return True
        looped = re.fullmatch(r"'([\w-]{3,})' \+ .+", text)
        if looped and name.startswith(looped[1]):
            return True
    return False


def test_the_page_is_whole(make):
    assert make.faults(DOCUMENTS) == []


def test_every_control_named_exists_in_the_panel(make):
    web = texts("web")
    for words, name in make.CONTROLS.items():
        # the page itself makes a capital of "undo"
        assert any(words in text or words.lower() == text for text in web), words
        assert name is None or is_made(name), name
    assert not is_made("run-everything-else")


def test_every_part_that_the_run_uses_exists_in_the_panel(run):
    source = "".join(
        (DOCUMENTS / name).read_text(encoding="utf-8")
        for name in ("tutorial_run.py", "tutorial_desk.py")
    )
    used = set(re.findall(r'(?:at|words|read)\(\s*"([\w.-]+)"', source))
    used |= {f"table-{name}" for name in re.findall(r'(?:rows|value)\("(\w+)"', source)}
    assert {"undo", "confirm-left", "table-balls", "gates-summary"} <= used
    assert [name for name in sorted(used) if not is_made(name)] == []


def test_the_words_in_slanted_letters_are_on_the_screen(make):
    page = (DOCUMENTS / "tutorial.md").read_text(encoding="utf-8").replace("\n", " ")
    own = {"You see", "Check"}
    held = [text for room in ("web", "presenter", "mrml") for text in texts(room)]
    known = "\n".join(held).replace("\0 front", "A front\nB front")
    measured = set(make.figures(DOCUMENTS).values())
    said = set(re.findall(r"(?<!\*)\*([^*]+)\*(?!\*)", page)) - own
    assert {"refused", "A front", "Four views"} <= said
    assert [words for words in said if words not in known and words not in measured] == []


def test_the_pictures_are_legible_and_small(make):
    from PIL import Image

    for name in make.PICTURES:
        with Image.open(DOCUMENTS / make.IMAGES / f"{name}.png") as image:
            assert image.width == make.WIDTH_PX, name
            assert 500 <= image.height <= 1750, name
            assert len(image.getcolors()) > 50, name


def test_it_says_what_it_is():
    page = (DOCUMENTS / "tutorial.md").read_text(encoding="utf-8")
    head = " ".join(page.split("## ")[0].split())
    for words in ("Research software. Not a medical device.", "simulated", "not approved"):
        assert words in head.replace("> ", "")


def test_its_links_lead_somewhere():
    for name in ("tutorial.md", "tutorial.in.md"):
        page = (DOCUMENTS / name).read_text(encoding="utf-8")
        for target in re.findall(r"\]\(([^)#:]+)\)", page):
            assert (DOCUMENTS / target).exists(), target


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("## 10. ", "## 11. ", "not ten steps"),
        ("images/tutorial/04-refused.png", "images/tutorial/03-numbers.png", "not one described"),
        ("hexafix serve demo", "hexafix server demo", "hexafix server demo"),
        ("hexafix demo --out demo", "hexafix demo --output demo", "--output"),
        ("make_tutorial.py`", "make_tutorial.py --all`", "no such command"),
        ("**Find the balls**", "**Search the balls**", "no control 'Search the balls'"),
        ("**Plan all steps**", "*Plan all steps*", "'Plan all steps' is not named"),
    ],
)
def test_a_spoiled_page_is_told(make, a_copy, old, new, says):
    rewrite(a_copy, old, new)
    assert any(says in fault for fault in make.faults(a_copy))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("{days} days", "22 days", "typed by hand: 22 days"),
        ("{rms_proximal} mm", "{rms_of_proximal} mm", "no figure rms_of_proximal"),
        ("{pages} pages", "many pages", "unused figure pages"),
    ],
)
def test_a_figure_that_is_not_of_the_run_is_told(make, a_copy, old, new, says):
    rewrite(a_copy, old, new, "tutorial.in.md")
    assert any(says in fault for fault in make.faults(a_copy))


def test_figures_of_another_run_are_told(make, a_copy):
    path = a_copy / make.IMAGES / "figures.json"
    figures = json.loads(path.read_text(encoding="utf-8"))
    figures["days"] = str(int(figures["days"]) + 1)
    path.write_text(json.dumps(figures), encoding="utf-8")
    assert any("is not tutorial.in.md" in fault for fault in make.faults(a_copy))


def test_a_picture_missing_left_over_or_too_large_is_told(make, a_copy):
    images = a_copy / make.IMAGES
    (images / "05-poses.png").rename(images / "05-rings.png")
    assert any("left over" in fault and "05-rings" in fault for fault in make.faults(a_copy))
    (images / "05-rings.png").write_bytes(bytes(make.LIMIT_BYTES))
    assert any("bytes of pictures" in fault for fault in make.faults(a_copy))


def a_plan_of(figures):
    """As much of plan.json as the run compares, with exactly what the screen says."""
    number = {
        name: float(words)
        for name, words in figures.items()
        if words[:1].isdigit() and re.fullmatch(r"[\d.]+", words)
    }
    day, adjustment = int(number["when_day"]), int(number["when_adjustment"])
    sign = 1 if figures["when_way"] == "longer" else -1
    now = number["when_strut_1"]
    rows = [
        {"day": day, "adjustment": adjustment - 1, "strut_mm": [now - sign * number["when_turn"]]},
        {"day": day, "adjustment": adjustment, "strut_mm": [now]},
    ]
    widths = [number["diameter_min"], number["diameter_max"]]
    widths += [number["diameter_max"]] * (int(number["balls"]) - 2)
    return {
        "balls": [{"diameter_mm": width} for width in widths],
        "rejected": [{}] * int(number["rejected"]),
        "rings": {name: {"rms_mm": number[f"rms_{name}"]} for name in ("proximal", "distal")},
        "mechanism": {"difference": {"struts_mm": [-number["strut_difference"], 0.0]}},
        "correction": {"target": {"position_mm": [0.0, 0.0, number["target_z"]]}},
        "schedule": {
            "rows": rows,
            "days": int(number["days"]),
            "adjustments_per_day": int(number["adjustments"]),
        },
    }


COMPARED = (
    *("balls", "rejected", "diameter_min", "diameter_max", "rms_proximal", "rms_distal"),
    *("strut_difference", "target_z", "days", "adjustments", "when_strut_1", "when_turn"),
)


@pytest.mark.parametrize("name", [*COMPARED, "when_way"])
def test_a_screen_that_differs_from_the_plan_stops_the_run(make, run, name):
    figures = make.figures(DOCUMENTS)
    plan = a_plan_of(figures)
    run.compare(figures, plan)
    other = {"longer": "shorter", "shorter": "longer"}.get(figures[name])
    digits = len(figures[name].partition(".")[2])
    with pytest.raises(SystemExit, match=name):
        run.compare({**figures, name: other or f"{float(figures[name]) + 1:.{digits}f}"}, plan)


def test_a_figure_is_compared_to_the_digits_that_are_shown(run):
    assert run.shows("0.047", 0.046526)
    assert run.shows("22", 22)
    assert not run.shows("0.048", 0.046526)
    assert not run.shows("85.9", 85.98)
