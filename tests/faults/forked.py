"""Commands in processes that have their modules already: seconds less for each, and a kill falls into the work."""

from __future__ import annotations

import multiprocessing
import os
import sys
from pathlib import Path

MODULES = [
    "idm_sumo.cli.parser", "analysis.replay.run", "idm_sumo.recordings.reading", "matplotlib.backends.backend_agg",
    "PIL.GifImagePlugin", "libsumo", "sumolib.net",
]  # fmt: skip
CONTEXT = multiprocessing.get_context("forkserver")


class Forked:
    """A command as the leader of a session of its own, with what a campaign needs of a ``Popen``."""

    def __init__(self, folder: Path, arguments: tuple[str, ...]) -> None:
        CONTEXT.set_forkserver_preload(MODULES)
        self._said = folder.parent / "said"
        self._process = CONTEXT.Process(target=_run, args=(folder, arguments, self._said))
        self._process.start()
        assert self._process.pid is not None
        self.pid = self._process.pid
        self.returncode: int | None = None

    def communicate(self) -> tuple[bytes, bytes]:
        """Wait for its end; return standard output, which is not kept, and standard error."""
        self._process.join()
        self.returncode = self._process.exitcode
        return b"", self._said.read_bytes()


def _run(folder: Path, arguments: tuple[str, ...], said: Path) -> None:
    from idm_sumo.cli import main

    os.setsid()
    os.chdir(folder)
    for stream, path in enumerate((os.devnull, os.devnull, said)):
        os.dup2(os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC), stream)
    sys.argv = ["idm-sumo", *arguments]
    main()
