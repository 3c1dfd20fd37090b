"""Files and folders appear whole or not at all, also on a disk that is really full, and one writer at a time."""

import errno
import os
import stat
import subprocess
import sys
import tempfile
from pathlib import Path
from unittest.mock import Mock

import pytest

from lfsr_core.base import system
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import atomic_path, check_name, read_bytes, read_json, staging_folder, write_json
from lfsr_core.frames.folder import FrameFolder
from tests.support.small_disk import on_a_small_disk
from tests.support.told import refuses

AS_ROOT = not hasattr(os, "geteuid") or os.geteuid() == 0


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_written_file_is_whole_readable_and_alone_and_a_folder_that_is_a_file_named(tmp_path):
    target = tmp_path / "deep" / "er" / "data.bin"
    with atomic_path(target) as temporary:
        assert temporary.parent == target.parent and temporary.suffix == ".bin"
        temporary.write_bytes(b"whole")
        assert not target.exists()
    assert target.read_bytes() == b"whole"
    assert stat.S_IMODE(target.stat().st_mode) == 0o644 and names(target.parent) == ["data.bin"]
    before = os.umask(0o077)
    try:
        write_json(tmp_path / "data.json", {})
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "data.json").stat().st_mode) == 0o600
    (tmp_path / "file").write_text("x")
    with pytest.raises(LfsrError, match="data.bin cannot be written"), atomic_path(tmp_path / "file" / "data.bin"):
        pytest.fail("the block must not run")


@pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt])
def test_failure_keeps_the_old_file_and_leaves_nothing_else(tmp_path, failure):
    target = tmp_path / "data.bin"
    target.write_bytes(b"old")
    with pytest.raises(failure), atomic_path(target) as temporary:
        temporary.write_bytes(b"half of the ne")
        raise failure
    assert target.read_bytes() == b"old" and names(tmp_path) == ["data.bin"]


WRITER = """
import sys, time
from lfsr_core.base.system import atomic_path
with atomic_path(sys.argv[1]) as temporary:
    temporary.write_bytes(b"half of the ne")
    print(flush=True)
    time.sleep(60)
"""


def test_what_a_killed_writer_left_goes_with_the_next_and_a_living_one_keeps_its_own(tmp_path):
    target, stranger = tmp_path / "data.bin", tmp_path / ".data-original.bin"
    stranger.touch()
    writer = subprocess.Popen([sys.executable, "-c", WRITER, target], stdout=subprocess.PIPE)
    writer.stdout.readline()
    with atomic_path(target) as temporary:
        temporary.write_bytes(b"whole")
    assert len(names(tmp_path)) == 4, "what the living one writes is not touched"
    writer.kill()
    writer.wait()
    with atomic_path(target) as temporary:
        temporary.write_bytes(b"newer")
    assert names(tmp_path) == [stranger.name, "data.bin"] and target.read_bytes() == b"newer"


@pytest.mark.skipif(AS_ROOT, reason="root may write everywhere")
def test_read_only_folder_is_named(tmp_path):
    tmp_path.chmod(0o555)
    refuses("choose a folder you may write to", write_json, tmp_path / "data.json", {})


def test_a_file_that_is_held_for_a_moment_is_replaced_and_one_that_stays_held_is_told(tmp_path, monkeypatch):
    """As on Windows, where a virus scanner opens what is new."""
    real, refusals = os.replace, [2]

    def replaced(source, target):
        if refusals[0]:
            refusals[0] -= 1
            error = PermissionError(errno.EACCES, "The process cannot access the file", str(source))
            error.winerror = 32
            raise error
        real(source, target)

    monkeypatch.setattr(os, "replace", replaced)
    monkeypatch.setattr(system, "PAUSES", (0.0,) * 4)
    write_json(tmp_path / "data.json", 1)
    refusals[0] = 9
    refuses("data.json cannot be written .*: close the program that has it open", write_json, tmp_path / "data.json", 2)
    assert names(tmp_path) == ["data.json"] and read_json(tmp_path / "data.json", "a number") == 1


@pytest.mark.parametrize(("name", "forbidden"), [
    ("CON", True), ("nul.png", True), ("com1 .tar.gz", True), ("a:b", True), ("what?", True), ("end.", True),
    ("end ", True), ("CONE", False), ("com10", False), ("..", False), (".hidden", False), ("Jürgen's – 光", False)])
def test_names_that_windows_forbids(tmp_path, monkeypatch, name, forbidden):
    assert system.is_forbidden(name) == forbidden
    check_name(tmp_path / name / "frame")
    monkeypatch.setattr(sys, "platform", "win32")
    if forbidden:
        refuses("which forbids the name", check_name, tmp_path / name / "frame")
    else:
        check_name(tmp_path / name / "frame")


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX limit on file size")
def test_a_full_disk_is_told_and_keeps_the_old_file(tmp_path):
    write_json(tmp_path / "data.json", "old")
    code = "from lfsr_core.base.system import write_json\nwrite_json(sys.argv[2], 'x' * 100_000)"
    said = on_a_small_disk(20_000, code, tmp_path / "data.json")
    assert "data.json cannot be written (File too large): free some space" in said
    assert read_json(tmp_path / "data.json", "a text") == "old" and names(tmp_path) == ["data.json"]


def test_json_round_trip_of_regular_files_up_to_a_size(tmp_path):
    data = {"a": [1, 2.5, None, "ü"], "b": {"c": True}}
    write_json(tmp_path / "data.json", data)
    assert read_json(tmp_path / "data.json", "a test") == data
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "nan.json", {"a": float("nan")})
    assert names(tmp_path) == ["data.json"]
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "large").write_bytes(bytes(101))
    for path in (tmp_path, tmp_path / "fifo", Path("/dev/zero")):
        refuses("is not a regular file", read_bytes, path, "a test", 100)
    refuses("more than 100 bytes", read_bytes, tmp_path / "large", "a test", 100)
    assert read_bytes(tmp_path / "large", "a test", 101) == bytes(101)


@pytest.mark.parametrize("content", [
    None, b'{"a": 1', b"\xff\xff", b"[" * 1000, b"[" * 60 + b"]" * 60, b"NaN", b"[-Infinity]", b"1e999", b"9" * 5000,
    b"\xef\xbb\xbf{}", b""])
def test_unreadable_json_says_what_was_expected(tmp_path, content):
    if content is not None:
        (tmp_path / "data.json").write_bytes(content)
    said = refuses("does not exist, expected the report" if content is None else "cannot be read as the report",
                   read_json, tmp_path / "data.json", "the report")
    assert "sys.set" not in said, "advice for programmers"


# Staging folders: one render into a folder at a time, and nothing left of dead ones.

HOLDER = """
import sys, time
from pathlib import Path
from lfsr_core.base.system import staging_folder
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


def test_it_is_gone_after_the_block_also_after_an_error_and_strangers_stay(tmp_path):
    with pytest.raises(ZeroDivisionError), staging_folder(tmp_path / "deep" / "frame") as folder:
        assert folder.parent == tmp_path / "deep" and folder.name.startswith(".frame-")
        raise ZeroDivisionError
    assert names(tmp_path / "deep") == []
    (tmp_path / ".frame-original" / "film").mkdir(parents=True)
    with staging_folder(tmp_path / "deep" / ".." / "frame"):
        pass
    assert names(tmp_path) == [".frame-original", "deep"] and names(tmp_path / ".frame-original") == ["film"]


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
def test_a_mounted_folder_has_it_inside_and_a_link_to_one_too(tmp_path):
    (link := tmp_path / "link").symlink_to("/dev/shm")
    with staging_folder(link) as folder:
        assert folder.parent == Path("/dev/shm") == FrameFolder(link).parts.parent and folder.name.startswith(".shm-")
        with pytest.raises(LfsrError, match="another process is writing"), staging_folder(Path("/dev/shm")):
            pass
    assert not folder.exists()


def test_where_it_cannot_move_files_it_is_inside_and_where_it_cannot_write_it_is_refused(tmp_path, monkeypatch):
    # Neither a second mount of this disk nor a read-only one can be made here: the calls fail as they fail there.
    (tmp_path / "frame").mkdir()
    monkeypatch.setattr(system.os, "rename", Mock(side_effect=OSError(errno.EXDEV, "Invalid cross-device link")))
    with staging_folder(tmp_path / "frame") as folder:
        assert folder.parent == tmp_path / "frame"
    monkeypatch.setattr(tempfile, "TemporaryFile", Mock(side_effect=OSError(errno.EROFS, "Read-only file system")))
    refuses("frame cannot be written .Read-only", staging_folder(tmp_path / "frame").__enter__)
    refuses("choose a shorter name", staging_folder(tmp_path / ("n" * 255)).__enter__)


def test_files_are_replaced_all_or_none(tmp_path):
    old, new = tmp_path / "frame", tmp_path / "staged"
    for folder, names in ((old, ["a.json", "a.png", "stale.exr", "other.txt"]), (new, ["a.json", "a.png", "z.png"])):
        folder.mkdir()
        for name in names:
            (folder / name).write_text(folder.name)
    (old / "z.png").mkdir()
    before = names_in(old)
    refuses(r"z\.png cannot be written \(it is a folder\)", system.replace_files, new, old, ["stale.exr", "a.png"])
    assert names_in(old) == before
    (old / "z.png").rmdir()
    system.replace_files(new, old, ["stale.exr", "a.png"])
    assert names_in(old) == {"a.json": "staged", "a.png": "staged", "other.txt": "frame", "z.png": "staged"}


def names_in(folder):
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


def test_a_released_folder_locks_nobody_out_and_goes_with_its_process(tmp_path, holder):
    process, left = holder
    Path(left, system.RELEASED_FILE).touch()
    with staging_folder(tmp_path / "frame"):
        assert Path(left).is_dir()
    process.kill()
    process.wait()
    with staging_folder(tmp_path / "frame") as folder:
        assert names(tmp_path) == [folder.name]


def test_a_released_folder_that_goes_while_it_is_looked_at_locks_nobody_out(tmp_path, holder, monkeypatch):
    Path(holder[1], system.RELEASED_FILE).touch()

    def held_until_now(_lock):
        (Path(holder[1]) / "released").unlink()
        return False

    monkeypatch.setattr(system, "locks", held_until_now)
    assert system.remove_dead(tmp_path / "frame") == []


def test_names_that_a_system_takes_for_the_same_lock_each_other_and_the_lock_goes_last(tmp_path, monkeypatch):
    with staging_folder(tmp_path / "Frame"):
        with staging_folder(tmp_path / "frame"):
            pass
        monkeypatch.setattr(system.os.path, "exists", lambda swapped: True)
        with pytest.raises(LfsrError, match="another process is writing"), staging_folder(tmp_path / "frame"):
            pass
    for name in ["a[1]", "a*", "[!x]", "ü ?"]:
        with staging_folder(tmp_path / name), pytest.raises(LfsrError, match="another process is writing"), \
                staging_folder(tmp_path / name):
            pass
    seen, real = [], Path.unlink
    monkeypatch.setattr(Path, "unlink", lambda path, **options: (seen.append(sorted(os.listdir(path.parent))),
                                                                 real(path, **options)))
    with staging_folder(tmp_path / "frame") as folder:
        (folder / "finished").mkdir()
        (folder / "finished" / "eia.png").touch()
        (folder / "log.txt").touch()
        (folder / system.RELEASED_FILE).touch()
    assert seen[-2:] == [["in-use", "released"], ["released"]] and names(tmp_path) == []


@pytest.mark.parametrize("left", [[], ["in-use"], ["in-use", "finished/eia.png"], ["released"], ["finished/eia.png"]])
def test_a_folder_goes_at_whatever_moment_its_process_was_killed(tmp_path, left):
    with staging_folder(tmp_path / "frame") as folder:
        name = folder.name
    for path in (tmp_path / name / part for part in left):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (tmp_path / name).mkdir(exist_ok=True)
    assert system.remove_dead(tmp_path / "frame") == [] and names(tmp_path) == []
