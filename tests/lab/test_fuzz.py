"""Damaged files under every verb that reads them: a picture as good, or one sentence; no traceback, no waiting.

And kills, full disks and two commands at once under verbs that write: nothing half-written, and the next run is whole.
One input of most kinds; 10,000 with ``pytest -m long -rP tests/lab/test_fuzz.py``, which prints the outcomes.
"""

import collections
import contextlib
import dataclasses
import hashlib
import itertools
import json
import math
import multiprocessing
import random
import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from _pytest.mark import ParameterSet
from PIL import Image

from lfsr_core.base.system import LOCK, UNFINISHED, write_json
from lfsr_core.calibration.patterns import pattern
from lfsr_core.cli import main
from lfsr_core.images.image_files import write_png
from lfsr_core.optics.display import write_profile
from lfsr_core.optics.rays import to_views
from lfsr_core.reconstruct.second_stage import finish_frame
from lfsr_lab.experiments.sweeps.records import choose_sweeps, label
from lfsr_lab.networks import comparators
from lfsr_lab.networks.methods import LabMethod
from lfsr_lab.train.config import CONFIG_FOLDER
from lfsr_lab.train.denoiser.data import load_scenes
from tests.calibration.test_fit import CYLINDERS, GOOD
from tests.calibration.test_makers import new_unit
from tests.lab.train.test_denoiser import write_scene
from tests.support import chart_folder, damage
from tests.support.damage import Case
from tests.support.finished import finished
from tests.support.noisy_renders import JOB, render
from tests.support.played_blender import played_blender
from tests.support.processes import wait_for
from tests.support.requests import changed
from tests.support.synthetic import MINI, light_field, write_apart, write_reference, write_render
from tests.support.telephone import photograph
from tests.support.training_photographs import write_photographs
from tests.test_fuzz import write_weights

SEED, MANY = 29, 10_000
PARAMETERS = ("[intrinsics]\nfocal_length_mm = 100\nsensor_size_mm = 35\n[extrinsics]\nnum_cams_x = 3\nnum_cams_y = 3\n"
              "baseline_mm = 10\nfocus_distance_m = 1\n")


TRAIN = ["--device", "cpu", *(f"--set={key}={value}" for key, value in {
    "crops_per_photograph": 1, "batch": 2, "crop": 16, "scale": 2}.items())]
STRESS = ["--sweeps", "wire", "--methods", "bicubic", "--quick", "--display", "mini", "--scale", "2",
          "--reference-spp", "8"]
PLAN = ["--display", "mini", "--scales", "2", "--spps", "4", "--methods", "nearest", "--lenses", "12",
        "--reference-spp", "16", "--target", "0.5"]


def then(_made: object, words: list[str]) -> None:
    """Run a command on what was made."""
    assert main(words) == 0


def with_weights(folder: Path) -> None:
    """A render and a denoiser, as a training writes it."""
    write_render(folder)
    content = write_weights(folder / "mine.tza").read_bytes()
    write_json(folder / "mine.json", {"sha256": hashlib.sha256(content).hexdigest()})


def finish_by_network(folder: Path) -> None:
    finish, upscaler = LabMethod.parse("paper").ready(folder / "w.safetensors", "cpu")
    finish_frame(folder, finish, upscaler=upscaler)


def compared(folder: Path) -> None:
    for name in ("frame", "reference"):
        (folder / name).mkdir()
    write_render(folder / "frame")
    assert main(["upscale", f"{folder}/frame", "--method", "bilinear"]) == 0
    write_reference(folder / "reference", lens_list=((0, 0), (5, 7), (6, 8)))


def views(folder: Path) -> None:
    """Views of every format, with parameters."""
    folder.joinpath("views").mkdir()
    field = to_views(light_field()[..., :3], MINI.lenses)
    for number, (row, column) in enumerate(itertools.product(range(3), repeat=2)):
        picture = np.rint(field[row, column] * 255).astype(np.uint8).repeat(4, 0).repeat(4, 1)
        Image.fromarray(picture).save(folder / "views" / f"input_Cam{number:03}.{ENDINGS[number % len(ENDINGS)]}")
    (folder / "views" / "parameters.cfg").write_text(PARAMETERS)


def photographed(folder: Path) -> None:
    write_profile(folder / "panel.toml", CYLINDERS)
    photo = photograph(pattern(CYLINDERS, "phase"), CYLINDERS, dataclasses.replace(GOOD, eye_mm=(0.0, 0.0, 500.0)))
    write_png(folder / "photo.png", np.rint(photo * 255).astype(np.uint8))


def parts(folder: Path) -> None:
    for name, rows in (("a", (1, 6)), ("b", (7, 12))):
        (folder / name).mkdir()
        render(changed(JOB, output=str(folder / name), scale=2, rows=rows))


def played(folder: Path) -> None:
    """A rendered animation, and the Blender that plays its part."""
    (folder / "scene.glb").write_text("a scene")
    (folder / "scene.blend").write_text("a scene")
    assert main(animation_words(folder)) == 0


def animation_words(folder: Path) -> list[str]:
    return ["render", f"{folder}/scene.blend", "-o", f"{folder}/film", "--frames", "1,2", "--display", "mini",
            "--scale", "2", "--spp", "4", "--seed", "5", "--method", "bilinear",
            "--blender", played_blender(folder / "blender")]


def plan_words(folder: Path) -> list[str]:
    return ["plan", f"{folder}/scene.glb", *PLAN, "--work", f"{folder}/work",
            "--blender", played_blender(folder / "blender")]


def planned(folder: Path) -> None:
    then((folder / "scene.glb").write_text("a scene"), plan_words(folder))


def stressed(folder: Path) -> None:
    source = write_render(folder / "s" / "s2-spp16"), write_reference(folder / "s" / "reference")
    for value in next(iter(choose_sweeps(("wire",)))).quick:
        for made in source:
            shutil.copytree(made, folder / f"wire-{label(value)}" / made.name)
        (folder / f"wire-{label(value)}" / "scene.blend").touch()
    assert main(["study", "stress", "-o", str(folder), *STRESS]) == 0


def trained(folder: Path) -> None:
    """Photographs, a config, and a finished epoch of a training of two."""
    write_photographs(folder / "photographs")
    shutil.copy(CONFIG_FOLDER / "paper.toml", folder / "config.toml")
    assert main(train_words(folder, 1)) == 0


def train_words(folder: Path, epochs: int) -> list[str]:
    return ["train", f"{folder}/config.toml", *TRAIN, f"--set=photographs={folder}/photographs", "--set=validation=",
            f"--set=epochs={epochs}", "--output", f"{folder}/run", *["--resume"] * (folder / "run").exists()]


def export(*words: str) -> Callable[[Path], list[str]]:
    return lambda folder: ["export", str(folder), "-o", f"{folder}/out", "--format", *words]


FRAME = frozenset({"frame.json"})
ENDINGS = ("png", "jpg", "ppm", "tif")
CASES = {
    "upscale": Case(lambda folder: then(write_apart(folder), ["upscale", str(folder), "--method", "bilinear"]),
                    {"frame.json": "frame.json", "lr_eia.exr": "lr_eia.exr", "world.exr": "world.exr",
                               "report.json": "report.json"},
                    lambda folder: ["upscale", str(folder), "--method", "pool", "--linear-exr"],
                    ("eia.png", "eia.exr"), FRAME),
    "denoiser": Case(with_weights, {"weights .tza": "mine.tza", "weights' .json": "mine.json"}, lambda folder: [
        "upscale", str(folder), "--method", "denoise+bilinear", "--weights", f"{folder}/mine.tza"], ("eia.png",)),
    "comparator": Case(lambda folder: shutil.copy(comparators.weights_path("paper", 4),
                                                  write_render(folder, 4) / "w.safetensors"),
                       {"weights .safetensors": "w.safetensors"}, finish_by_network, ("eia.png",)),
    "averaging": Case(lambda folder: [write_render(folder / f"{number:04}", seed=number, frame=number)
                                      for number in (1, 2, 3)],
                      {"neighbour's frame.json": "0001/frame.json", "neighbour's .exr": "0003/lr_eia.exr"},
                      lambda folder: ["upscale", str(folder), "--frame", "2", "--temporal-averaging", "1", "--method",
                                      "bilinear"], ("0002/eia.png",), frozenset({"neighbour's frame.json"})),
    "compare": Case(compared, {"compared report.json": "frame/report.json", "compared frame.json": "frame/frame.json",
                               "reference's .exr": "reference/reference_a.exr",
                               "reference's frame.json": "reference/frame.json"},
                    lambda folder: ["compare", f"{folder}/frame", f"{folder}/reference"]),
    "view": Case(finished, {"viewed eia.png": "eia.png", "viewed frame.json": "frame.json"},
                 lambda folder: ["view", str(folder), "-o", f"{folder}/view.html"], ("view.html",),
                 frozenset({"viewed frame.json"})),
    "views": Case(finished, {"eia.png in views": "eia.png"}, lambda folder: ["views", str(folder)], ("views/*",)),
    "export hci": Case(finished, {"exported eia.png": "eia.png", "exported frame.json": "frame.json",
                                  "exported lr_eia.exr": "lr_eia.exr"}, export("hci"), ("out/*",),
                       frozenset({"exported frame.json"}), 0.5),
    "export exr": Case(finished, {"exported eia.exr": "eia.exr"}, export("views", "--type", "exr"), ("out/*",)),
    "import": Case(views, {f"view .{ending}": f"views/input_Cam{number:03}.{ending}"
                           for number, ending in enumerate(ENDINGS)} | {"parameters.cfg": "views/parameters.cfg"},
                   lambda folder: ["import", f"{folder}/views", "-o", f"{folder}/frame"], ("frame/lr_eia.exr",),
                   frozenset({"view .jpg", "view .ppm", "view .tif", "parameters.cfg"})),
    "displays": Case(photographed, {"profile .toml": "panel.toml"},
                     lambda folder: ["displays", f"{folder}/panel.toml"]),
    "fit": Case(photographed, {"photograph of a panel": "photo.png"}, lambda folder: [
        "displays", f"{folder}/panel.toml", "--fit", f"{folder}/photo.png", "--from", "0,0,500"]),
    "calibration": Case(new_unit,
                        {"visual.json": "visual.json"}, lambda folder: [
                            "displays", "--import", f"{folder}/visual.json", "-o", f"{folder}/device.toml"]),
    "merge": Case(parts, {"part's frame.json": "a/frame.json", "part's .exr": "b/lr_eia.exr"},
                  lambda folder: ["merge", f"{folder}/a", f"{folder}/b", "-o", f"{folder}/out"], ("out/*.exr",),
                  frozenset({"part's frame.json"})),
    "render": Case(played, {"scene .blend": "scene.blend", "kept frame.json": "film/0001/frame.json",
                            "kept report.json": "film/0002/report.json", "kept lr_eia.exr": "film/0001/lr_eia.exr",
                            "kept eia.png": "film/0002/eia.png"}, animation_words, part=0.1),
    "plan": Case(planned, {"plan's frame.json": "work/quick/frame.json", "plan's sample.json": "work/sample.json"},
                 plan_words, part=0.1),
    # Renders of a plan that was not finished.
    "plan anew": Case(lambda folder: (planned(folder), (folder / "work" / "sample.json").unlink()),
                      {"plan's .exr": "work/s2-spp4/lr_eia.exr", "plan's world": "work/quick/lr_eia.exr",
                       "plan's reference": "work/reference-0/reference_a.exr"}, plan_words, part=0.1),
    "chart": Case(lambda folder: then(chart_folder.experiment_folder(folder), chart_folder.arguments(folder)),
                  {"chart.json": "chart.json", "chart's cell": "vase/cells/s2-spp1-bicubic.json",
                            "chart's frame.json": "vase/s2-spp1/frame.json"}, chart_folder.arguments, part=0.05),
    "stress": Case(stressed, {"stress settings.json": "settings.json",
                              "stress cell": "wire-2/cells/bicubic-wire-spp16.json",
                              "stress frame.json": "wire-2/s2-spp16/frame.json"},
                   lambda folder: ["study", "stress", "-o", str(folder), *STRESS]),
    "train": Case(trained, {"config .toml": "config.toml", "training log": "run/log.jsonl",
                            "checkpoint .pt": "run/checkpoint.pt", "photograph": "photographs/0.png"},
                  lambda folder: train_words(folder, 2), ("run/*.safetensors",),
                  frozenset({"config .toml", "photograph"}), 0.3),
    "denoiser's training": Case(lambda folder: [write_scene(folder, number) for number in (1, 9)],
                                {"scene .npz": "scene_000001.npz"},
                                lambda folder: load_scenes(folder) and None)}
PARTS = sum(case.part * len(case.files) for case in CASES.values())
QUICK = 0.3  # more than this part has a case in the small sample


WRITERS = ("upscale", "view", "views", "export hci", "import", "calibration", "merge", "render")
FAULTS = {"kill": 15, "full disk": 25, "race": 25}  # and how many of each a verb meets in the long run
FORKS = multiprocessing.get_context("forkserver")


def sampled_inputs() -> Iterator[ParameterSet]:
    """Each case with its inputs of every kind of file: one, where it is quick, and its part of MANY."""
    for name, case in CASES.items():
        if case.part > QUICK:
            yield pytest.param(case, 1, id=name)
        yield pytest.param(case, math.ceil(MANY * case.part / PARTS), id=f"{name}-many", marks=pytest.mark.long)


@pytest.mark.parametrize(("case", "inputs"), list(sampled_inputs()))
def test_damaged_files_give_the_same_picture_or_a_sentence(tmp_path, monkeypatch, case, inputs):
    monkeypatch.setenv("LFSR_CACHE", str(tmp_path / "cache"))
    outcomes = list(damage.outcomes(case, tmp_path / "case", inputs, SEED))
    for kind in case.files:
        print(f"{kind:24}", dict(collections.Counter(result.outcome for name, _, result in outcomes if name == kind)))
    assert not [row for row in outcomes if row[2].outcome in damage.WRONG]


def attempted(name: str, folder: Path, most: int, answer: Connection) -> None:
    """Run a case's command in this process, whose files may have ``most`` bytes."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    answer.send(damage.attempt(CASES[name], folder))


def start(name: str, folder: Path, most: int = resource.RLIM_INFINITY) -> tuple[Any, Connection]:
    """A process that runs a case's command, and where it sends the result."""
    ours, theirs = FORKS.Pipe(duplex=False)
    process = FORKS.Process(target=attempted, args=(name, folder, most, theirs))
    process.start()
    theirs.close()
    return process, ours


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize(("name", "fault", "trials"), [
    ("upscale", "kill", 1), ("merge", "full disk", 1), ("views", "race", 1), *(
        pytest.param(name, *fault, marks=pytest.mark.long) for name in WRITERS for fault in FAULTS.items())])
def test_nothing_is_half_written(tmp_path, name, fault, trials):
    FORKS.set_forkserver_preload([__name__])
    # For its socket; it would remove a folder of its own after the tests' own is gone.
    multiprocessing.current_process()._config["tempdir"] = tempfile.gettempdir()
    good, work = tmp_path / "good", tmp_path / "work"
    work.mkdir()
    CASES[name].make(work)
    shutil.copytree(work, good)
    for _ in range(2):  # the first starts the process that forks
        shutil.rmtree(work)
        shutil.copytree(good, work)
        started, (process, answer) = time.monotonic(), start(name, work)
        whole, seconds = answer.recv(), time.monotonic() - started
    largest, outcomes = max(path.stat().st_size for path in work.rglob("*") if path.is_file()), collections.Counter()
    for number in range(trials):
        dice = random.Random(f"{SEED} {name} {fault} {number}")
        shutil.rmtree(work)
        shutil.copytree(good, work)
        running = [start(name, work, dice.randrange(largest) if fault == "full disk" else resource.RLIM_INFINITY)
                   for _ in range(2 if fault == "race" else 1)]
        for process, answer in running:
            if fault == "kill":
                process.join(dice.uniform(0, 0.9 * seconds))
                process.kill()
            else:
                result = answer.recv()
                assert result.outcome in (damage.READ, damage.REFUSED), result.said
                outcomes[result.outcome] += 1
            process.join()
            outcomes[process.exitcode] += 1
        wait_for(lambda: not [path for path in Path("/proc").glob("[0-9]*/cmdline") if told(path, str(work))], 20)
        check_whole(work, fault)
        process, answer = start(name, work)
        again = answer.recv()
        assert again.outcome == damage.REFUSED or again.pictures == whole.pictures, again.said
        check_whole(work, "next run")
    print(name, fault, dict(outcomes))


def told(path: Path, text: str) -> bool:
    """Whether a process has ``text`` among its words."""
    with contextlib.suppress(OSError):
        return text in path.read_text(errors="replace")
    return False


def check_whole(folder: Path, fault: str) -> None:
    """Check that every file can be read, and that nothing is left of unfinished ones, but where the writer died."""
    for path in filter(Path.is_file, folder.rglob("*")):
        if UNFINISHED in path.name or path.name.endswith(LOCK):
            assert fault == "kill", path
        elif path.suffix == ".json":
            json.loads(path.read_bytes())
        elif not any(part.startswith(".") for part in path.relative_to(folder).parts):
            damage.pixels(path)
