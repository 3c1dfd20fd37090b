"""Scripts run in Blender: what they make is there, and a failure is one sentence."""

import pytest

from lfsr_core.process.child import Blender
from lfsr_lab.scenes import run_script
from tests.support.told import refuses


@pytest.mark.parametrize(("body", "message"), [
    ("import pathlib, sys; pathlib.Path(sys.argv[-1]).write_text('made')", None),
    ("""print('LFSR {"stage": "error", "message": "too deep"}'); raise SystemExit(2)""", "^too deep$"),
    ("raise RuntimeError('no memory')", r"in script\.py without writing .*product with exit code 1 .*no memory"),
    ("""print('LFSR {"stage": "scene"}')""", r"in script\.py without writing .*product with exit code 0"),
    ("import pathlib, sys; pathlib.Path(sys.argv[-1]).touch(); raise SystemExit(3)",
     "in script.py with exit code 3 before it was done: ")])
def test_a_script_gets_its_argument_and_one_that_fails_or_makes_nothing_is_reported(tmp_path, body, message):
    script, product = tmp_path / "script.py", tmp_path / "product"
    script.write_text(body, encoding="utf-8")
    if message is None:
        run_script(Blender(), script, product, [product])
        assert product.read_text() == "made"
    else:
        refuses(message, run_script, Blender(), script, product, [product])
