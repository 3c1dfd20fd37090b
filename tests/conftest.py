"""Settings of every test."""

from __future__ import annotations

import hypothesis

# A shared machine may be slow at any moment: time is no verdict.
hypothesis.settings.register_profile("lfsr", deadline=None, max_examples=50)
hypothesis.settings.load_profile("lfsr")
