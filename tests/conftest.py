"""Settings of every test."""

import contextlib
import gc
import os
import shutil
import signal
import tempfile

import hypothesis
import pytest

# A shared machine may be slow at any moment: time is no verdict.
hypothesis.settings.register_profile("lfsr", deadline=None, max_examples=50)
hypothesis.settings.load_profile("lfsr")

# One test process per core is the measure: threads of linear algebra beside it wait for each other (8 s became 14 s).
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

# Hardly any of the many objects of imported packages is ever garbage: to look for it took 4 % of the time.
gc.set_threshold(20_000, 20, 20)

# What tests and the programs that they start leave in the temporary folder goes with them; not pytest's own folders.
os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", tempfile.gettempdir())
TEMPORARY = tempfile.mkdtemp(prefix="lfsr-tests-")
os.environ["TMPDIR"] = tempfile.tempdir = TEMPORARY

# A suite that a shell started in the background ignores Ctrl-C, and so would every program it starts.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_unconfigure() -> None:
    """Remove the folder at the end of the session."""
    shutil.rmtree(TEMPORARY, ignore_errors=True)


@pytest.fixture
def bridge(monkeypatch):
    """Start a stand-in for Looking Glass Bridge, as ``bridge("hang:show_window")`` or ``bridge(devices=[])``."""
    from lfsr_core.exports import loopback
    from tests.support.bridge import DEVICES, stand_in

    with contextlib.ExitStack() as stack:
        def start(*faults, devices=DEVICES):
            server = stack.enter_context(stand_in(devices, *faults))
            monkeypatch.setenv(loopback.PORT_VARIABLE, str(server.server_port))
            return server
        yield start
