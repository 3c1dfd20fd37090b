"""Scripts run in Blender: what they make is there, and a failure is one sentence."""

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.process.blender import Blender
from lfsr_lab.scenes import run_script


@pytest.fixture
def script(tmp_path):
    def write(body):
        (tmp_path / "script.py").write_text(body, encoding="utf-8")
        return tmp_path / "script.py"
    return write


def test_a_script_gets_its_argument_and_makes_its_product(tmp_path, script):
    product = tmp_path / "product"
    writer = script("import pathlib, sys; pathlib.Path(sys.argv[-1]).write_text('made')")
    run_script(Blender(), writer, product, [product])
    assert product.read_text() == "made"


@pytest.mark.parametrize(("body", "message"), [
    ("""print('LFSR {"stage": "error", "message": "too deep"}'); raise SystemExit(2)""", "^too deep$"),
    ("raise RuntimeError('no memory')", r"in script\.py without writing .*product with exit code 1 .*no memory"),
    ("""print('LFSR {"stage": "scene"}')""", r"in script\.py without writing .*product with exit code 0")])
def test_a_script_that_fails_is_reported(tmp_path, script, body, message):
    with pytest.raises(LfsrError, match=message):
        run_script(Blender(), script(body), tmp_path / "job.json", [tmp_path / "product"])


def test_a_script_that_fails_after_its_work_is_reported(tmp_path, script):
    with pytest.raises(LfsrError, match="in script.py with exit code 3 before it was done: "):
        run_script(Blender(), script("raise SystemExit(3)"), tmp_path / "job.json", [])
