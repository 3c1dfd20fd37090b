"""``lfsr study chart`` on frame folders: measured, timed, resumed, refused."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lfsr_core.base.system import staging_folder
from lfsr_core.cli import main
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_lab.experiments.chart import cells as chart_cells
from lfsr_lab.experiments.chart import panels
from lfsr_lab.experiments.chart.cells import default_methods
from lfsr_lab.experiments.engine import timing
from lfsr_lab.experiments.engine.truth import MEASURES, PARTS, Truth
from lfsr_lab.networks.methods import LabMethod
from tests.support.chart_folder import SEEDS, arguments, experiment_folder, main_fails, measured, noisy_render
from tests.support.prerequisites import needs_bpy
from tests.support.synthetic import fails, write_render

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def ready(tmp_path_factory):
    """An experiment folder for those that leave it as it is."""
    return experiment_folder(tmp_path_factory.mktemp("ready"))


@pytest.fixture
def undrawn(monkeypatch):
    """A chart's page and image take longer than everything here; test_page.py draws them."""
    for name in ("page", "image"):
        monkeypatch.setattr(panels, name, lambda *_: "")


@pytest.fixture
def finished(monkeypatch):
    """Names of the methods that really finished a render for its errors."""
    runs, real = [], Truth.finished
    monkeypatch.setattr(Truth, "finished", lambda of, folder, name: runs.append(name) or real(of, folder, name))
    return runs


@pytest.fixture
def timed(monkeypatch):
    """Names of the methods that were really timed."""
    runs, real = [], timing.finish_frame
    monkeypatch.setattr(timing, "finish_frame", lambda folder, finish, **network: (
        runs.append(finish.method) or real(folder, finish, **network)))
    return runs


def test_every_cell_is_measured_once_on_all_seeds_and_renders_stay(tmp_path, finished, timed, capsys, request):
    folder = experiment_folder(tmp_path)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert main(arguments(folder)) == 0
    scene, = measured(folder)["scenes"]
    cells = scene["cells"]
    assert [(cell["role"], cell["method"], cell["samples"]) for cell in cells] == [
        ("low", "bicubic", 1), ("low", "nearest", 1), ("low", "bicubic", 4), ("low", "nearest", 4),
        ("direct", "none", 1), ("direct", "oidn", 1)]
    assert finished[:12] == [cell["method"] for cell in cells for _ in range(SEEDS)]
    assert timed == [] and all(cell["seconds"] is None for cell in cells)
    for cell in cells:
        assert cell["errors"].keys() == {*MEASURES, *PARTS}
        for error in cell["errors"].values():
            assert error["low"] <= error["mean"] <= error["high"]
        assert all(cell["errors"][name]["spread"] > 0 for name in MEASURES)
        assert cell["errors"]["relmse"]["mean"] == pytest.approx(
            cell["errors"]["bias2"]["mean"] + cell["errors"]["variance"]["mean"], rel=1e-3)
    error = {(cell["method"], cell["samples"]): cell["errors"]["variance"]["mean"] for cell in cells}
    assert error["bicubic", 1] == pytest.approx(4 * error["bicubic", 4], rel=0.2), "noise falls with samples"
    assert all(0 < noise < 0.05 for noise in scene["reference"]["noise"].values())
    assert {path: path.read_bytes() for path in before} == before
    assert set(capsys.readouterr().out.split()) == {str(folder / f"chart.{kind}") for kind in
                                                    ("json", "html", "svg", "md")}
    assert "data:image/png;base64,iVBOR" in (folder / "chart.html").read_text(), "crops"
    request.getfixturevalue("undrawn")
    crops = len(finished) - 12
    finished.clear()
    noisy_render(folder / "vase" / "s2-spp4-seed1", 4, 1, seconds={"open": 0.5, "render": 3.0})
    main(arguments(folder))
    assert finished[:4] == ["bicubic"] * 2 + ["nearest"] * 2 and len(finished) == 4 + crops, "of the changed render"


def test_times_are_a_pass_of_their_own_that_continues(tmp_path, timed, monkeypatch, undrawn):
    folder = experiment_folder(tmp_path)
    assert main(arguments(folder)) == 0 and timed == []
    before, real = measured(folder)["scenes"][0]["cells"], chart_cells.second_stage_times

    def stop_at_oidn(copy, name, repeats, warm):
        if name == "oidn":
            raise KeyboardInterrupt
        return real(copy, name, repeats, warm)

    monkeypatch.setattr(chart_cells, "second_stage_times", stop_at_oidn)
    assert main(arguments(folder, "--times")) == 130 and not list(folder.rglob(".scratch-*"))
    monkeypatch.setattr(chart_cells, "second_stage_times", real)
    timed.clear()
    assert main(arguments(folder, "--times")) == 0
    assert timed == ["oidn"] * 3, "one run is not counted"
    after = measured(folder)["scenes"][0]["cells"]
    assert [cell["errors"] for cell in after] == [cell["errors"] for cell in before]
    assert all(cell["seconds"]["low"] > cell["samples"] for cell in after), "renders took a second per sample"
    assert "at equal error, seconds" in (folder / "chart.md").read_text()
    timed.clear()
    assert main(arguments(folder)) == 0 and timed == [] and measured(folder)["scenes"][0]["cells"] == after


def test_a_whole_reference_one_seed_and_several_scenes_are_measured_and_what_is_missing_is_left_out(tmp_path, undrawn,
                                                                                                    capsys):
    folder = experiment_folder(tmp_path, names=("vase", "head"), lens_list=None)
    assert main(arguments(folder, "--seeds", "1", scenes=("vase.blend", "head.glb"))) == 0
    scene, other = measured(folder)["scenes"]
    assert (scene["scene"], other["scene"]) == ("vase", "head")
    assert "Mean of 2 scenes" in (folder / "chart.md").read_text()
    assert scene["reference"]["lenses"] is None and scene["reference"]["counted"] > 20
    assert all(cell["errors"].keys() == {*MEASURES} for cell in scene["cells"])
    assert scene["cells"][0]["errors"]["1-ssim"]["spread"] is None
    folder = experiment_folder(tmp_path / "less", names=("vase", "head"))
    shutil.rmtree(folder / "vase" / "s2-spp4-seed1")
    shutil.rmtree(folder / "head" / "reference")
    assert main(arguments(folder, "--methods", "bicubic,espcn", scenes=("vase.blend", "head.glb"))) == 0
    chart = measured(folder)
    assert [scene["scene"] for scene in chart["scenes"]] == ["vase"]
    assert chart["skipped"] == ["espcn at scale 2: espcn has no weights for it",
                                "vase has no render at scale 2 with 4 samples and 2 seeds", "head has no reference"]
    assert "skipped: head has no reference" in capsys.readouterr().err


@pytest.mark.parametrize(("more", "said"), [
    (("--methods", "nothing"), "unknown method 'nothing'"), (("--spps", "0,4"), "different whole numbers"),
    (("--repeats", "0"), "repeats is 0"), (("--seeds", "0"), "seeds is 0"), (("--scale", "3"), "scale is 3"),
    (("--display", "small"), "display mini"), (("--subject", "Vase"), "was rendered with no subject, but subject Vase"),
    (("--world-visible",), "but visible world was asked for")])
def test_bad_input_is_refused_in_a_sentence(ready, capsys, more, said):
    assert said in main_fails(arguments(ready, *more), capsys) and not (ready / "chart.json").exists()


def test_two_charts_at_once_scenes_of_one_name_and_none_at_all_are_refused(tmp_path, capsys):
    words = arguments(tmp_path, scenes=("vase.blend", "other/vase.obj"))
    assert "two scenes are called 'vase'" in main_fails(words, capsys)
    assert "no scene could be measured" in main_fails(arguments(tmp_path), capsys)
    words = [word for word in arguments(tmp_path / "out") if word != "--only-measure"]
    assert "vase.blend does not exist" in fails(words, capsys) and not (tmp_path / "out").exists()
    folder = experiment_folder(tmp_path)
    with staging_folder(folder / "chart"):
        assert "another process is writing" in main_fails(arguments(folder), capsys)
    for samples, changes in ((1, {"scene": "vase.glb"}), (4, {"scene": "vase.blend", "content": "1 other"})):
        write_render(folder / "vase" / "s2-spp4", samples=samples, **changes)
        (tmp_path / "vase.blend").write_text("a scene")
        said = main_fails(arguments(folder, scenes=(str(tmp_path / "vase.blend"),)), capsys)
        assert "s2-spp4 was rendered " in said and ("of vase.glb" in said) == (samples == 1)
    assert not (folder / "chart.json").exists()


def test_default_methods_begin_with_the_default_and_have_no_network_without_pytorch():
    names = default_methods()
    assert names[0] == DEFAULT_METHOD and len(set(names)) == len(names) > 8
    assert "none" not in names and {"bicubic", "oidn+bilinear", "denoise+bicubic", "paper"} <= set(names)
    assert [LabMethod.parse(name).text for name in names] == list(names)
    source = ("import sys; sys.modules['torch'] = None\n"
              "from lfsr_lab.experiments.chart.cells import default_methods; print(*default_methods())")
    done = subprocess.run([sys.executable, "-c", source], text=True, cwd=ROOT, capture_output=True, check=True)
    assert set(default_methods()) > set(done.stdout.split()) > {"bicubic", "denoise+bilinear"}
    assert "paper" not in done.stdout


@needs_bpy
@pytest.mark.slow
def test_from_a_scene_to_a_chart(tmp_path, undrawn):
    scene = tmp_path / "fan.obj"
    scene.write_text("mtllib fan.mtl\nusemtl lit\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\n")
    scene.with_suffix(".mtl").write_text("newmtl lit\nKe 1 1 1\n")  # or a world image would be prepared for seconds
    words = ["study", "chart", str(scene), "-o", str(tmp_path / "out"), "--display", "mini", "--scale", "4"]
    words += ["--spps", "1", "--direct-spps", "none", "--seeds", "1", "--reference-spp", "2", "--lenses", "12"]
    words += ["--repeats", "1", "--times", "--methods", "bicubic", "--ours", "bicubic"]
    assert main(words) == 0
    scene, = measured(tmp_path / "out")["scenes"]
    assert scene["reference"]["samples"] == 2 and scene["reference"]["lenses"] == 12
    cell, = scene["cells"]
    assert cell["seconds"]["mean"] > 0 and cell["errors"]["relmse"]["mean"] > 0
