"""Write ``docs/tests.md`` from the log of a run of ``.ci/run``: ``durations.py LOG > docs/tests.md``.

What a module's slow tests are worth is what its first line says that they hold.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).parents[1]
STEP = re.compile(r"^=== (.+) \((\d+) s since the start.*?(\d+) s(?: the step before|, (\d+) CPU s)?\)$", re.MULTILINE)
TEST = re.compile(r"^ *([\d.]+)s (?:call|setup|teardown) +(tests/\S+?)::(\w+)(\[.*\])?$", re.MULTILINE)
HEAD = """\
# What the tests cost

`.ci/run` installs, lints, types, tests, builds the documents and a wheel, and runs every command that is shown.
Two cores, in seconds; processor time is that of all processes which had ended by then:

| step | time | processor time |
|---|---|---|
"""
BETWEEN = """
Modules with tests, or inputs of tests, that take more than {least:.0f} seconds. Two processes run them beside the
other work of that step, so that a test takes up to twice what it takes alone.

| module | what it holds | its slow tests (s) | together (s) |
|---|---|---|---|
"""
FOOT = """
```console
$ .ci/run > ci.log 2>&1; python3 .ci/durations.py ci.log > docs/tests.md
```
"""


def steps(log: str) -> list[str]:
    """Return a row for each step: a step's time stands in the next one's heading."""
    found = STEP.findall(log)
    return [f"| {one[0]} | {after[2]} | {after[3] or '–'} |" for one, after in pairwise(found)]


def modules(log: str) -> list[str]:
    """Return a row for each module with slow tests, the slowest first."""
    tests: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    for seconds, module, name, _ in TEST.findall(log):
        tests[module][name.removeprefix("test_").replace("_", " ")] += float(seconds)
    order = sorted(tests, key=lambda module: -sum(tests[module].values()))
    return [_row(module, tests[module]) for module in order]


def _row(module: str, tests: dict[str, float]) -> str:
    slowest = sorted(tests.items(), key=lambda one: -one[1])
    listed = "; ".join(f"{name} {seconds:.0f}" for name, seconds in slowest)
    return f"| `{module}` | {held(module)} | {listed} | {sum(tests.values()):.0f} |"


def held(module: str) -> str:
    """Return the first line of a module's docstring."""
    path = ROOT / module
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) if path.exists() else None
    return (text or "–").splitlines()[0].replace("|", r"\|")


def main() -> None:
    """Print the page."""
    log = Path(sys.argv[1]).read_text(encoding="utf-8", errors="replace")
    least = min(float(seconds) for seconds, *_ in TEST.findall(log))
    parts = (HEAD, *(f"{row}\n" for row in steps(log)), BETWEEN.format(least=least))
    print(*parts, *(f"{row}\n" for row in modules(log)), FOOT, sep="", end="")


if __name__ == "__main__":
    main()
