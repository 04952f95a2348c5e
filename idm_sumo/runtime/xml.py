"""XML of strangers as a stream: no entities, no element longer than any that SUMO writes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO
from xml.parsers import expat

from idm_sumo.runtime.errors import InputError, shown
from idm_sumo.runtime.inputs import BROKEN, open_plain

BLOCK = 65536  # bytes
LONGEST_ELEMENT = 2**20  # bytes

Begin = Callable[[str, dict[str, str]], None]


def scan(path: Path, source: object, begin: Begin, *, roots: Mapping[str, str], advice: str) -> None:
    """Call ``begin(tag, attributes)`` for every element of an XML file, plain or packed.

    Parameters
    ----------
    path : Path
    source : object
        What messages call the file.
    begin : callable
        Raises ValueError for what cannot be.
    roots : mapping of str to str
        Names that the root element may have, and what such a file is.
    advice : str
        What may have happened to a file that ends within.

    Raises
    ------
    InputError
        If it is no sound XML, of another root, or ``begin`` refuses it; names the line.
    """
    parser = expat.ParserCreate()
    parser.EntityDeclHandler = _no_entities

    def first(tag: str, attributes: dict[str, str]) -> None:
        if tag not in roots:
            wanted = " or ".join(f"{kind} has <{name}>" for name, kind in roots.items())
            raise _AnotherRoot(f"root element is <{tag[:60]}>; {wanted}")
        parser.StartElementHandler = begin
        begin(tag, attributes)

    parser.StartElementHandler = first
    try:
        with open_plain(path) as stream:
            _parse(parser, stream)
    except _AnotherRoot as error:
        raise InputError(f"{source}: {error}") from None
    except expat.ExpatError as error:
        raise InputError(f"{source}: line {error.lineno}: malformed XML ({error}); {advice}") from None
    except (ValueError, LookupError) as error:  # LookupError: an encoding that nobody knows
        raise InputError(f"{source}: line {parser.CurrentLineNumber}: {error}") from None
    except BROKEN as error:
        raise InputError(f"{source}: cannot be unpacked ({error})") from None


class _AnotherRoot(Exception):
    """The file is of another kind."""


def _parse(parser: expat.XMLParserType, stream: IO[bytes]) -> None:
    """Feed a stream to a parser as long as no element is longer than any that SUMO writes."""
    fed = 0
    while block := stream.read(BLOCK):
        parser.Parse(block)
        fed += len(block)
        if fed - parser.CurrentByteIndex > LONGEST_ELEMENT:
            raise ValueError(f"an element of more than {LONGEST_ELEMENT >> 20} MB; SUMO writes none of that length")
    parser.Parse(b"", True)


def _no_entities(name: str, *_: object) -> None:
    raise ValueError(f"declares an entity {shown(name)}, which SUMO never does")
