"""The tests' own order: rooms like those of the package, inputs shared by helpers and not by tests."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
ROOMS = {path.parent.name for path in (TESTS.parent / "idm_sumo").glob("*/__init__.py")}
OWN = {"analysis", "api", "benchmarks", "docs", "faults", "fuzz", "helpers", "reference", "simulators"}


@pytest.mark.parametrize("module", sorted(TESTS.rglob("*.py")), ids=lambda path: str(path.relative_to(TESTS)))
def test_no_test_module_is_imported(module: Path) -> None:
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "tests are imported by their whole name"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            assert not any(part.startswith("test_") for part in name.split(".")), f"{name} is a test"


def test_rooms_are_those_of_the_package() -> None:
    folders = {path.relative_to(TESTS).parts[0] for path in TESTS.rglob("test_*.py")} - {Path(__file__).name}
    assert folders <= ROOMS | OWN, f"tests of what? {sorted(folders - ROOMS - OWN)}"


def test_tests_have_the_names_of_their_kind() -> None:
    for module in TESTS.rglob("*.py"):
        tested = any(
            isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
            for node in ast.parse(module.read_text(encoding="utf-8")).body
        )
        assert tested == module.name.startswith("test_"), module
