"""What ``import lfsr_core`` offers, and what it does not load."""

import subprocess
import sys

import pytest

import lfsr_core


@pytest.mark.parametrize("name", lfsr_core.__all__)
def test_every_public_name_is_there_and_documented(name):
    value = getattr(lfsr_core, name)
    assert name in dir(lfsr_core)
    assert isinstance(value, str) or value.__doc__


def test_the_list_of_names_is_complete():
    assert {*lfsr_core.__all__} == {"__version__", *lfsr_core._HOMES}


def test_unknown_names_are_no_attributes():
    with pytest.raises(AttributeError, match="no attribute 'finish_frames'"):
        _ = lfsr_core.finish_frames


def test_importing_the_package_loads_nothing_heavy():
    code = "import sys, lfsr_core; print(sorted({'numpy', 'torch', 'bpy', 'OpenImageIO'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
