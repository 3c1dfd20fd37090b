"""The table of methods, what follows from a name, and how the stages of one are run."""

import re
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.display import load_display
from lfsr_core.reconstruct import methods
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, SUBPIXEL_METHODS, MethodName, load_method, seconds
from lfsr_core.reconstruct.second_stage import StageClock, blas_threads
from lfsr_core.reconstruct.upscaler import Interpolation, LowResEIA, Upscaler
from tests.support.told import refuses


@pytest.mark.parametrize(("text", "prefilters", "upscaler"), [("bicubic", (), "bicubic"),
    ("oidn+bicubic", ("oidn",), "bicubic"), ("oidn", ("oidn",), "none"), ("denoise+pool", ("denoise",), "pool")])
def test_a_name_has_parts(text, prefilters, upscaler):
    name = MethodName.parse(text)
    assert (name.text, name.prefilters, name.upscaler) == (text, prefilters, upscaler)
    assert str(name) == text and MethodName.parse(name) is name
    assert MethodName.parse(f" {text.replace('+', ' + ')}") == name, "blanks do not count"


def test_every_row_makes_what_it_says_and_what_follows_from_a_name():
    for name, part in methods.METHODS.items():
        assert part.text and part.kind in (methods.PREFILTER, methods.UPSCALER)
        made = part.make(*[None] * (part.kind == methods.PREFILTER))
        assert callable(made) and isinstance(made, Upscaler) == (part.kind != methods.PREFILTER), name
    for text in (DEFAULT_METHOD, *SUBPIXEL_METHODS, *methods.MENU, *methods.MORE):
        assert MethodName.parse(text).text == text
    assert MethodName.parse("bicubic").versions == {}
    assert set(MethodName.parse("oidn+bilinear").versions) == {"denoiser"}
    assert set(MethodName.parse(DEFAULT_METHOD).versions) == {"denoiser", "pool"}
    assert MethodName.parse("oidn").needs_denoiser and not MethodName.parse("pool").needs_denoiser
    assert MethodName.parse("bicubic").works_at(7) and not MethodName.parse("oidn").works_at(4)
    assert MethodName.parse("oidn").scales_of((4, 1)) == (1,)
    for text, left, steps in [
        ("bilinear", "none", 1), ("none", "none", 0), ("oidn+bilinear", "oidn", 2), ("oidn", "oidn", 1),
        ("denoise+pool", "denoise", 2)]:
        name = MethodName.parse(text)
        assert (name.at_scale(1).text, name.at_scale(2), name.steps) == (left, name, steps)
    for text, message in [
        ("oidn+bicubik", "'bicubic'"), ("oidn+", "unknown method ''"),
        ("bicubic+oidn", "put one upscaler last"), ("oidn+pool+bicubic", "has 'pool' before its last part")]:
        refuses(message, MethodName.parse, text)


@pytest.mark.parametrize(("name", "other"), [("oidn", "oidn+bilinear"), ("none", "bilinear")])
def test_method_that_upscales_nothing_is_told_with_one_that_does(name, other):
    MethodName.parse(name).check_scale(1)
    with pytest.raises(LfsrError, match=rf"method '{re.escape(name)}' upscales nothing.* as in '{re.escape(other)}'"):
        MethodName.parse(name).check_scale(4)
    MethodName.parse(other).check_scale(4)


def test_weights_are_for_the_denoiser_that_takes_them():
    low = LowResEIA(np.ones((1, 1, 2, 2, 3), np.float32), np.ones((1, 1, 2, 2, 1), np.float32), 16, 4)
    refuses("no.tza does not exist", load_method("denoise+bilinear", "no.tza").prepare, low)
    refuses(r"weights no.tza were given, but method 'oidn\+bilinear' has none", load_method, "oidn+bilinear", "no.tza")
    other = Interpolation("cubic")
    assert load_method("oidn+bilinear", upscaler=other).upscaler is other
    small, large = load_display("mini"), load_display("fhd")
    told = [seconds(small, 2, "bilinear"), seconds(large, 4, "bilinear"), seconds(large, 4, DEFAULT_METHOD),
            seconds(large, 1, "denoise")]
    assert told == sorted(told) and told[0] < told[-1] and seconds(small, 2, "denoise") > seconds(small, 2, "oidn")


def test_threads_share_the_clock():
    clock = StageClock()
    clock.threads = 2
    with ThreadPoolExecutor(2) as pool:
        def work(_):
            with clock("upscale"):
                time.sleep(0.2)
        list(pool.map(work, range(2)))
    assert clock.seconds["upscale"] == pytest.approx(0.2, abs=0.1)


def test_threads_are_limited_inside_the_block(monkeypatch):
    def threads() -> set[int]:
        return {pool["num_threads"] for pool in controller() if pool["user_api"] == "blas"}

    controller = pytest.importorskip("threadpoolctl").threadpool_info
    np.dot(np.ones((2, 2)), np.ones((2, 2)))  # a BLAS library is loaded
    before = threads()
    with blas_threads(1):
        assert threads() == {1}
    assert threads() == before
    monkeypatch.setitem(sys.modules, "threadpoolctl", None)
    with blas_threads(1):
        pass
