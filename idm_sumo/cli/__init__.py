"""The command line, the only place that prints or exits.

It is the only room that sees `analysis`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from idm_sumo.cli.guard import defended
from idm_sumo.runtime.environment import check_threads, draw_into_files, one_blas_thread

VERBOSE = {"-v", "--verbose"}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command; end the program with one line if anything stops it.

    Raises
    ------
    SystemExit
        With 2 if input, options or the machine stopped the run, 130 after an interrupt, 1 for a
        defect of ours; see :mod:`idm_sumo.cli.guard`.
    """
    given = sys.argv[1:] if arguments is None else list(arguments)
    with defended(verbose=bool(VERBOSE & set(given))):
        one_blas_thread()
        draw_into_files()
        check_threads()
        from idm_sumo.cli import outputs  # here, so that an interrupt while modules load is caught
        from idm_sumo.cli.parser import build_parser

        options = build_parser().parse_args(given)
        outputs.check(options)
        options.run(options)
