"""Files of strangers: only regular ones, unpacked within bounds, JSON and TOML of a sound size."""

from __future__ import annotations

import bz2
import gzip
import io
import json
import lzma
import math
import stat
import tomllib
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, cast

from idm_sumo.runtime.errors import InputError, shown

PACKED: dict[bytes, Any] = {b"\x1f\x8b": gzip.open, b"\xfd7zXZ\x00": lzma.open, b"BZh": bz2.open}  # by the first bytes
BROKEN = (EOFError, OSError, zlib.error, lzma.LZMAError)  # what a damaged archive raises
UNPACKED = 32 * 2**20  # bytes that any file may unpack to
RATIO = 50  # times its size that a larger file may unpack to; recordings need 5 to 25
TEXT = 16 * 2**20  # bytes of a JSON or TOML file at most; ours have thousands
WORD = 20  # digits of a whole number in JSON or TOML at most, more than any 64-bit one


def existing_file(path: Path | str, advice: str = "name a file") -> Path:
    """Return a path that is a regular file.

    A pipe or a device is refused: it can be read only once, and a reader would wait for its writer.

    Raises
    ------
    InputError
        If there is no such file, or it is something else.
    """
    path = Path(path)
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; {advice}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error}); {advice}") from None
    if stat.S_ISDIR(mode):
        raise InputError(f"{path}: is a folder; {advice}")
    if not stat.S_ISREG(mode):
        raise InputError(f"{path}: is a pipe or a device; save its content to a file and name that")
    return path


def check_expansion(packed: int, unpacked: int, name: object) -> None:
    """Raise if a file of ``packed`` bytes unpacks to more than any recording does.

    Raises
    ------
    InputError
        If it does, before memory is spent on it.
    """
    if unpacked > max(UNPACKED, RATIO * packed):
        raise InputError(
            f"{name}: unpacks to more than {max(UNPACKED, RATIO * packed) >> 20} MB, {RATIO} times what any recording "
            "of its size holds; unpack it yourself if it is one"
        )


def open_plain(path: Path) -> IO[bytes]:
    """Open a file for reading bytes, unpacked within bounds if it is gzip, xz or bzip2."""
    with path.open("rb") as stream:
        start = stream.read(max(map(len, PACKED)))
    for mark, unpack in PACKED.items():
        if start.startswith(mark):
            return cast("IO[bytes]", io.BufferedReader(_Unpacked(path, unpack), 1 << 16))
    return path.open("rb")


class _Unpacked(io.RawIOBase):
    """The content of a packed file, as long as it stays within bounds."""

    def __init__(self, path: Path, unpack: Callable[[Path], Any]) -> None:
        self._stream = unpack(path)
        self._path, self._packed, self._read = path, path.stat().st_size, 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        count = int(self._stream.readinto(buffer))
        self._read += count
        check_expansion(self._packed, self._read, self._path)
        return count

    def close(self) -> None:
        self._stream.close()
        super().close()


def read_text(path: Path | str, advice: str) -> str:
    """Return the text of a small UTF-8 file.

    Raises
    ------
    InputError
        If it is absent, no regular file, too large or no UTF-8.
    """
    path = existing_file(path, advice)
    try:
        if (size := path.stat().st_size) > TEXT:
            raise InputError(f"{path}: has {size >> 20} MB where {TEXT >> 20} are plenty; {advice}")
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); {advice}") from None


def parse_json(text: str | bytes, name: object, *, finite: bool = True) -> Any:
    """Return what a JSON text holds.

    Parameters
    ----------
    text : str or bytes
    name : object
        What messages call it.
    finite : bool, keyword-only
        Refuse NaN and numbers beyond the range of floats.

    Raises
    ------
    InputError
        If it is no JSON, nested too deep, or holds a number that is none.
    """

    def real(word: str) -> float:
        value = float(word)
        if finite and not math.isfinite(value):
            raise ValueError(f"{shown(word)} is no finite number")
        return value

    try:
        return json.loads(text, parse_constant=real, parse_float=real, parse_int=_whole)
    except RecursionError:
        raise InputError(f"{name}: is nested too deep for JSON of ours; write it again") from None
    except ValueError as error:  # UnicodeDecodeError and JSONDecodeError are such
        raise InputError(f"{name}: is not JSON ({error}); write it again") from None


def _whole(word: str) -> int:
    if len(word) > WORD:
        raise ValueError(f"a whole number of {len(word)} digits")
    return int(word)


def read_toml(path: Path | str, advice: str) -> dict[str, Any]:
    """Return what a TOML file holds.

    Raises
    ------
    InputError
        If it is absent, no TOML, nested too deep, or holds a number beyond 64 bit.
    """
    text = read_text(path, advice)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{path}: is nested too deep for TOML of ours; {advice}") from None
    except (ValueError, OverflowError) as error:  # TOMLDecodeError is one
        raise InputError(f"{path}: not a TOML file: {error}") from None
