"""The error that a user can correct."""


class InputError(ValueError):
    """Bad input.

    The message is one line that names file, row or key and what to do about it.
    """
