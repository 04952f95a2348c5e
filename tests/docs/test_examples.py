"""Every example runs as it stands, on the built-in recording."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*.py"))


@pytest.mark.slow  # the server runs them from a wheel
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(example: Path, tmp_path: Path) -> None:
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    environment = {**os.environ, "MPLBACKEND": "agg", "PYTHONPATH": paths, "TMPDIR": str(tmp_path)}
    done = subprocess.run([sys.executable, str(example)], capture_output=True, text=True, cwd=tmp_path, env=environment)
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_there_is_one_for_every_step_and_each_is_short() -> None:
    assert [path.stem for path in EXAMPLES] == [
        "plot_1_calibrate", "plot_2_predict", "plot_3_replay", "plot_4_diagnose", "plot_5_export",
    ]  # fmt: skip
    for path in EXAMPLES:
        code = path.read_text(encoding="utf-8").split('"""')[2]
        assert (
            len([line for line in code.splitlines() if line.strip() and not line.startswith(("import", "from"))]) <= 12
        )
