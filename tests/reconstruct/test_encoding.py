"""The working domain: there and back."""

from __future__ import annotations

import numpy as np

from lfsr_core.reconstruct.encoding import decode, encode


def test_domain_round_trip_and_highlights():
    values = np.concatenate([np.linspace(0, 1, 101), np.geomspace(1, 6e4, 100)]).astype(np.float32)
    np.testing.assert_allclose(decode(encode(values)), values, rtol=1e-5, atol=1e-7)
    assert (np.diff(encode(values)) >= 0).all()
    assert (decode(np.float32([-0.3, 0])) == 0).all()
