"""The method page: its map, table and pictures are what the code says."""

import importlib
import importlib.util
import inspect
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = ROOT / "Resources" / "Documents"
PACKAGE = ROOT / "HexaFixModule" / "hexafix"
PAPER = range(1, 34)
PAGES = sorted(DOCUMENTS.glob("method*.md"))


@pytest.fixture(scope="module")
def make():
    spec = importlib.util.spec_from_file_location("make_method", DOCUMENTS / "make_method.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rows(page):
    """Equation to the functions of its row."""
    found = {}
    for line in page.splitlines():
        if row := re.match(r"\| \((\d+)\) \|", line):
            found[int(row[1])] = re.findall(r"`([\w.]+)`", line)
    return found


def resolved(name):
    """The object behind a dotted name below ``hexafix``."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        try:
            at = importlib.import_module(".".join(["hexafix", *parts[:length]]))
        except ModuleNotFoundError:
            continue
        for part in parts[length:]:
            at = inspect.getattr_static(at, part)
        return at
    raise AttributeError(name)


@cache
def cited(*, departing=False):
    """Pairs of equation and name, from the live docstrings and not from the maker's parser.

    With `departing` only of docstrings that tell of a departure.
    """
    pairs = []
    for path in sorted(PACKAGE.rglob("*.py")):
        if "Source:" not in path.read_text(encoding="utf-8"):
            continue
        module = importlib.import_module(
            ".".join(["hexafix", *path.relative_to(PACKAGE).with_suffix("").parts])
        )
        short = module.__name__.removeprefix("hexafix.")
        for name, value in vars(module).items():
            if getattr(value, "__module__", None) != module.__name__:
                continue
            members = vars(value).items() if inspect.isclass(value) else ()
            for own, thing in [(name, value), *((f"{name}.{m}", v) for m, v in members)]:
                thing = getattr(thing, "__func__", thing)
                for part in (thing.__doc__ or "").split("Source:")[1:]:
                    text = part.split("Departs:")[0].split("\n\n")[0]
                    for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", text):
                        for equation in range(int(first), int(last or first) + 1):
                            if not departing or "Departs:" in thing.__doc__:
                                pairs.append((equation, f"{short}.{own}"))
    return pairs


def faults(page):
    """What is wrong with a map from equations to functions."""
    found = rows(page)
    wrong = [f"no row for ({number})" for number in PAPER if not found.get(number)]
    for name in sorted({name for names in found.values() for name in names}):
        try:
            resolved(name)
        except AttributeError:
            wrong.append(f"no function {name}")
    wrong += [f"({n}) lacks {name}" for n, name in cited() if name not in found.get(n, ())]
    return wrong


def the_map():
    return (DOCUMENTS / "method-equations.md").read_text(encoding="utf-8")


def test_every_equation_has_a_row_of_functions_that_exist_and_cite_it():
    assert not faults(the_map())


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("| (14) |", "| (140) |", "no row for (14)"),
        ("`recognition.groups.mean_rotation`", "`recognition.groups.mean_rot`", "no function"),
        (", `study.layouts.three_marker_layouts`", "", "(27) lacks"),
    ],
)
def test_a_map_with_a_fault_is_told(old, new, says):
    assert old in the_map()
    assert any(says in fault for fault in faults(the_map().replace(old, new)))


def test_the_docstrings_tell_of_many_equations():
    assert len(set(cited())) > 80


def test_the_map_is_what_its_command_makes(make):
    assert make.equations_page() == the_map()


def test_every_equation_from_which_a_docstring_departs_has_a_measured_departure():
    page = (DOCUMENTS / "method-departures.md").read_text(encoding="utf-8")
    told = set()
    for place in re.findall(r"^\| (Eq\. [^|]*) \|", page, re.MULTILINE):
        for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", place):
            told |= set(range(int(first), int(last or first) + 1))
    departing = {equation for equation, _ in cited(departing=True)}
    assert {3, 9, 14, 15, 19, 32} <= departing
    assert departing <= told


@pytest.mark.parametrize("markers", [3, 4, 7])
def test_without_a_misprint_the_printed_steps_are_exact(markers):
    from hexafix.study.as_printed import printed_ring_pose
    from hexafix.study.departures import PLACED, even

    layout = even(markers)
    found = printed_ring_pose(PLACED.apply(layout.points_mm), layout, printed=0)
    assert found.difference(PLACED) == pytest.approx((0.0, 0.0), abs=1e-9)


LEANS = {
    "varus": (0, -1), "valgus": (0, 1), "medial": (0, -1), "lateral": (0, 1),
    "apex-anterior": (1, 1), "apex-posterior": (1, -1), "anterior": (1, -1), "posterior": (1, 1),
    "short": (2, 1), "long": (2, -1),
}  # fmt: skip
"""Where the far end of a left limb's distal fragment goes, axis of LPS and sign, by the page."""


def test_the_drawn_words_move_the_fragment_as_the_page_says():
    import numpy as np
    from hexafix.correction import Deformity
    from hexafix.study.conventions import PANELS

    drawn = {}
    for _, values in PANELS:
        deformity = Deformity(moving="distal", origin_lps_mm=np.zeros(3), **values)
        word = next(value for value in values.values() if isinstance(value, str))
        drawn[word] = deformity.displacement(side="left")
    far = np.array([0.0, 0.0, -100.0])
    for word, (axis, sign) in LEANS.items():
        moved = drawn.pop(word).apply(far) - far
        assert np.argmax(np.abs(moved)) == axis, word
        assert np.sign(moved[axis]) == sign, word
    front = np.array([0.0, -30.0, 0.0])
    assert drawn.pop("internal").apply(front)[0] < -1.0
    assert drawn.pop("external").apply(front)[0] > 1.0
    assert not drawn
    page = (DOCUMENTS / "method.md").read_text(encoding="utf-8")
    assert all(f"`{word}`" in page for word in [*LEANS, "internal", "external"])


NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e-\d+)?")


def test_the_table_of_departures_is_what_its_command_measures(make):
    shipped = (DOCUMENTS / "method-departures.md").read_text(encoding="utf-8")
    made = make.departures_page()
    assert NUMBER.sub("#", made) == NUMBER.sub("#", shipped)
    for ours, theirs in zip(NUMBER.findall(made), NUMBER.findall(shipped), strict=True):
        assert float(ours) == pytest.approx(float(theirs), rel=0.02, abs=0.0011)


def test_the_pictures_are_what_their_command_draws():
    from hexafix.study.conventions import conventions_picture, deformity_picture

    for name, draw in (
        ("conventions", conventions_picture),
        ("deformity-words", deformity_picture),
    ):
        shipped = (DOCUMENTS / "images" / f"{name}.svg").read_text(encoding="utf-8")
        assert shipped == draw(), name


def test_figures_quoted_from_the_study_are_those_of_its_page():
    page = (DOCUMENTS / "method.md").read_text(encoding="utf-8")
    quoted = re.search(r"<!-- from study/angles.md -->(.*?)<!-- end -->", page, re.DOTALL)
    verdicts = (DOCUMENTS / "study" / "angles.md").read_text(encoding="utf-8")
    measured = re.findall(r"minimum 15° or more.*?, ([\d.]+) % in the full simulation", verdicts)
    assert re.findall(r"([\d.]+) %", quoted[1]) == measured
    assert len(measured) == 2


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_links_and_functions_of_the_pages_exist(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (DOCUMENTS / target).exists(), target
    for name in re.findall(r"`((?:\w+\.){2,}\w+)`", text):
        if (PACKAGE / name.split(".")[0]).is_dir():
            assert resolved(name) is not None


def test_an_unknown_part_is_told_and_nothing_written():
    command = [sys.executable, str(DOCUMENTS / "make_method.py"), "everything"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert "no such part" in run.stderr
