"""Progress reports as a plain callable.

Only the command line prints, so long work gets a callable to report to.
"""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """A callable that is told how far long work is."""

    def __call__(self, stage: str, done: float, total: float) -> None:
        """Report progress.

        Parameters
        ----------
        stage : str
            What is being done.
        done, total : float
            How much of it is done, and how much there is.
        """


def silent(stage: str, done: float, total: float) -> None:
    """Ignore a report of progress.

    Parameters
    ----------
    stage : str
        What is being done.
    done, total : float
        How much of it is done, and how much there is.
    """
