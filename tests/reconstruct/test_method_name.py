"""Names of methods: their parts, and what follows from them."""

from __future__ import annotations

import dataclasses
import re

import pytest

from lfsr_core.errors import LfsrError
from lfsr_core.reconstruct.method_name import DEFAULT_METHOD, DENOISERS, METHODS, PLAIN_CHAINS, MethodName, layers_of
from lfsr_core.reconstruct.networks import catalogue


@pytest.mark.parametrize(("text", "prefilters", "upscaler", "recovers"), [
    ("bicubic", (), "bicubic", False), ("oidn+bicubic", ("oidn",), "bicubic", False),
    ("oidn", ("oidn",), "none", False), ("oidn-both+refine+epi", ("oidn-both",), "refine", True)])
def test_a_name_has_parts(text, prefilters, upscaler, recovers):
    name = MethodName.parse(text)
    assert (name.text, name.prefilters, name.upscaler, name.recovers) == (text, prefilters, upscaler, recovers)
    assert str(name) == text and MethodName.parse(name) is name


def test_blanks_do_not_count():
    assert MethodName.parse(" oidn + lanczos") == MethodName.parse("oidn+lanczos")


@pytest.mark.parametrize(("text", "message"), [
    ("oidn+bicubik", "unknown method 'bicubik': did you mean 'bicubic'"), ("oidn+", "unknown method ''"),
    ("bicubic+oidn", "put one upscaler last"), ("epi", "has no upscaler before 'epi': use 'bilinear"),
    ("refine", "needs 'oidn-both' before 'refine'"), ("oidn+epi+bicubic", "has 'epi' before its last part")])
def test_names_that_are_refused(text, message):
    with pytest.raises(LfsrError, match=message):
        MethodName.parse(text)


def test_names_that_others_use_are_names():
    for text in (DEFAULT_METHOD, *PLAIN_CHAINS, *DENOISERS):
        assert MethodName.parse(text).text == text
    assert {"nearest", "bicubic-eia", "none", "oidn", "refine", "fsrcnn", "epi"} <= METHODS.keys()


def test_versions_are_those_of_what_a_method_is_made_of():
    assert MethodName.parse("bicubic").versions == MethodName.parse("light").versions == {}
    assert set(MethodName.parse("oidn+bilinear").versions) == {"denoiser"}
    assert set(MethodName.parse("oidn-both+refine+epi").versions) == {"denoiser", "epi"}


def test_weights_decide_the_digest_and_classical_methods_have_none():
    digest = {text: MethodName.parse(text).weights_digest for text in
              ("oidn+bicubic", "espcn", "oidn+espcn", "fsrcnn-eia", "fsrcnn", "paper")}
    assert digest["oidn+bicubic"] == ""
    assert digest["espcn"] == digest["oidn+espcn"] != ""
    assert digest["fsrcnn-eia"] == digest["fsrcnn"]
    assert digest["paper"] != digest["espcn"]


def test_layers_are_what_denoisers_and_networks_look_at(monkeypatch):
    assert layers_of(["bilinear", "oidn+bilinear"]) == ()
    assert layers_of(["bilinear", "oidn-guided+bilinear"]) == ("albedo", "normal")
    spec = dataclasses.replace(catalogue.NETWORKS["paper"], layers=("normal", "position"))
    monkeypatch.setitem(catalogue.NETWORKS, "paper", spec)
    assert layers_of(["oidn-guided+bilinear", "paper"]) == ("albedo", "normal", "position")


def test_a_network_works_only_at_scales_it_was_trained_for(monkeypatch):
    monkeypatch.setattr(catalogue, "trained_scales", lambda name: [4])
    name = MethodName.parse("oidn+fsrcnn")
    assert name.networks == ("fsrcnn",) and name.untrained(2) == ("fsrcnn",) and name.untrained(4) == ()
    assert name.works_at(4) and not name.works_at(2)
    assert MethodName.parse("bicubic").works_at(7) and not MethodName.parse("oidn").works_at(4)
    assert name.scales_of((5, 4, 2, 1)) == (4, 1) and MethodName.parse("oidn").scales_of((4, 1)) == (1,)


@pytest.mark.parametrize(("text", "left", "steps"), [
    ("bilinear", "none", 1), ("none", "none", 0), ("oidn-fast+bilinear", "oidn-fast", 2), ("oidn", "oidn", 1),
    ("oidn-both+refine+epi", "oidn", 5), ("ours+bilinear+epi", "ours", 3)])
def test_what_is_left_at_scale_1_and_how_many_steps_there_are(text, left, steps):
    name = MethodName.parse(text)
    assert (name.at_scale(1).text, name.at_scale(2), name.steps) == (left, name, steps)


def test_a_missing_guide_is_noted():
    assert MethodName.parse("oidn-guided+bilinear").guide_notes({"albedo", "normal"}) == []
    for part in ("oidn-guided", "oidn-half", "oidn-both"):
        assert f"{part} denoised without the layers normal, which" in MethodName.parse(f"{part}+bilinear").guide_notes(
            {"albedo"})[0]
    for text in ("oidn+bilinear", "oidn-both+refine"):
        assert MethodName.parse(text).guide_notes(()) == []


@pytest.mark.parametrize(("name", "other"), [("oidn+epi", "oidn+bilinear+epi"), ("oidn", "oidn+bilinear"),
                                             ("none", "bilinear")])
def test_method_that_upscales_nothing_is_told_with_one_that_does(name, other):
    MethodName.parse(name).check_scale(1)
    with pytest.raises(LfsrError, match=rf"method '{re.escape(name)}' upscales nothing.* as in '{re.escape(other)}'"):
        MethodName.parse(name).check_scale(4)
    MethodName.parse(other).check_scale(4)
