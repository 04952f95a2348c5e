"""The error that a user can correct."""

LONGEST = 600  # characters of a message; a longer one loses its middle, and keeps the place and the remedy


class InputError(ValueError):
    """Bad input.

    The message is one line that names file, row or key and what to do about it.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(one_line(str(message)))


def one_line(text: str) -> str:
    """Return a text as one printable line of at most :data:`LONGEST` characters."""
    text = " ".join(text.split())
    if len(text) > LONGEST:
        text = f"{text[: 2 * LONGEST // 3]} ... {text[5 - LONGEST // 3 :]}"
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in text)


def shown(value: object) -> str:
    """Return a value as a message shows it, cut where it is long."""
    try:
        text = repr(value.item() if hasattr(value, "item") else value)  # numpy's numbers as plain ones
    except (ValueError, RecursionError):  # a whole number of thousands of digits has no text
        text = type(value).__name__
    return one_line(text if len(text) <= 60 else f"{text[:50]} ... ({len(text)} characters)")
