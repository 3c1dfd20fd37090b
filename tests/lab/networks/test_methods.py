"""Names of methods with a network as their upscaler."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.reconstruct.second_stage import finished_linear
from lfsr_lab.networks import methods
from lfsr_lab.networks.methods import LabMethod, ready
from tests.support.synthetic import FLAT, write_render


def test_plain_interpolation_stands_for_a_network():
    method = LabMethod.parse("oidn+fsrcnn")
    assert (method.name.text, method.network) == ("oidn+bilinear", "fsrcnn")
    assert LabMethod.parse("denoise+bicubic").network is None and ready("denoise+bicubic")[1] is None


@pytest.mark.parametrize(("text", "message"), [
    ("fsrcn", "did you mean 'fsrcnn'"), ("fsrcnn+bicubic", "put it last"), ("paper+pool", "put it last"),
    ("bicubic+oidn", "put one upscaler last")])
def test_names_that_are_refused(text, message):
    with pytest.raises(LfsrError, match=message):
        LabMethod.parse(text)


def test_weights_decide_the_digest_and_classical_methods_have_none():
    digest = {text: LabMethod.parse(text).weights_digest for text in
              ("oidn+bicubic", "denoise", "denoise+bicubic", "denoise+paper", "espcn", "oidn+espcn", "fsrcnn-eia",
               "fsrcnn", "paper")}
    assert digest["oidn+bicubic"] == ""
    assert digest["denoise"] == digest["denoise+bicubic"] != ""
    assert digest["denoise+paper"] not in (digest["denoise"], digest["paper"])
    assert digest["espcn"] == digest["oidn+espcn"] != "" and digest["fsrcnn-eia"] == digest["fsrcnn"]
    assert digest["paper"] != digest["espcn"]


def test_a_network_works_only_at_scales_it_was_trained_for(monkeypatch):
    only_4 = dataclasses.replace(methods.NETWORKS["fsrcnn"], weights={4: Path("x.safetensors")})
    monkeypatch.setitem(methods.NETWORKS, "fsrcnn", only_4)
    assert LabMethod.parse("oidn+fsrcnn").works_at(4) and not LabMethod.parse("oidn+fsrcnn").works_at(2)


def test_a_network_wants_views_along_both_axes(tmp_path):
    pytest.importorskip("torch")
    finish, upscaler = ready("paper")
    with pytest.raises(LfsrError, match="'paper' needs views in two directions"):
        finished_linear(write_render(tmp_path, display=FLAT), finish, upscaler=upscaler)
    with pytest.raises(LfsrError, match="'paper' needs views in two directions"):
        LabMethod.parse("paper").check_parallax((True, False))


def test_a_missing_package_is_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "lfsr_lab.networks.upscalers", raising=False)
    with pytest.raises(LfsrError, match=r"need the Python package 'torch'.*install lfsr-lab\[training\]"):
        ready("espcn")


def test_names_are_known_without_torch():
    code = ("import sys; from lfsr_lab.networks.methods import LabMethod; LabMethod.parse('paper'); "
            "sys.exit('torch' in sys.modules)")
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
