"""``lfsr compare`` from its arguments to its table."""

import json
import subprocess
import sys

import pytest

from lfsr_core.cli import main
from lfsr_core.metrics.eia_metrics import METRIC_NAMES, SAMPLED_NAMES
from tests.support.synthetic import fails, write_reference, write_render


@pytest.mark.parametrize("lenses", [None, tuple((row, column) for row in range(3, 9) for column in range(4, 12))])
def test_compare_writes_and_prints_every_metric_also_in_a_python_without_flip(tmp_path, capsys, lenses):
    """A Python that has no flip-evaluator, as Blender's, compares all the same."""
    folder, reference = write_render(tmp_path / "frame"), write_reference(tmp_path / "reference", lens_list=lenses)
    main(["upscale", str(folder), "--method", "bicubic"])
    capsys.readouterr()
    assert main(["compare", str(folder), str(reference)]) == 0
    printed = capsys.readouterr().out
    metrics = json.loads((folder / "report.json").read_text())["metrics"]
    names = METRIC_NAMES if lenses is None else SAMPLED_NAMES
    assert set(names) <= set(metrics)
    for name in names:
        assert (name in printed.split()) == (metrics[name] is not None)
    part = "eia" if lenses is None else "lens"
    assert 1 > metrics[f"ssim_{part}"] > metrics[f"ssim_{part}_fg"] > 0.5, "the background is easy"
    assert ("±" in printed) == (lenses is not None)
    source = ("import sys; sys.modules['flip_evaluator'] = None; from lfsr_core.cli import main; "
              f"sys.exit(main(['compare', {str(folder)!r}, {str(reference)!r}]))")
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, check=True)
    assert "FLIP was not computed" in done.stdout and "flip  " not in done.stdout
    without = json.loads((folder / "report.json").read_text())["metrics"]
    assert without["flip"] is None and without["notes"] == [{"code": "flip-missing", "values": {}}]
    left_out = ("flip", "notes", "ci95")
    assert {name: without[name] for name in without if name not in left_out} == {
        name: metrics[name] for name in metrics if name not in left_out}


@pytest.mark.parametrize("lenses", [((5, 7),), ((0, 0),), ((5, 7), (5, 8))])
def test_compare_tells_what_it_can_from_very_few_lenses(tmp_path, capsys, lenses):
    folder, reference = write_render(tmp_path / "frame"), write_reference(tmp_path / "reference", lens_list=lenses)
    main(["upscale", str(folder), "--method", "bicubic"])
    capsys.readouterr()
    assert main(["compare", str(folder), str(reference)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("p ")
    assert "None" not in printed


def test_compare_scores_the_truth_as_perfect_whatever_the_noise_of_the_reference(tmp_path):
    folder = write_render(tmp_path / "frame", scale=1)
    reference = write_reference(tmp_path / "reference", noise=0.2)
    main(["upscale", str(folder), "--method", "none"])
    main(["compare", str(folder), str(reference)])
    metrics = json.loads((folder / "report.json").read_text())["metrics"]
    assert metrics["ssim_eia"] == pytest.approx(1, abs=0.02)
    assert metrics["ssim_ceiling"] < 0.95
    assert metrics["ssim_eia_plain"] < 0.97


def test_compare_tells_a_better_method_from_a_worse_one(tmp_path):
    folder, reference = write_render(tmp_path / "frame"), write_reference(tmp_path / "reference")
    scores = {}
    for method in ("nearest", "bicubic"):
        main(["upscale", str(folder), "--method", method])
        main(["compare", str(folder), str(reference)])
        scores[method] = json.loads((folder / "report.json").read_text())["metrics"]
    assert scores["bicubic"]["ssim_eia_fg"] > scores["nearest"]["ssim_eia_fg"]
    assert scores["bicubic"]["psnr_fg"] > scores["nearest"]["psnr_fg"]


@pytest.mark.parametrize("changes", [{"convention": "paper"}, {"frame": 2},
                                     {"matrix_world": ((1.0, 0, 0, 0.5), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))}])
def test_mismatched_reference_is_refused(tmp_path, capsys, changes):
    folder, reference = write_render(tmp_path / "frame"), write_reference(tmp_path / "reference", **changes)
    main(["upscale", str(folder), "--method", "nearest"])
    capsys.readouterr()
    assert main(["compare", str(folder), str(reference)]) == 2
    assert "reference" in capsys.readouterr().err
    assert json.loads((folder / "report.json").read_text())["metrics"] == {}


def test_compare_before_upscale_or_with_a_frame_instead_of_a_reference_is_refused(tmp_path, capsys):
    folder, reference = write_render(tmp_path / "frame"), write_reference(tmp_path / "reference")
    assert "report.json does not exist" in fails(["compare", str(folder), str(reference)], capsys)
    main(["upscale", str(folder), "--method", "nearest"])
    capsys.readouterr()
    assert "scale 2" in fails(["compare", str(folder), str(folder)], capsys)
