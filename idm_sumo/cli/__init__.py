"""The command line, the only place that prints or exits.

It is the only room that sees `analysis`.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Sequence
from typing import NoReturn

from idm_sumo.cli.parser import build_parser
from idm_sumo.runtime.errors import InputError

BAD_INPUT = 2


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command and exit: 0 when done, 2 with one line when the input or the user stopped it."""
    options = build_parser().parse_args(arguments)
    try:
        options.run(options)
    except InputError as error:
        if options.verbose:
            traceback.print_exc()
        _stop(str(error))
    except KeyboardInterrupt:
        _stop("interrupted; nothing half-written is left, run the same command again")
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output has gone, as `head` does
        sys.exit(0)


def _stop(message: str) -> NoReturn:
    one_line = " ".join(message.split())
    print(f"idm-sumo: {one_line}", file=sys.stderr)
    sys.exit(BAD_INPUT)
