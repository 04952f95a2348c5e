"""Run the commands of the README's ``sh`` blocks, as printed: ``readme_commands.py [start|rest]``.

``start`` runs the section Start (the main job and the tests), ``rest`` everything after it; without either, all are run.
``RECORDING`` stands for a file of the reader's; here it is a short surrogate.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]


def commands(text: str) -> list[str]:
    """Return the commands of all ``sh`` blocks, one a line, continued lines joined."""
    blocks = re.findall(r"^```sh\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [line.strip() for line in lines if line.strip() and not line.startswith("#")]


def part(text: str, which: str) -> str:
    """Return the README up to the end of its section Start, or from there on, or all of it."""
    end = text.index("\n## ", text.index("\n## Start") + 1)
    return {"start": text[:end], "rest": text[end:], "all": text}[which]


def main() -> None:
    """Run them in order; stop at the first that fails."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "recording.parquet"
        for command in commands(part(readme, sys.argv[1] if len(sys.argv) > 1 else "all")):
            if "RECORDING" in command and not recording.exists():
                maker = [ROOT / ".venv/bin/idm-sumo", "surrogate", "-o", recording, "--minutes", "2"]
                subprocess.run(maker, check=True, cwd=ROOT)
            line = command.replace("RECORDING", str(recording))
            begin = time.monotonic()
            print(f"$ {command}", flush=True)
            done = subprocess.run(line, shell=True, cwd=ROOT, check=False)
            print(f"  ({time.monotonic() - begin:.0f} s)", flush=True)
            if done.returncode:
                sys.exit(f"README command failed with {done.returncode}: {command}")


if __name__ == "__main__":
    main()
