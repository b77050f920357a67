"""The hazard table is complete: rows, codes, functions, tests and removals, in both directions."""

import ast
from itertools import chain

import pytest


@pytest.fixture(scope="session")
def rows(hazard_table):
    return hazard_table.load()[0]


@pytest.fixture(scope="session")
def no_hazard(hazard_table):
    return hazard_table.load()[1]


@pytest.fixture(scope="session")
def in_package(hazard_table):
    """Codes and hazard ids that the package's sources name."""
    codes, hazards = set(), set()
    for _, tree in hazard_table.package_files():
        codes |= hazard_table.codes_of(tree)
        hazards |= hazard_table.hazards_of(tree)
    return codes, hazards


def gates_of(rows):
    return list(chain.from_iterable(row.gates for row in rows))


def test_every_hazard_and_every_mandatory_gate_has_one_row(rows):
    expected = [f"G{k}" for k in range(1, 10)] + [f"H{k:02}" for k in range(1, 58)]
    assert [row.id for row in rows] == expected


def test_every_row_says_whether_it_is_tested_or_which_feature_is_missing(rows, hazard_table):
    for row in rows:
        assert row.status in hazard_table.STATUS, row.id
        assert row.fault, row.id
        assert row.behaviour, row.id
        assert bool(row.missing) == (row.status != "tested"), row.id
        assert bool(row.gates) == (row.status != "not built"), row.id


def test_no_hazard_that_the_package_names_is_called_not_built(rows, in_package):
    unbuilt = {row.id for row in rows if row.status == "not built"}
    assert unbuilt & in_package[1] == set()


def test_every_hazard_of_the_package_is_a_row_with_gates(rows, in_package):
    assert in_package[1] <= {row.id for row in rows if row.gates}


def test_every_fault_code_of_the_package_stands_in_the_table_and_no_other(
    rows, no_hazard, in_package
):
    named = {code for gate in gates_of(rows) for code in gate.codes}
    assert named & set(no_hazard) == set()
    missing = in_package[0] - named - set(no_hazard)
    assert missing == set(), "give each code a gate in hazards.toml, or a reason in [no_hazard]"
    assert (named | set(no_hazard)) - in_package[0] == set(), "codes that the package has not"


def test_every_code_is_given_a_hazard_in_its_own_module(rows, hazard_table):
    for gate in gates_of(rows):
        file, name = hazard_table.place(gate.by)
        assert hazard_table.has_name(file, name), f"{gate.name}: {gate.by}"
        removed = gate.removal.file
        assert (hazard_table.TOP / removed).is_file(), gate.name


def test_every_test_of_the_table_exists(rows, hazard_table):
    for gate in gates_of(rows):
        assert gate.tests, gate.name
        for test in gate.tests:
            file, _, name = test.partition("::")
            path = hazard_table.TOP / "Testing" / file
            assert path.is_file(), f"{gate.name}: {test}"
            assert name in hazard_table.test_functions(path), f"{gate.name}: {test}"


def test_every_gate_has_a_removal_that_still_applies(rows, hazard_table):
    for gate in gates_of(rows):
        source = (hazard_table.TOP / gate.removal.file).read_text("utf-8")
        changed = gate.removal.applied(source)
        assert changed != source, gate.name
        ast.parse(changed, str(gate.removal.file))


def test_a_removal_that_no_longer_applies_is_noticed(hazard_table):
    source = "def gate():\n    return 1\n\n\nclass A:\n    def gate(self):\n        return 2\n"
    removal = hazard_table.Removal("a.py", "A.gate", None, "3")
    assert removal.applied(source).endswith("        return 3\n")
    with pytest.raises(LookupError):
        hazard_table.Removal("a.py", "B.gate", None, "3").applied(source)
    with pytest.raises(LookupError):
        hazard_table.Removal("a.py", None, "return", "3").applied(source)


def test_codes_are_found_however_a_fault_is_made(hazard_table):
    tree = ast.parse(
        'Fault("one-code", "w"); Error.of("two", "w"); Gate("G1", f"three-{x}", "n")\n'
        'at_most("G2", "four-a" if x else "four-b", "n"); Fault(code="five")\n'
        'rows = [("six-code", "w", "H03", "limit")]\n'
        'kinds = ("no-fault", "no-fault-either", "a", "b")\n'
        'text = "no-code"'
    )
    codes = hazard_table.codes_of(tree)
    assert codes == {"one-code", "two", "three-*", "four-a", "four-b", "five", "six-code"}


def test_the_document_is_printed_from_the_data(hazard_table, measured):
    text = (hazard_table.TOP / hazard_table.DOCUMENT).read_text("utf-8")
    assert hazard_table.document(text, hazard_table.parts()) == text, (
        "run python Testing/hazards/hazard_table.py"
    )


def test_the_document_holds_the_measured_figures_of_section_2(hazard_table, measured):
    text = (hazard_table.TOP / hazard_table.DOCUMENT).read_text("utf-8")
    assert hazard_table.document(text, {"section 2": measured.table()}) == text, (
        "run python Testing/hazards/measured.py"
    )


def test_a_sample_of_gates_is_removed_and_missed(remove_gate, capsys):
    assert remove_gate.main(["--sample", "15", "--seed", "20261122", "--quick"]) == 0
    assert "15 gates removed, 15 proved" in capsys.readouterr().out


def test_a_gate_whose_removal_nobody_misses_is_told(remove_gate, hazard_table, tmp_path):
    (gate,) = remove_gate.chosen(["G4.1"])
    idle = hazard_table.Removal(gate.removal.file, None, "passed = z > 0.0", "passed = 0.0 < z")
    blind = hazard_table.Gate(
        gate.row, gate.number, gate.codes, gate.by, gate.limit, gate.tests, idle
    )
    remove_gate.copy_checkout(tmp_path / "copy")
    with remove_gate.Tests(tmp_path / "copy") as tests:
        assert "0 failed" in remove_gate.without(tests, blind)
        assert remove_gate.without(tests, gate) == ""
