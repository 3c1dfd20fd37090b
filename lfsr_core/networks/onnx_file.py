"""ONNX files, for programs that have no torch."""

from __future__ import annotations

from pathlib import Path

from torch import nn

from lfsr_core.files import atomic_path
from lfsr_core.networks.backends import onnx_bytes


def write(network: nn.Module, path: str | Path) -> None:
    """Write the folded network: sRGB-encoded "low" (N, 3, h, w) -> "high" (N, 3, s·h, s·w), not clipped."""
    content = onnx_bytes(network)
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)
