"""What networks cost, against formulas."""

from __future__ import annotations

import pytest
from torch import nn

from lfsr_lab.networks.networks import ESPCN, FSRCNN, PaperGenerator, multiply_adds, parameters


@pytest.mark.parametrize(("network", "expected"), [
    (PaperGenerator(4), 25 * 3 * 32 + 9 * 32 * 16 + 81 * 16 * 3),
    (FSRCNN(4), 25 * 3 * 56 + 56 * 12 + 4 * 9 * 12 * 12 + 12 * 56 + 81 * 56 * 3),
    (ESPCN(4), 25 * 3 * 64 + 9 * 64 * 32 + 9 * 32 * 48),
    (nn.Sequential(nn.Conv2d(3, 8, 3, padding=1, groups=1), nn.Conv2d(8, 8, 3, padding=1, groups=4)),
     9 * 3 * 8 + 9 * 8 * 2),
])
def test_multiply_adds_are_those_of_the_formula(network, expected):
    assert multiply_adds(network, 10, 6) == expected


def test_parameters_of_espcn():
    assert parameters(ESPCN(4)) == (75 + 1) * 64 + (576 + 1) * 32 + (288 + 1) * 48
