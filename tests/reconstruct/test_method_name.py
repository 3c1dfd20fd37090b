"""Names of methods: their parts, and what follows from them."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.reconstruct.method_name import COMPARED, DEFAULT_METHOD, GONE, METHODS, PANEL_METHODS, MethodName
from lfsr_core.reconstruct.networks import catalogue


@pytest.mark.parametrize(("text", "prefilters", "upscaler", "recovers"), [
    ("bicubic", (), "bicubic", False), ("oidn+bicubic", ("oidn",), "bicubic", False),
    ("oidn", ("oidn",), "none", False), ("denoise+bilinear+epi", ("denoise",), "bilinear", True)])
def test_a_name_has_parts(text, prefilters, upscaler, recovers):
    name = MethodName.parse(text)
    assert (name.text, name.prefilters, name.upscaler, name.recovers) == (text, prefilters, upscaler, recovers)
    assert str(name) == text and MethodName.parse(name) is name


def test_blanks_do_not_count():
    assert MethodName.parse(" oidn + lanczos") == MethodName.parse("oidn+lanczos")


@pytest.mark.parametrize(("text", "message"), [
    ("oidn+bicubik", "unknown method 'bicubik': did you mean 'bicubic'"), ("oidn+", "unknown method ''"),
    ("bicubic+oidn", "put one upscaler last"), ("epi", "has no upscaler before 'epi': use 'bilinear"),
    ("oidn+epi+bicubic", "has 'epi' before its last part")])
def test_names_that_are_refused(text, message):
    with pytest.raises(LfsrError, match=message):
        MethodName.parse(text)


def test_names_that_others_use_are_names():
    for text in (DEFAULT_METHOD, *COMPARED, *PANEL_METHODS):
        assert MethodName.parse(text).text == text
    assert {"nearest", "bicubic-eia", "none", "denoise", "oidn", "fsrcnn", "epi"} <= METHODS.keys()


@pytest.mark.parametrize(("text", "replaced"), [
    ("oidn-both+refine+epi", "denoise+bilinear+epi"), ("oidn-guided+bicubic", "denoise+bilinear+epi"),
    ("light", "denoise+bilinear+epi"), ("oidn-both+refine", "denoise+bilinear+epi"),
    ("oidn-half+paper", "denoise+bilinear+epi"),
    ("oidn-fast", "denoise"), ("oidn-guided", "denoise")])
def test_a_method_that_is_gone_names_what_replaced_it(text, replaced):
    with pytest.raises(LfsrError, match=f"^method '{re.escape(text)}' is gone since version .*: "
                                        f"'{re.escape(replaced)}' replaced it$"):
        MethodName.parse(text)
    assert not GONE.keys() & METHODS.keys() and MethodName.parse(replaced).text == replaced


def test_versions_are_those_of_what_a_method_is_made_of():
    assert MethodName.parse("bicubic").versions == MethodName.parse("paper").versions == {}
    assert set(MethodName.parse("oidn+bilinear").versions) == {"denoiser"}
    assert set(MethodName.parse("denoise+bilinear+epi").versions) == {"denoiser", "epi"}


def test_weights_decide_the_digest_and_classical_methods_have_none():
    digest = {text: MethodName.parse(text).weights_digest for text in
              ("oidn+bicubic", "denoise", "denoise+bicubic", "denoise+paper", "espcn", "oidn+espcn", "fsrcnn-eia",
               "fsrcnn", "paper")}
    assert digest["oidn+bicubic"] == ""
    assert digest["denoise"] == digest["denoise+bicubic"] != ""
    assert digest["denoise+paper"] not in (digest["denoise"], digest["paper"])
    assert digest["espcn"] == digest["oidn+espcn"] != ""
    assert digest["fsrcnn-eia"] == digest["fsrcnn"]
    assert digest["paper"] != digest["espcn"]


def test_a_network_works_only_at_scales_it_was_trained_for(monkeypatch):
    only_4 = dataclasses.replace(catalogue.NETWORKS["fsrcnn"], weights={4: Path("x.safetensors")})
    monkeypatch.setitem(catalogue.NETWORKS, "fsrcnn", only_4)
    name = MethodName.parse("oidn+fsrcnn")
    assert name.network is only_4 and MethodName.parse("oidn+bicubic").network is None
    assert name.works_at(4) and not name.works_at(2)
    assert MethodName.parse("bicubic").works_at(7) and not MethodName.parse("oidn").works_at(4)
    assert name.scales_of((5, 4, 2, 1)) == (4, 1) and MethodName.parse("oidn").scales_of((4, 1)) == (1,)


@pytest.mark.parametrize(("text", "left", "steps"), [
    ("bilinear", "none", 1), ("none", "none", 0), ("oidn+bilinear", "oidn", 2), ("oidn", "oidn", 1),
    ("denoise+paper", "denoise", 2), ("denoise+bilinear+epi", "denoise", 3)])
def test_what_is_left_at_scale_1_and_how_many_steps_there_are(text, left, steps):
    name = MethodName.parse(text)
    assert (name.at_scale(1).text, name.at_scale(2), name.steps) == (left, name, steps)


@pytest.mark.parametrize(("name", "other"), [("oidn+epi", "oidn+bilinear+epi"), ("oidn", "oidn+bilinear"),
                                             ("none", "bilinear")])
def test_method_that_upscales_nothing_is_told_with_one_that_does(name, other):
    MethodName.parse(name).check_scale(1)
    with pytest.raises(LfsrError, match=rf"method '{re.escape(name)}' upscales nothing.* as in '{re.escape(other)}'"):
        MethodName.parse(name).check_scale(4)
    MethodName.parse(other).check_scale(4)
