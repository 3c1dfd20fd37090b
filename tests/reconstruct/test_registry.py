"""Methods of names: what runs, in which order, and what is not imported for it."""

from __future__ import annotations

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct import method_name, registry
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.registry import method


def test_a_name_is_made_of_prefilters_and_one_upscaler():
    assert [len(method(name).prefilters) for name in ("bicubic", "oidn+bicubic", "oidn")] == [0, 1, 1]
    assert method("oidn+bicubic").upscaler is method("bicubic").upscaler
    assert method("oidn").upscaler is method("none").upscaler


def test_weights_are_for_the_denoiser_or_the_network():
    low = LowResEIA(np.ones((1, 1, 2, 2, 3), np.float32), np.ones((1, 1, 2, 2, 1), np.float32), 16, 4)
    with pytest.raises(LfsrError, match="no.tza does not exist"):
        method("denoise+bilinear", "no.tza").prepare(low)
    with pytest.raises(LfsrError, match=r"weights no.tza were given, but method 'oidn\+bilinear' has none"):
        method("oidn+bilinear", "no.tza")


def test_every_name_has_what_runs():
    assert registry.CLASSICAL.keys() == method_name.CLASSICAL.keys()
    assert registry.PREFILTERS.keys() == method_name.PREFILTERS.keys()


def test_prefilters_apply_in_order():
    low = LowResEIA(np.ones((1, 1, 2, 2, 3), np.float32), np.ones((1, 1, 2, 2, 1), np.float32), 16, 4)
    marks = [lambda low: dataclasses.replace(low, color=low.color * 2),
             lambda low: dataclasses.replace(low, color=low.color + 1)]
    chosen = registry.Method(MethodName.parse("nearest"), tuple(marks), method("nearest").upscaler)
    np.testing.assert_array_equal(chosen.prepare(low).color, 3)


def test_importing_the_pipeline_imports_no_torch_and_no_blender():
    code = "import sys; from lfsr_core.metrics import compare; print({'torch', 'bpy'} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "set()"
