"""The one exception that a user is meant to read."""


class LfsrError(ValueError):
    """Bad input or a missing prerequisite, told in one sentence.

    The message names the value, what was expected and what to do; command-line
    entry points print it and exit with code 2.
    """
