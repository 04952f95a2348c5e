"""What a user can put right: one line that names the place and the remedy."""


class InputError(ValueError):
    """Bad input. The message is one line: file, row or key, and what to do about it."""
