"""One table of all benchmarks: ``python -m tests.benchmarks.table FILE.json``.

FILE.json is what ``pytest tests/benchmarks --benchmark-only -n 0 --benchmark-json FILE.json`` leaves. Every row is a
ratio or a rate of one run, beside the alternative that ran in the same process.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from numbers import Real
from pathlib import Path
from typing import Any


def rows(benchmarks: list[dict[str, Any]]) -> Iterator[tuple[str, str, str]]:
    """Yield benchmark, measure and value."""
    for one in benchmarks:
        name = one["name"].removeprefix("test_").replace("_", " ")
        yield name, "seconds", f"{one['stats']['min']:.3g}"
        for measure, value in one["extra_info"].items():
            if isinstance(value, Real):
                yield name, measure.replace("_", " "), f"{float(value):,.3g}" if value < 1e4 else f"{float(value):,.0f}"


def main(path: Path) -> None:
    """Print the table."""
    found = json.loads(path.read_text(encoding="utf-8"))
    print("| benchmark | measure | value |", "|---|---|---|", sep="\n")
    for name, measure, value in rows(found["benchmarks"]):
        print(f"| {name} | {measure} | {value} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
