"""What long work has told, and the sentences with which bad input is refused."""

import re
from collections.abc import Callable
from typing import Any

import pytest

from lfsr_core.base.messages import MOST_CHARACTERS, LfsrError, Notice, Progress


class Told:
    """A ``Tell`` that keeps everything."""

    def __init__(self) -> None:
        self.progress: list[Progress] = []
        self.notices: list[Notice] = []

    def __call__(self, told: Progress | Notice) -> None:
        """Keep it."""
        if isinstance(told, Notice):
            self.notices.append(told)
        else:
            self.progress.append(told)


def refuses(pattern: str, function: Callable[..., Any], *arguments: Any, **options: Any) -> str:
    """Check that a call is refused in one short sentence in which ``pattern`` is found, and return the sentence."""
    with pytest.raises(LfsrError) as caught:
        function(*arguments, **options)
    said = str(caught.value)
    assert re.search(pattern, said) and 0 < len(said) <= MOST_CHARACTERS and "\n" not in said, said
    return said
