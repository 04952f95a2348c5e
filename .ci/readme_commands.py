"""Run the commands of the documents' ``sh`` blocks, as printed: ``readme_commands.py [start-run|start-test|rest]``.

``start-run`` runs the first command of the README's section Start (the main job), ``start-test`` its other ones (the
tests), ``rest`` the README's other commands and those of the pages in ``docs``; without any, all are run. A command
that several pages show is run once. ``RECORDING`` stands for a file of the reader's; here it is a short surrogate.
Blocks of another language (``console``) are not run: they need a network, an extra or hours.
"""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
FIRST = "commands.md"  # its commands build on each other; other pages show some of them


def commands(text: str) -> list[str]:
    """Return the commands of all ``sh`` blocks, one a line, continued lines joined."""
    blocks = re.findall(r"^```sh\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [line.strip() for line in lines if line.strip() and not line.startswith("#")]


def chosen(which: str) -> list[str]:
    """Return the commands that are to be run, each once."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    end = readme.index("\n## ", readme.index("\n## Start") + 1)
    pages = [page for page in (ROOT / "docs").rglob("*.md") if "_build" not in page.parts]
    pages.sort(key=lambda page: (page.name != FIRST, page))
    first, *tests = commands(readme[:end])
    texts = [readme[end:], *(page.read_text(encoding="utf-8") for page in pages)]
    rest = [command for text in texts for command in commands(text) if command not in (first, *tests)]
    parts = {"start-run": [first], "start-test": tests, "rest": rest, "all": [first, *tests, *rest]}
    return list(dict.fromkeys(parts[which]))


def cpu_seconds() -> float:
    """Return what the commands so far have spent, on all cores."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run(command: str, recording: Path) -> None:
    """Run one command in the environment that the README makes; exit if it fails."""
    tools = ROOT / ".venv/bin"
    if "RECORDING" in command and not recording.exists():
        subprocess.run([tools / "idm-sumo", "surrogate", "-o", recording, "--minutes", "2"], check=True, cwd=ROOT)
    begin, spent = time.monotonic(), cpu_seconds()
    print(f"$ {command}", flush=True)
    environment = os.environ | {"PATH": f"{tools}{os.pathsep}{os.environ['PATH']}"}
    line = command.replace("RECORDING", str(recording))
    done = subprocess.run(line, shell=True, cwd=ROOT, env=environment, check=False)
    print(f"  ({time.monotonic() - begin:.0f} s, {cpu_seconds() - spent:.0f} CPU s)", flush=True)
    if done.returncode:
        sys.exit(f"documented command failed with {done.returncode}: {command}")


def main() -> None:
    """Run them in order; stop at the first that fails."""
    which = sys.argv[1] if len(sys.argv) > 1 else "all"
    with tempfile.TemporaryDirectory() as folder:
        for command in chosen(which):
            run(command, Path(folder) / "recording.parquet")


if __name__ == "__main__":
    main()
