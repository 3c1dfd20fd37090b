"""``lfsr chart`` on frame folders: measured, resumed, refused; and once with Blender."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lfsr_core.cli import main
from lfsr_core.errors import LfsrError
from lfsr_core.metrics import eia_metrics
from lfsr_core.reconstruct.method_name import DEFAULT_METHOD
from lfsr_core.reconstruct.registry import method
from lfsr_core.render.content import FORMAT as CONTENT_FORMAT
from lfsr_core.render.staging import staging_folder
from lfsr_lab.experiments.chart import cells as chart_cells
from lfsr_lab.experiments.chart.settings import Settings, default_methods
from lfsr_lab.experiments.engine import accuracy, timing
from tests.support.chart_example import example
from tests.support.chart_folder import arguments, experiment_folder, main_fails, measured
from tests.support.prerequisites import needs_bpy
from tests.support.synthetic import fails, write_render

ROOT = Path(__file__).parents[4]
LENSES = tuple((row, column) for row in range(2, 8) for column in range(3, 11))


@pytest.fixture
def no_start(monkeypatch):
    """Starting programs is tested once; elsewhere it would only take time."""
    monkeypatch.setattr(chart_cells, "upscale_seconds", lambda folder, name: 1.25)


@pytest.fixture
def counted(monkeypatch):
    """Names of the methods that were really run and timed."""
    runs = []
    real = timing.upscale_frame

    def run(folder, name):
        runs.append(name)
        return real(folder, name)

    monkeypatch.setattr(timing, "upscale_frame", run)
    return runs


def test_every_cell_is_measured_and_the_renders_are_left_as_they_were(tmp_path, counted, capsys):
    folder = experiment_folder(tmp_path)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert main(arguments(folder)) == 0
    chart = measured(folder)
    cells = chart["scenes"][0]["cells"]
    assert [(cell["role"], cell["method"], cell["samples"]) for cell in cells] == [
        ("low", "bicubic", 1), ("low", "nearest", 1), ("low", "bicubic", 4), ("low", "nearest", 4),
        ("direct", "none", 1), ("direct", "oidn", 1)]
    assert len(counted) == 2 * len(cells)
    assert counted == [cell["method"] for cell in cells for _ in range(2)]
    for cell in cells:
        assert len(cell["second_stage_seconds"]) == 2 and min(cell["second_stage_seconds"]) > 0
        assert cell["render_seconds"] == [{"direct": 9.0}.get(cell["role"], cell["samples"])]
        assert 0 < cell["seconds"]["least"] - cell["render_seconds"][0] <= cell["seconds"]["most"]
        assert 0 < cell["ci95"]["ssim_eia_fg"] < 0.3 and cell["metrics"]["recall"] == 1
    scores = {cell["method"]: cell["metrics"]["ssim_eia_fg"] for cell in cells}
    assert scores["none"] > scores["bicubic"] > scores["nearest"]
    assert all(cost["fresh_process_seconds"] > 0 for cost in chart["methods"])
    assert {path: path.read_bytes() for path in before} == before
    assert set(capsys.readouterr().out.split()) == {str(folder / f"chart.{kind}") for kind in
                                                    ("json", "html", "svg", "md")}
    assert not list(folder.rglob(".scratch-*"))


def test_what_is_measured_is_not_measured_again_unless_asked_or_changed(tmp_path, counted, no_start):
    folder = experiment_folder(tmp_path)
    main(arguments(folder))
    first = measured(folder)
    counted.clear()
    main(arguments(folder))
    assert counted == [] and measured(folder) == first
    main(arguments(folder, "--again", "nearest"))
    assert counted == ["nearest"] * 4
    counted.clear()
    write_render(folder / "vase" / "s2-spp4", samples=4, seed=7)
    main(arguments(folder))
    assert counted == ["bicubic"] * 2 + ["nearest"] * 2


def test_times_are_taken_afresh_without_the_metrics(tmp_path, counted, no_start, monkeypatch):
    folder = experiment_folder(tmp_path)
    main(arguments(folder))
    before = measured(folder)["scenes"][0]["cells"]
    counted.clear()
    monkeypatch.setattr(accuracy, "compare", None)
    assert main(arguments(folder, "--retime", "all")) == 0
    assert counted == [name for cell in before for name in [cell["method"]] * 3], "one run is not counted"
    after = measured(folder)["scenes"][0]["cells"]
    assert [cell["metrics"] for cell in after] == [cell["metrics"] for cell in before]
    main(arguments(folder, "--repeats", "3"))
    assert all(len(cell["second_stage_seconds"]) == 3 for cell in measured(folder)["scenes"][0]["cells"])


def test_renders_are_timed_afresh_once_and_kept(tmp_path, no_start, monkeypatch):
    folder = experiment_folder(tmp_path)
    (tmp_path / "vase.blend").touch()
    times = iter([5.0, 6.0, 7.0, 8.0, 9.0, 10.0])
    monkeypatch.setattr(timing, "_timed_again", lambda *_: next(times))
    words = [word for word in arguments(folder, "--render-repeats", "2", scenes=(str(tmp_path / "vase.blend"),))
             if word != "--only-measure"]

    def seconds():
        cells = measured(folder)["scenes"][0]["cells"]
        return [cell["render_seconds"] for cell in cells if cell["method"] in ("bicubic", "none")]

    assert main(words) == 0 and seconds() == [[1, 5], [4, 6], [9, 7]]
    times = iter([1.5, 1.6, 2.5, 2.6, 3.5, 3.6])
    for _ in range(2):
        assert main([*words, "--retime-renders"]) == 0 and seconds() == [[1.5, 1.6], [2.5, 2.6], [3.5, 3.6]]
    assert main(words) == 0 and seconds()[0] == [1.5, 1.6]
    write_render(folder / "vase" / "s2-spp1", samples=1, seconds={"open": 0.5, "render": 1.25})
    main(arguments(folder))
    assert seconds()[0] == [1.25], "times of another render are forgotten"


def test_an_interrupted_chart_goes_on_where_it_stopped(tmp_path, counted, no_start, monkeypatch):
    folder = experiment_folder(tmp_path)
    real = chart_cells.finished_linear

    def stop_at_oidn(copy, name):
        if name == "oidn":
            raise KeyboardInterrupt
        return real(copy, name)

    monkeypatch.setattr(chart_cells, "finished_linear", stop_at_oidn)
    assert main(arguments(folder)) == 130
    assert not (folder / "chart.json").exists() and not list(folder.rglob(".scratch-*"))
    monkeypatch.setattr(chart_cells, "finished_linear", real)
    counted.clear()
    assert main(arguments(folder)) == 0
    assert counted == ["oidn"] * 2


def test_sampled_lenses_have_intervals_and_no_views(tmp_path, no_start, monkeypatch):
    monkeypatch.setattr(eia_metrics, "flip_evaluator", None)  # FLIP of single lenses takes a minute
    folder = experiment_folder(tmp_path, lens_list=LENSES)
    assert main(arguments(folder)) == 0
    scene = measured(folder)["scenes"][0]
    assert scene["reference"]["lenses"] == len(LENSES)
    for cell in scene["cells"]:
        assert not {"ssim_views_fg", "ssim_eia_fg"} & set(cell["metrics"]) and cell["ci95"]["ssim_lens_fg"] > 0


def test_what_is_missing_is_left_out_with_a_sentence(tmp_path, no_start, capsys):
    folder = experiment_folder(tmp_path, names=("vase", "head"))
    shutil.rmtree(folder / "vase" / "s2-spp4")
    shutil.rmtree(folder / "head" / "reference")
    assert main(arguments(folder, "--methods", "bicubic,espcn", scenes=("vase.blend", "head.glb"))) == 0
    chart = measured(folder)
    assert [scene["scene"] for scene in chart["scenes"]] == ["vase"]
    assert chart["skipped"] == ["vase has no render at scale 2 with 4 samples",
                                "espcn at scale 2: espcn has no weights for it", "head has no reference"]
    assert "skipped: head has no reference" in capsys.readouterr().err


def test_the_run_of_one_scene_leaves_the_others_on_the_page(tmp_path, no_start, capsys):
    folder, both = experiment_folder(tmp_path, names=("vase", "head")), ("vase.blend", "head.glb")
    assert main(arguments(folder, scenes=both)) == 0
    before = measured(folder)
    assert main(arguments(folder, "--again", "bicubic")) == 0
    after = measured(folder)
    assert [scene["scene"] for scene in after["scenes"]] == ["vase", "head"]
    assert after["scenes"][1] == before["scenes"][1] and after["scenes"][0] != before["scenes"][0]
    assert "head" in (folder / "chart.html").read_text()
    capsys.readouterr()
    words = arguments(folder, "--methods", "nearest", "--ours", "nearest", scenes=("head.glb",))
    assert "chart.json was measured with other settings (methods" in main_fails(words, capsys)
    assert measured(folder) == after
    assert main([*words, "--replace"]) == 0
    assert [scene["scene"] for scene in measured(folder)["scenes"]] == ["head"], "other settings: another chart"
    shutil.rmtree(folder / "head" / "reference")
    assert main(arguments(folder, "--replace", scenes=both)) == 0
    assert [scene["scene"] for scene in measured(folder)["scenes"]] == ["vase"], "what cannot be measured is not shown"


def test_a_chart_that_cannot_be_read_is_replaced_only_when_asked(tmp_path, no_start, capsys):
    folder = experiment_folder(tmp_path)
    (folder / "chart.json").write_text('{"format": 99}')
    assert "chart.json has format 99" in main_fails(arguments(folder), capsys)
    assert (folder / "chart.json").read_text() == '{"format": 99}'
    assert main(arguments(folder, "--replace")) == 0 and measured(folder)["scenes"]


def test_two_charts_at_once_and_a_scene_of_the_same_name_are_refused(tmp_path, no_start, capsys):
    folder = experiment_folder(tmp_path)
    with staging_folder(folder / "chart"):
        assert "another process is writing" in main_fails(arguments(folder), capsys)
    changed = {"scene": "vase.blend", "content": f"{CONTENT_FORMAT}-other"}
    for samples, changes in ((1, {"scene": "vase.glb"}), (4, changed)):
        write_render(folder / "vase" / "s2-spp4", samples=samples, **changes)
        (tmp_path / "vase.blend").write_text("a scene")
        said = main_fails(arguments(folder, scenes=(str(tmp_path / "vase.blend"),)), capsys)
        assert "s2-spp4 was rendered " in said and ("of vase.glb" in said) == (samples == 1)
    assert not (folder / "chart.json").exists()


def test_renders_of_another_seed_lie_beside_the_others_and_other_subjects_are_refused(tmp_path, no_start, capsys):
    folder = experiment_folder(tmp_path)
    for samples in (1, 4):
        write_render(folder / "vase" / f"s2-spp{samples}-seed7", samples=samples, seed=7,
                     seconds={"open": 0.5, "render": samples})
    assert main(arguments(folder, "--seed", "7", "--direct-spps", "none")) == 0
    capsys.readouterr()
    assert measured(folder)["settings"]["seed"] == 7
    assert {path.name for path in (folder / "vase" / "cells").iterdir()} == {
        f"s2-spp{samples}-seed7-{name}.json" for samples in (1, 4) for name in ("bicubic", "nearest")}
    assert "was rendered with no subject, but subject Vase" in main_fails(
        arguments(folder, "--replace", "--subject", "Vase"), capsys)
    assert "but visible world was asked for" in main_fails(
        arguments(folder, "--replace", "--world-visible"), capsys)


@pytest.mark.parametrize(("more", "said"), [
    (("--again", "nothing"), "unknown method 'nothing'"),
    (("--spps", "4,4"), "different whole numbers"),
    (("--repeats", "0"), "repeats is 0"),
    (("--scale", "3"), "scale is 3"),
    (("--display", "small"), "display mini"),
])
def test_bad_input_is_refused_in_a_sentence(tmp_path, capsys, more, said):
    assert said in main_fails(arguments(experiment_folder(tmp_path), *more), capsys)
    assert not (tmp_path / "chart.json").exists()


def test_two_scenes_of_one_name_and_nothing_to_measure_are_refused(tmp_path, capsys):
    assert "no scene could be measured" in main_fails(arguments(tmp_path), capsys)
    words = arguments(experiment_folder(tmp_path), scenes=("vase.blend", "other/vase.obj"))
    assert "two scenes are called 'vase'" in main_fails(words, capsys)


def test_a_scene_that_is_not_there_is_refused_before_anything_is_written(tmp_path, capsys):
    words = [word for word in arguments(tmp_path / "out") if word != "--only-measure"]
    assert "vase.blend does not exist" in fails(words, capsys)
    assert not (tmp_path / "out").exists()


def test_default_methods_are_all_known_and_begin_with_the_default():
    names = default_methods()
    assert names[0] == DEFAULT_METHOD and len(set(names)) == len(names) > 8
    assert "none" not in names and {"bicubic", "oidn+bilinear", "denoise+bicubic", "paper"} <= set(names)
    for name in names:
        assert method(name).name.text == name


def test_our_method_must_be_measured(tmp_path):
    with pytest.raises(LfsrError, match="not among those measured"):
        Settings(folder=tmp_path, **vars(example(1).settings) | {"ours": "nearer"})


@pytest.mark.parametrize(("name", "parameters", "multiply_adds"), [
    ("oidn+bicubic", None, None),
    ("oidn+espcn", 76 * 64 + (9 * 64 + 1) * 32 + (9 * 32 + 1) * 48, 75 * 64 + 9 * 64 * 32 + 9 * 32 * 48),
])
def test_cost_of_networks(name, parameters, multiply_adds):
    assert chart_cells.network_cost(name, 4, (10, 10)) == (parameters, multiply_adds)


def test_without_pytorch_the_default_methods_have_no_network():
    source = ("import sys; sys.modules['torch'] = None\n"
              "from lfsr_lab.experiments.chart.settings import default_methods; print(*default_methods())")
    done = subprocess.run([sys.executable, "-c", source], text=True, cwd=ROOT, capture_output=True, check=True)
    assert set(default_methods()) > set(done.stdout.split()) > {"bicubic", "denoise+bilinear"}
    assert "paper" not in done.stdout


def test_a_cost_that_cannot_be_measured_is_a_note(tmp_path, monkeypatch):
    def fail(folder, name):
        raise LfsrError("no process can be started")

    monkeypatch.setattr(chart_cells, "upscale_seconds", fail)
    folder = experiment_folder(tmp_path)
    assert main(arguments(folder)) == 0
    assert "bicubic: its cost was not measured (no process can be started)" in measured(folder)["skipped"]
    assert measured(folder)["methods"] == [] and (folder / "chart.html").is_file()


@needs_bpy
@pytest.mark.slow
def test_from_a_scene_to_a_chart(tmp_path, no_start):
    scene = tmp_path / "fan.obj"
    scene.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\n")
    words = ["chart", str(scene), "-o", str(tmp_path / "out"), "--display", "mini", "--scale", "4", "--spps", "1",
             "--direct-spps", "1", "--ceiling-spp", "2", "--reference-spp", "2", "--lenses", "12", "--repeats", "1",
             "--render-repeats", "2", "--methods", "bicubic", "--ours", "bicubic"]
    assert main(words) == 0
    scene = measured(tmp_path / "out")["scenes"][0]
    assert scene["reference"]["samples"] == 2 and scene["reference"]["lenses"] == 12
    assert [cell["role"] for cell in scene["cells"]] == ["low", "direct", "direct", "ceiling"]
    assert [len(cell["render_seconds"]) for cell in scene["cells"]] == [2, 2, 2, 1]
