"""The sRGB curve for tensors."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lfsr_core.images import srgb
from lfsr_lab.networks.srgb import srgb_decode, srgb_encode


def test_srgb_curve_and_back():
    values = torch.linspace(0, 1, 101)
    torch.testing.assert_close(srgb_decode(srgb_encode(values)), values, atol=1e-6, rtol=1e-5)
    assert float(srgb_encode(torch.tensor(0.5))) == pytest.approx(0.7354, abs=1e-4)


def test_tensors_and_arrays_go_through_the_same_curve():
    values = np.linspace(-0.5, 1.5, 1001, dtype=np.float32)
    np.testing.assert_allclose(srgb_encode(torch.from_numpy(values)).numpy(), srgb.srgb_encode(values), atol=1e-6)
    np.testing.assert_allclose(srgb_decode(torch.from_numpy(values)).numpy(), srgb.srgb_decode(values), atol=1e-6)
