"""How long work tells how far it is: a plain callable, so that only the command line prints."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Called with what is being done, how much of it is done, and how much there is."""

    def __call__(self, stage: str, done: float, total: float) -> None:
        """Report."""


def silent(stage: str, done: float, total: float) -> None:
    """Report nothing."""
