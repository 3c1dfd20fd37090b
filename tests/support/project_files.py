"""The files of the project, in a clone or in the sources of a release."""

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def project_files() -> list[str]:
    """Paths of every file that git has or would take, relative to the root; of all files where git knows nothing."""
    done = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT,
                          capture_output=True, text=True, check=False)
    if done.returncode or not (ROOT / ".git").exists():
        hidden = (".venv", ".git", "__pycache__", "dist", ".mypy_cache", ".pytest_cache", ".ruff_cache", ".hypothesis")
        return [path.relative_to(ROOT).as_posix() for path in sorted(ROOT.rglob("*"))
                if path.is_file() and not {*hidden} & {*path.relative_to(ROOT).parts}]
    return [path for path in done.stdout.splitlines() if (ROOT / path).is_file()]
