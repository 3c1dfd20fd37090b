"""Settings of every test."""

from __future__ import annotations

import signal

import hypothesis

# A shared machine may be slow at any moment: time is no verdict.
hypothesis.settings.register_profile("lfsr", deadline=None, max_examples=50)
hypothesis.settings.load_profile("lfsr")

# A suite that a shell started in the background ignores Ctrl-C, and so would every program it starts.
signal.signal(signal.SIGINT, signal.default_int_handler)
