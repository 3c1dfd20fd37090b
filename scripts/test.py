"""Make the environment, then run ruff, the import layers, mypy and every test; arguments go to pytest."""

from __future__ import annotations

import sys

from setup import program, ready, run

PLATFORMS = ("linux", "win32", "darwin")


def main(arguments: list[str]) -> None:
    """Run everything in turn; the first failure ends the program with its exit code."""
    folder = ready("blender,dev,lab")
    python = program(folder, "python")
    run([program(folder, "ruff"), "check", "."])
    run([program(folder, "lint-imports")])
    # Types on every platform: names that one of them lacks show here. One after the other is as fast as all at once.
    for platform in PLATFORMS:
        run([python, "-m", "mypy", "--platform", platform, "--cache-dir", f".mypy_cache/{platform}"])
    # All tests run in two processes, each file in one of them; tests chosen by arguments run in one.
    run([python, "-m", "pytest", *(arguments or ["--numprocesses=2", "--dist=loadfile"])])


if __name__ == "__main__":
    main(sys.argv[1:])
