"""The networks by name, without PyTorch."""

from __future__ import annotations

import subprocess
import sys

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.reconstruct.networks import catalogue


def test_missing_package_is_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "lfsr_lab.networks.upscalers", raising=False)
    monkeypatch.delitem(sys.modules, "lfsr_lab.networks.engine", raising=False)
    with pytest.raises(LfsrError, match=r"need the Python package 'torch'.*install lfsr-lab\[training\]"):
        catalogue.upscaler("espcn")


def test_registry_and_contract_import_no_torch():
    code = ("import sys, lfsr_core, lfsr_core.reconstruct.registry, lfsr_core.reconstruct.networks.catalogue as n; "
            "assert n.NAMES and n.NETWORKS['paper'].weights; "
            "sys.exit('torch' in sys.modules)")
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
