#!/usr/bin/env bash
# Make the environment, then run ruff, the import layers, mypy and every test; arguments go to pytest.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
venv=$(./scripts/setup.sh blender,dev,lab)
"$venv/bin/ruff" check .
"$venv/bin/lint-imports"
# Types on every platform: names that one of them lacks show here. One after the other is as fast as all at once.
for platform in linux win32 darwin; do
    "$venv/bin/python" -m mypy --platform "$platform" --cache-dir ".mypy_cache/$platform"
done
# All tests run in two processes, each file in one of them; tests chosen by arguments run in one.
(( $# )) || set -- --numprocesses=2 --dist=loadfile
exec "$venv/bin/python" -m pytest "$@"
