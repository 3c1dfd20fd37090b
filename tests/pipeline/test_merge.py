"""Parts of several machines: together the whole render, and never one of parts that do not belong together."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from lfsr_core.frames.frame import REFERENCE_FILES, read_frame, read_part, write_frame
from lfsr_core.images.color import ColorSettings
from lfsr_core.images.image_files import read_layers, write_layers
from lfsr_core.optics.rays import CameraArray, parse_rows
from lfsr_core.pipeline.merge import merge
from tests.support.noisy_renders import JOB, render
from tests.support.requests import changed
from tests.support.synthetic import MINI, fails
from tests.support.told import refuses


def made(folder: Path, **changes) -> Path:
    """A render, a reference, or a part of one, in ``folder``."""
    folder.mkdir()
    render(changed(JOB, **{"output": str(folder), "scale": 2} | changes))
    return folder


def parts(folder: Path, count: int, **changes) -> list[Path]:
    return [made(folder / f"part{number}", rows=parse_rows(f"{number}/{count}", 12), **changes)
            for number in range(count, 0, -1)]


@pytest.mark.parametrize("kind", ["render", "reference"])
@pytest.mark.parametrize("count", [1, 2, 5, 12])
def test_parts_are_the_whole(tmp_path, kind, count):
    options = {"kind": kind, "scale": 2 if kind == "render" else 1}
    whole, frame = made(tmp_path / "whole", **options), merge(parts(tmp_path, count, **options), tmp_path / "merged")
    assert dataclasses.replace(frame, seconds={}) == dataclasses.replace(read_frame(whole), seconds={})
    assert frame == read_frame(tmp_path / "merged")
    for path in whole.glob("*.exr"):
        pixels = read_layers(path)["color"]
        # A reference is stored as 16-bit floats.
        pixels = pixels.astype(np.float16).astype(np.float32) if kind == "reference" else pixels
        np.testing.assert_array_equal(read_layers(tmp_path / "merged" / path.name)["color"], pixels)
    assert not list(tmp_path.glob(".merged*"))


def change_frame(folder: Path, **changes) -> None:
    write_frame(folder, dataclasses.replace(read_part(folder), **changes))


@pytest.mark.parametrize(("damage", "sentence"), [
    (lambda part: change_frame(part, seed=9), "part1 was rendered with seed 9, but .*part2 with seed 5"),
    (lambda part: change_frame(part, samples=2), "with 2 samples per pixel, but"),
    (lambda part: change_frame(part, frame=7), "with frame number 7, but"),
    (lambda part: change_frame(part, array=CameraArray.for_display(MINI, 9)), "with array distance"),
    (lambda part: change_frame(part, content="b"), "from another version of"),
    (lambda part: change_frame(part, rows=None), "part1 is a whole frame"),
    (lambda part: change_frame(part, rows=(1, 7)), "rows 7 are in more than one part"),
    (lambda part: change_frame(part, rows=(2, 6)), "rows 1 are in none of the parts"),
    (lambda part: (part / "lr_eia.exr").unlink(), "part1 has a frame.json, but neither"),
    (lambda part: write_layers(part / "lr_eia.exr", {"color": read_layers(part / "lr_eia.exr")["color"][1:]}),
     "has 64×23 pixels, but rows 1-6 have 64×24")])
def test_parts_that_do_not_belong_together(tmp_path, capsys, damage, sentence):
    folders = parts(tmp_path, 2)
    change_frame(folders[0], content="a")
    damage(folders[1])
    said = fails(["merge", *map(str, folders), "-o", str(tmp_path / "merged")], capsys)
    assert re.search(sentence, said), said
    assert not list(tmp_path.glob("*merged*"))


def test_a_part_is_no_frame_parts_of_other_devices_are_one_and_a_cut_one_is_named(tmp_path, capsys):
    part, other = parts(tmp_path, 2)
    refuses("holds rows 7-12 of 12 alone: join it", read_frame, part)
    for verb in ("upscale", "view", "views"):
        assert "lfsr merge" in fails([verb, str(part)], capsys)
    refuses("rows 7-12 are in more than one part", merge, [part, part, other], tmp_path / "twice")
    for target in (other, part / "cut", part / ".." / part.name):
        refuses("is, or lies in, the part .*part[12], which", merge, [part, other], target)
    change_frame(other, device="OPTIX", color=ColorSettings(config="/opt/blender/config.ocio"))
    assert merge([part, other], tmp_path / "merged").device == "CPU+OPTIX"
    (other / "lr_eia.exr").write_bytes((other / "lr_eia.exr").read_bytes()[:-40])
    refuses("part1/lr_eia.exr cannot be read", merge, [part, other], tmp_path / "cut")
    assert not list(tmp_path.glob("*cut*"))


def test_references_of_other_seeds_become_one_of_all_samples(tmp_path):
    """The noise of each half falls as it should, and the halves stay independent."""
    options = {"kind": "reference", "scale": 1}
    counts = (20, 41, 60)
    folders = [made(tmp_path / f"seed{seed}", seed=seed, samples=spp, **options) for seed, spp in enumerate(counts)]
    frame = merge(folders, tmp_path / "merged")
    assert frame.samples == sum(counts) and frame.seed == 0 and frame.seeds == (0, 1, 2)
    refuses("merged and .*seed1 have the same seed 1, and so", merge, [tmp_path / "merged", folders[1]], tmp_path / "a")
    clean = read_layers(made(tmp_path / "clean", samples=2**20, **options) / REFERENCE_FILES[0])["color"]
    halves = [read_layers(tmp_path / "merged" / name)["color"] for name in REFERENCE_FILES]
    single = read_layers(folders[0] / REFERENCE_FILES[0])["color"]
    # Where values are not clipped at 0.
    bright = clean[..., :3].min(-1) > 0.3
    noise = [(half - clean)[bright][:, :3] for half in halves]
    ratio = np.var((single - clean)[bright][:, :3]) / np.var(noise[0])
    assert ratio == pytest.approx(sum(count // 2 for count in counts) / (counts[0] // 2), rel=0.15)
    assert abs(np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]) < 0.05


def test_references_that_cannot_be_averaged_and_what_was_made_of_an_older_merge_goes(tmp_path, capsys):
    options = {"kind": "reference", "scale": 1}
    first, same = made(tmp_path / "a", seed=1, **options), made(tmp_path / "b", seed=1, **options)
    whole, target = made(tmp_path / "c"), ["-o", str(tmp_path / "merged")]
    assert "have the same seed 1" in fails(["merge", str(first), str(same), *target], capsys)
    assert "c is a whole render, not a part" in fails(["merge", str(first), str(whole), *target], capsys)
    assert "does not exist" in fails(["merge", str(tmp_path / "none"), *target], capsys)
    refuses("a was rendered again while it was merged", merge, [first], tmp_path / "merged",
            lambda _: change_frame(first, seconds={"render": 9.0}))
    made(tmp_path / "merged")
    (tmp_path / "merged" / "eia.png").touch()
    merge(parts(tmp_path, 2), tmp_path / "merged")
    assert sorted(path.name for path in (tmp_path / "merged").iterdir()) == ["frame.json", "lr_eia.exr"]
