"""Staging folders: one render into a folder at a time, and nothing left of dead ones."""

from __future__ import annotations

import subprocess
import sys

import pytest

from lfsr_core.errors import LfsrError
from lfsr_core.render.staging import staging_folder

HOLDER = """
import sys, time
from pathlib import Path
from lfsr_core.render.staging import staging_folder
with staging_folder(Path(sys.argv[1])) as folder:
    print(folder, flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that renders into ``frame``, and its staging folder."""
    process = subprocess.Popen([sys.executable, "-c", HOLDER, tmp_path / "frame"], stdout=subprocess.PIPE, text=True)
    yield process, process.stdout.readline().strip()
    process.kill()


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_it_is_gone_after_the_block_also_after_an_error(tmp_path):
    with pytest.raises(ZeroDivisionError), staging_folder(tmp_path / "deep" / "frame") as folder:
        assert folder.parent == tmp_path / "deep" and folder.name.startswith(".frame-")
        raise ZeroDivisionError
    assert names(tmp_path / "deep") == []


def test_a_second_render_into_the_same_folder_is_refused(tmp_path, holder):
    with pytest.raises(LfsrError, match="another render into .*frame is under way"), staging_folder(tmp_path / "frame"):
        pass
    with staging_folder(tmp_path / "other") as folder:
        assert folder.is_dir()
    assert [str(tmp_path / name) for name in names(tmp_path)] == [holder[1]]


def test_what_a_dead_run_left_goes_with_the_next(tmp_path, holder):
    process, left = holder
    process.kill()
    process.wait()
    assert [str(tmp_path / name) for name in names(tmp_path)] == [left]
    with staging_folder(tmp_path / "frame") as folder:
        assert names(tmp_path) == [folder.name]


def test_strangers_of_a_similar_name_stay(tmp_path):
    (tmp_path / ".frame-notes").mkdir()
    with staging_folder(tmp_path / "frame"):
        pass
    assert names(tmp_path) == [".frame-notes"]
