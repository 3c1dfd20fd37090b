"""Files appear whole or not at all, also on a disk that is really full."""

import errno
import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from lfsr_core.base import files
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path, check_name, is_forbidden, read_bytes, read_json, write_json
from tests.support.told import refuses

AS_ROOT = not hasattr(os, "geteuid") or os.geteuid() == 0


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_written_file_is_whole_readable_and_alone_and_a_folder_that_is_a_file_named(tmp_path):
    target = tmp_path / "deep" / "er" / "data.bin"
    with atomic_path(target) as temporary:
        assert temporary.parent == target.parent
        assert temporary.suffix == ".bin"
        temporary.write_bytes(b"whole")
        assert not target.exists()
    assert target.read_bytes() == b"whole"
    assert stat.S_IMODE(target.stat().st_mode) == 0o644
    assert names(target.parent) == ["data.bin"]
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
    assert target.read_bytes() == b"old"
    assert names(tmp_path) == ["data.bin"]


WRITER = """
import sys, time
from lfsr_core.base.files import atomic_path
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
    monkeypatch.setattr(files, "PAUSES", (0.0,) * 4)
    write_json(tmp_path / "data.json", 1)
    refusals[0] = 9
    with pytest.raises(LfsrError, match=r"data\.json cannot be written .*: close the program that has it open"):
        write_json(tmp_path / "data.json", 2)
    assert names(tmp_path) == ["data.json"] and read_json(tmp_path / "data.json", "a number") == 1


@pytest.mark.parametrize(("name", "forbidden"), [
    ("CON", True), ("nul.png", True), ("com1 .tar.gz", True), ("a:b", True), ("what?", True), ("end.", True),
    ("end ", True), ("CONE", False), ("com10", False), ("..", False), (".hidden", False), ("Jürgen's – 光", False)])
def test_names_that_windows_forbids(tmp_path, monkeypatch, name, forbidden):
    assert is_forbidden(name) == forbidden
    check_name(tmp_path / name / "frame")
    monkeypatch.setattr(sys, "platform", "win32")
    if forbidden:
        refuses("which forbids the name", check_name, tmp_path / name / "frame")
    else:
        check_name(tmp_path / name / "frame")


# Writes 100 kB over a small old file, and says what happened; run where that much does not fit.
OVERWRITE = """
import sys
from pathlib import Path
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import write_json
target = Path(sys.argv[1])
write_json(target, "old")
try:
    write_json(target, "x" * 100_000)
except LfsrError as error:
    print(error)
print([path.name for path in target.parent.iterdir()], target.read_text().strip())
"""


def run_overwrite(target: Path, before: tuple[str, ...] = (), **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*before, sys.executable, "-B", "-c", OVERWRITE, str(target)], capture_output=True, text=True,
                          cwd=Path(__file__).parent.parent, check=False, **options)


def test_file_size_limit_is_told_and_keeps_the_old_file(tmp_path):
    import resource  # POSIX only

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    answer = run_overwrite(tmp_path / "data.json", preexec_fn=limit)
    assert "data.json cannot be written (File too large): free some space" in answer.stdout
    assert answer.stdout.endswith("""['data.json'] "old"\n"""), answer


def test_full_disk_is_told_and_keeps_the_old_file(tmp_path):
    """A real file system of 64 KiB, mounted in a namespace of its own."""
    mount = ("unshare", "--mount", "--map-root-user", "sh", "-c",
             f"mount -t tmpfs -o size=64k tmpfs '{tmp_path}' || exit 99; exec \"$@\"", "sh")
    answer = run_overwrite(tmp_path / "data.json", mount)
    if answer.returncode == 99 or answer.stderr.startswith("unshare"):
        pytest.skip("this machine lets nobody mount; the file size limit covers the same code")
    assert "data.json cannot be written (No space left on device): free some space" in answer.stdout, answer
    assert answer.stdout.endswith("""['data.json'] "old"\n"""), answer


def test_json_round_trip_and_nan_leaves_no_file(tmp_path):
    data = {"a": [1, 2.5, None, "ü"], "b": {"c": True}}
    write_json(tmp_path / "data.json", data)
    assert read_json(tmp_path / "data.json", "a test") == data
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "nan.json", {"a": float("nan")})
    assert names(tmp_path) == ["data.json"]


@pytest.mark.parametrize("content", [
    None, b'{"a": 1', b"\xff\xff", b"[" * 1000, b"[" * 60 + b"]" * 60, b"NaN", b"[-Infinity]", b"1e999", b"9" * 5000,
    b"\xef\xbb\xbf{}", b""])
def test_unreadable_json_says_what_was_expected(tmp_path, content):
    if content is not None:
        (tmp_path / "data.json").write_bytes(content)
    said = refuses("does not exist, expected the report" if content is None else "cannot be read as the report",
                   read_json, tmp_path / "data.json", "the report")
    assert "sys.set" not in said, "advice for programmers"


def test_only_regular_files_up_to_a_size_are_read(tmp_path):
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "large").write_bytes(bytes(101))
    for path in (tmp_path, tmp_path / "fifo", Path("/dev/zero")):
        refuses("is not a regular file", read_bytes, path, "a test", 100)
    refuses("more than 100 bytes", read_bytes, tmp_path / "large", "a test", 100)
    assert read_bytes(tmp_path / "large", "a test", 101) == bytes(101)
