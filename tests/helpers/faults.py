"""A machine that fails: an error at the k-th system call of a writer."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable
from types import TracebackType
from typing import Any

import pytest

CALLS = ("open", "close", "mkdir", "rmdir", "rename", "replace", "unlink", "link", "chmod", "fsync",
"listdir", "scandir",
         "stat", "lstat", "readlink")  # fmt: skip


class Faults:
    """Raises ``error`` at one system call of this process, before it is done or (``late``) after."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, at: int, error: type[BaseException], late: bool) -> None:
        self._patch, self._at, self._error, self._late = monkeypatch, at, error, late
        self.count, self.struck, self.name = 0, False, ""
        self._active = False

    def __enter__(self) -> Faults:
        self._context = self._patch.context()
        patch = self._context.__enter__()
        for module, names in ((os, CALLS), (fcntl, ("flock",))):
            for name in names:
                patch.setattr(module, name, self._wrapped(f"{module.__name__}.{name}", getattr(module, name)))
        self._active = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._active = False
        self._context.__exit__(kind, error, trace)

    def _wrapped(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def strike(*given: Any, **named: Any) -> Any:
            if not self._active or self.struck:
                return call(*given, **named)
            self.count += 1
            hits = self.count == self._at
            if hits and not self._late:
                self._strike(name)
            done = call(*given, **named)
            if hits:
                self._strike(name)
            return done

        return strike

    def _strike(self, name: str) -> None:
        self.struck, self.name = True, name
        raise self._error(28, "No space left on device") if self._error is OSError else self._error
