"""Staging folders: one render into a folder at a time, and nothing left of dead ones."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lfsr_core.base import files
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import release, remove_dead, replace_files, staging_folder, write_json
from tests.support.told import refuses

HOLDER = """
import sys, time
from pathlib import Path
from lfsr_core.base.files import staging_folder
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


def test_it_is_gone_after_the_block_also_after_an_error_and_strangers_stay(tmp_path):
    with pytest.raises(ZeroDivisionError), staging_folder(tmp_path / "deep" / "frame") as folder:
        assert folder.parent == tmp_path / "deep" and folder.name.startswith(".frame-")
        raise ZeroDivisionError
    assert names(tmp_path / "deep") == []
    (tmp_path / ".frame-notes").mkdir()
    with staging_folder(tmp_path / "frame"):
        pass
    assert names(tmp_path) == [".frame-notes", "deep"]


def test_a_second_render_into_the_same_folder_is_refused_and_what_a_dead_one_left_goes(tmp_path, holder):
    with pytest.raises(LfsrError, match="another process is writing .*frame: wait for it"), \
            staging_folder(tmp_path / "frame"):
        pass
    with staging_folder(tmp_path / "other") as folder:
        assert folder.is_dir()
    assert [str(tmp_path / name) for name in names(tmp_path)] == [holder[1]]
    process, left = holder
    process.kill()
    process.wait()
    assert [str(tmp_path / name) for name in names(tmp_path)] == [left]
    with staging_folder(tmp_path / "frame") as folder:
        assert names(tmp_path) == [folder.name]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows locks in another way")
def test_where_the_file_system_has_no_locks_the_name_is_the_lock(tmp_path, monkeypatch):
    # A network folder without locks cannot be mounted here: the call fails as the kernel makes it fail there.
    def fail(_file, _operation):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", fail)
    with staging_folder(tmp_path / "frame") as folder:
        with pytest.raises(LfsrError, match="another process is writing"), staging_folder(tmp_path / "frame"):
            pass
        assert names(tmp_path) == [folder.name]
        write_json(folder / "data.json", [1])
    assert names(tmp_path) == []


@pytest.mark.skipif(not os.path.ismount("/dev/shm"), reason="needs a mounted folder that all may write to")
def test_a_mounted_folder_has_it_inside():
    with staging_folder(Path("/dev/shm")) as folder:
        assert folder.parent == Path("/dev/shm") and folder.name.startswith(".shm-")
        with pytest.raises(LfsrError, match="another process is writing"), staging_folder(Path("/dev/shm")):
            pass
    assert not folder.exists()


def test_files_are_replaced_all_or_none(tmp_path):
    old, new = tmp_path / "frame", tmp_path / "staged"
    for folder, names in ((old, ["a.json", "a.png", "stale.exr", "other.txt"]), (new, ["a.json", "a.png", "z.png"])):
        folder.mkdir()
        for name in names:
            (folder / name).write_text(folder.name)
    (old / "z.png").mkdir()
    before = names_in(old)
    refuses(r"z\.png cannot be written \(it is a folder\)", replace_files, new, old, ["stale.exr", "a.png"])
    assert names_in(old) == before
    (old / "z.png").rmdir()
    replace_files(new, old, ["stale.exr", "a.png"])
    assert names_in(old) == {"a.json": "staged", "a.png": "staged", "other.txt": "frame", "z.png": "staged"}


def names_in(folder):
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


def test_a_released_folder_locks_nobody_out_and_goes_with_its_process(tmp_path, holder):
    process, left = holder
    release(Path(left))
    with staging_folder(tmp_path / "frame"):
        assert Path(left).is_dir()
    process.kill()
    process.wait()
    with staging_folder(tmp_path / "frame") as folder:
        assert names(tmp_path) == [folder.name]


def test_a_released_folder_that_goes_while_it_is_looked_at_locks_nobody_out(tmp_path, holder, monkeypatch):
    release(Path(holder[1]))

    def held_until_now(_lock):
        (Path(holder[1]) / "released").unlink()
        return False

    monkeypatch.setattr(files, "locks", held_until_now)
    assert remove_dead(tmp_path / "frame") == []


def test_names_that_a_system_takes_for_the_same_lock_each_other(tmp_path, monkeypatch):
    with staging_folder(tmp_path / "Frame"):
        with staging_folder(tmp_path / "frame"):
            pass
        monkeypatch.setattr(files, "_ignores_case", lambda folder: True)
        with pytest.raises(LfsrError, match="another process is writing"), staging_folder(tmp_path / "frame"):
            pass
    for name in ["a[1]", "a*", "[!x]", "ü ?"]:
        with staging_folder(tmp_path / name), pytest.raises(LfsrError, match="another process is writing"), \
                staging_folder(tmp_path / name):
            pass


@pytest.mark.parametrize("left", [[], ["in-use"], ["in-use", "finished/eia.png"], ["released"]])
def test_a_folder_goes_at_whatever_moment_its_process_was_killed(tmp_path, left):
    with staging_folder(tmp_path / "frame") as folder:
        name = folder.name
    for path in (tmp_path / name / part for part in left):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (tmp_path / name).mkdir(exist_ok=True)
    assert remove_dead(tmp_path / "frame") == [] and names(tmp_path) == []


def test_the_lock_file_is_the_last_that_goes(tmp_path, monkeypatch):
    seen = []
    real = Path.unlink
    monkeypatch.setattr(Path, "unlink", lambda path, **options: (seen.append(sorted(os.listdir(path.parent))),
                                                                 real(path, **options)))
    with staging_folder(tmp_path / "frame") as folder:
        (folder / "finished").mkdir()
        (folder / "finished" / "eia.png").touch()
        (folder / "log.txt").touch()
        release(folder)
    assert seen[-2:] == [["in-use", "released"], ["released"]] and names(tmp_path) == []
