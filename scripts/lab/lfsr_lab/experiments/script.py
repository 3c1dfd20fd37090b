"""How the measuring scripts end."""

from __future__ import annotations

import sys
from collections.abc import Callable

from lfsr_core.errors import LfsrError

STOPPED, BAD_INPUT = 130, 2


def exit_code(name: str, action: Callable[[], object]) -> int:
    """Do ``action`` of the script ``name``: 0, 2 with a sentence after bad input, 130 after Ctrl-C."""
    try:
        action()
    except LfsrError as error:
        print(f"{name}: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f"{name}: stopped; run the same command again to go on", file=sys.stderr)
        return STOPPED
    return 0
