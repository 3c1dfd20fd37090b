"""The exception for users, and the hint for misspelled names."""

import difflib
from collections.abc import Iterable

MOST_CHARACTERS = 300


class LfsrError(ValueError):
    """Bad input or a missing prerequisite, reported in one sentence.

    The message names the value, what was expected and what to do; commands print it and exit with code 2. One longer
    than MOST_CHARACTERS loses its middle, because it begins with what is wrong and ends with what to do.
    """

    def __init__(self, message: str) -> None:
        message = " ".join(message.splitlines())
        if len(message) > MOST_CHARACTERS:
            message = f"{message[:MOST_CHARACTERS // 2]}…{message[1 - MOST_CHARACTERS // 2:]}"
        super().__init__(message)


def did_you_mean(value: str, choices: Iterable[str], cutoff: float = 0.6) -> str:
    """Return ``did you mean 'x'? `` for the choice most like ``value``, "" where none is like it.

    ``cutoff`` in [0, 1]: the least likeness, as in ``difflib``.
    """
    near = difflib.get_close_matches(value, list(choices), n=1, cutoff=cutoff)
    return f"did you mean {near[0]!r}? " if near else ""
