"""A disk that is full: a limit on the size of each file of a process stands for it."""

import subprocess
import sys
import textwrap

PROGRAM = """import resource, sys
from lfsr_core.base.messages import LfsrError
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
try:
{code}
except LfsrError as error:
    print("refused:", error)
"""


def on_a_small_disk(most: int, code: str, *arguments: object) -> str:
    """Run ``code``, whose files may have ``most`` bytes and whose arguments begin at sys.argv[2]; what it printed."""
    program = PROGRAM.format(code=textwrap.indent(code.strip(), "    "))
    done = subprocess.run([sys.executable, "-c", program, str(most), *map(str, arguments)], capture_output=True,
                          text=True, check=False)
    return done.stdout + done.stderr
