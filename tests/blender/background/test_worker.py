"""A child process: how it ends."""

from __future__ import annotations

import os
import time

from blender_addon.background.worker import Worker
from tests.support import panel


def test_a_worker_that_ignores_the_end_is_killed():
    deaf = Worker("Test", ["/bin/sh", "-c", "trap '' TERM; echo 'LFSR {\"stage\": \"x\"}'; while :; do sleep 9; done"],
                  dict(os.environ))
    panel.wait_for(lambda: deaf.records() or not deaf.running(), look=False)
    started = time.perf_counter()
    deaf.stop()
    assert time.perf_counter() - started < 2 and not deaf.running()
