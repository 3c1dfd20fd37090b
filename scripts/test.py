"""Make the environment, then run ruff, the import layers, mypy and every test; arguments go to pytest.

``--fast`` is for work: the tests that start no Blender, browser or cluster. With it, and with arguments, mypy checks
this platform alone.
"""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from setup import ROOT, program, ready, run

IN_THREE = ("--numprocesses=3", "--dist=worksteal")  # of which one waits for a browser, a disk or a child process
FAST = ("base", "commands", "docs", "exports", "frames", "images", "metrics", "optics", "pipeline", "plan", "process",
        "reconstruct")
NOT_FAST = ("docs/test_python.py", "exports/test_viewer.py", "pipeline/test_cluster.py")


def main(arguments: list[str]) -> None:
    """Run everything in turn; the first failure ends the program with its exit code."""
    is_fast = "--fast" in arguments
    chosen = [argument for argument in arguments if argument != "--fast"]
    folder = ready("blender,dev,lab")
    python = program(folder, "python")
    run([program(folder, "ruff"), "check", "."])
    run([program(folder, "lint-imports")])
    # Types of everything here, and at once of the product on every platform: names that one of them lacks show here.
    # Packages are the same there: reading numpy again would take two thirds of the time.
    others = [] if is_fast or chosen else [name for name in ("linux", "win32", "darwin") if name != sys.platform]
    alike = ("--no-site-packages", "--disable-error-code=unused-ignore", "lfsr_core", "blender_addon")
    types = ([python, "-m", "mypy", "--platform", name, "--cache-dir", f".mypy_cache/{name}", *words]
             for name, *words in ([sys.platform], *([name, *alike] for name in others)))
    with ThreadPoolExecutor(2) as threads:
        if others:  # Python keeps what it compiles of all tests, which otherwise each of their processes would do
            threads.submit(lambda: subprocess.run([python, "-m", "pytest", "--collect-only"], cwd=ROOT, check=False,
                                                  stdout=subprocess.DEVNULL))
        list(threads.map(run, types))
    # All tests run in three processes, a third of the files in each until one is done and takes from the others' rest;
    # tests chosen by arguments run in one.
    if is_fast:
        chosen += [*IN_THREE, "-m", "not long and not slow", *(f"--ignore=tests/{name}" for name in NOT_FAST),
                   *(f"tests/{name}" for name in FAST)]
    run([python, "-m", "pytest", *(chosen or IN_THREE)])


if __name__ == "__main__":
    main(sys.argv[1:])
