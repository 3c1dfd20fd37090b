# PYTHON_ARGCOMPLETE_OK
"""The program ``lfsr``, as the installed script and as ``python -m lfsr_core``."""

import _signal  # ``signal`` itself takes long to load
import sys

_signal.signal(_signal.SIGINT, _signal.SIG_DFL)  # while modules are loaded, Ctrl-C shows no traceback; main says more

from lfsr_core.cli import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main())
