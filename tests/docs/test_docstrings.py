"""Docstrings of the rooms that are described: short first lines, and every parameter of a public function."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = (
    "idm_sumo/scenes",
    "idm_sumo/calibration",
    "idm_sumo/simulation",
    "idm_sumo/prediction",
    "idm_sumo/models",
    "idm_sumo/irl",
    "idm_sumo/evaluation",
    "idm_sumo/sumo",
    "analysis/reproduce",
    "analysis/diagnosis",
)
LONGEST = 10  # words of a first line

Function = ast.FunctionDef | ast.AsyncFunctionDef
Documented = ast.Module | ast.ClassDef | Function
MODULES = [file for room in ROOMS for file in sorted((ROOT / room).rglob("*.py"))]


def documented(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Yield name and docstring of everything that has one."""
    for node in ast.walk(tree):
        if isinstance(node, Documented) and (text := ast.get_docstring(node)):
            yield getattr(node, "name", "module"), text


def public_functions(node: ast.AST) -> Iterator[Function]:
    """Yield functions and methods that are neither private nor inside another function."""
    for child in ast.iter_child_nodes(node):
        name = getattr(child, "name", "")
        if isinstance(child, Function) and not name.startswith("_"):
            yield child
        elif isinstance(child, ast.ClassDef) and not name.startswith("_"):
            yield from public_functions(child)


def arguments(function: Function) -> set[str]:
    given = function.args
    named = (*given.posonlyargs, *given.args, *given.kwonlyargs, *filter(None, (given.vararg, given.kwarg)))
    return {argument.arg for argument in named} - {"self", "cls"}


def parameters(text: str) -> set[str]:
    """Return the names in the section on parameters."""
    section = re.search(r"^Parameters\n-+\n(.*?)(?:^\w[\w ]*\n-{3,}|\Z)", text, re.DOTALL | re.MULTILINE)
    if section is None:
        return set()
    heads = [line.split(" : ")[0] for line in section[1].splitlines() if line and not line.startswith(" ")]
    return {name.strip(" *") for head in heads for name in head.split(",")}


@pytest.mark.parametrize("file", MODULES, ids=lambda file: str(file.relative_to(ROOT)))
def test_first_lines_are_short(file: Path) -> None:
    first_lines = {name: text.splitlines()[0] for name, text in documented(ast.parse(file.read_text("utf-8")))}
    assert {name: line for name, line in first_lines.items() if len(line.split()) > LONGEST} == {}


@pytest.mark.parametrize("file", MODULES, ids=lambda file: str(file.relative_to(ROOT)))
def test_public_functions_describe_their_parameters(file: Path) -> None:
    functions = public_functions(ast.parse(file.read_text("utf-8")))
    differing = {one.name: arguments(one) ^ parameters(ast.get_docstring(one) or "") for one in functions}
    assert {name: names for name, names in differing.items() if names} == {}
