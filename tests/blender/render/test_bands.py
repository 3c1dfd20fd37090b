"""Long renders in parts: every layer equals that of one render byte for byte, with any cuts and any cached parts."""

import bpy
import numpy as np
import pytest

from blender_addon.render import frame_folder, output
from blender_addon.render.frame_folder import Opened
from lfsr_core.base.notices import Notice
from lfsr_core.frames.request import LAYERS
from lfsr_core.images import exr
from lfsr_core.pipeline.merge import merge
from lfsr_core.pipeline.parts import Pace, Part
from tests.support.requests import make_request
from tests.support.scenes import MINI
from tests.support.told import Told

LENSES = ((0, 0), (3, 4), (5, 8), (6, 9), (11, 15))


def rendered(scene, folder, **options):
    """Layers of every image, and what was warned of; with ``parts`` as the command renders."""
    told = Told()
    frame_folder.render_job(scene, make_request(str(folder), MINI, **{"samples": 40, "scale": 2} | options),
                            Opened(0.1, "the same file"), told)
    images = {path.name: exr.read_layers(path) for path in folder.glob("*.exr")}
    assert not set(images) - {"lr_eia.exr", "world.exr", "reference_a.exr", "reference_b.exr"}
    return images, told.notices


def assert_same(images, others):
    assert set(images) == set(others)
    for name, layers in images.items():
        assert set(layers) == set(others[name])
        for layer, pixels in layers.items():
            np.testing.assert_array_equal(pixels, others[name][layer], f"{name} {layer}", strict=True)


@pytest.mark.parametrize("options", [{}, {"lens_list": LENSES, "scale": 1}, {"layout": "lens-card"}])
def test_parts_are_the_whole_image(lit, tmp_path, monkeypatch, options):
    options |= {"layers": LAYERS, "world_visible": True}
    whole, _ = rendered(lit, tmp_path / "whole", **options)
    assert set(whole["lr_eia.exr"]) == {"color", *LAYERS, "environment"}
    # So short that bands also run out of time and are given up.
    monkeypatch.setenv("LFSR_SECONDS_PER_PART", "0.01")
    kept = tmp_path / "kept"
    assert_same(rendered(lit, tmp_path / "parts", parts=str(kept), **options)[0], whole)
    names = sorted(path.name for path in kept.glob("*.exr"))
    assert len(names) >= 3
    for gone in names[1:-1:2]:
        (kept / gone).unlink()
    times = {name: (kept / name).stat().st_mtime_ns for name in names[::2]}
    assert_same(rendered(lit, tmp_path / "again", parts=str(kept), **options)[0], whole)
    assert all((kept / name).stat().st_mtime_ns == time for name, time in times.items())


def test_a_finished_half_is_kept_while_the_other_is_rendered(lit, tmp_path, monkeypatch):
    options = {"kind": "reference", "scale": 1, "samples": 8}
    whole, _ = rendered(lit, tmp_path / "whole", **options)
    monkeypatch.setattr(output, "is_worth_storing", lambda seconds: True)
    kept = tmp_path / "kept"
    assert_same(rendered(lit, tmp_path / "parts", parts=str(kept), **options)[0], whole)
    (half,) = kept.glob("*.exr")
    assert half.name.startswith("reference_a-")
    assert_same(rendered(lit, tmp_path / "again", parts=str(kept), **options)[0], whole)


def test_a_short_render_stays_one_and_keeps_nothing(lit, tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(output, "gaps", lambda *arguments: calls.append(arguments) or [])
    _, warnings = rendered(lit, tmp_path / "frame", parts=str(tmp_path / "kept"))
    assert not (tmp_path / "kept").exists() and not calls and not warnings


def test_parts_of_other_inputs_are_removed(lit, tmp_path, monkeypatch):
    monkeypatch.setenv("LFSR_SECONDS_PER_PART", "0.02")
    image, options = tmp_path / "wood.png", {}
    image.write_bytes(b"1")
    bpy.data.images.new("wood", 4, 4).filepath = str(image)
    bpy.data.images["wood"].source = "FILE"
    for number, (change, other) in enumerate([({}, None), ({"seed": 3}, "settings"), ({"layers": ("albedo",)},
                                              "settings"), ({}, "images or linked files")]):
        if number == 3:
            image.write_bytes(b"22")
        options |= change
        images, warnings = rendered(lit, tmp_path / str(number), parts=str(tmp_path / "kept"), **options)
        assert warnings == ([Notice("parts-removed", {"input": other})] if other else [])
    assert_same(images, rendered(lit, tmp_path / "alone", **options)[0])


@pytest.mark.parametrize("rows", [7, 270, 1080, 4320])
def test_a_border_is_the_rows_that_were_meant(rows):
    """As Blender and Cycles cut it: to whole pixels, from single-precision fractions."""
    for first in range(0, rows, max(1, rows // 97)):
        for size in (1, 2, rows - first):
            values = output.border(Part(first, min(first + size, rows)), rows)
            low, high = (int(np.float32(values[name]) * np.float32(rows)) for name in ("border_min_y", "border_max_y"))
            assert (rows - high, rows - low) == (first, min(first + size, rows))


def test_time_limit_is_only_reached_by_long_renders():
    assert 100 < Pace(4, 4, 1, 60.0).timeout < 150, "two in a row must not cost five minutes"


@pytest.mark.parametrize("options", [{}, {"layout": "lens-card"}, {"kind": "reference", "scale": 1, "samples": 8},
                                     {"short": "0.02"}])
def test_rows_of_lenses_are_the_whole_image(lit, tmp_path, monkeypatch, options):
    """Rendered one by one and merged; also where each of them is made of bands."""
    monkeypatch.setenv("LFSR_SECONDS_PER_PART", short := options.get("short", "60"))
    options = {name: value for name, value in options.items() if name != "short"}
    if options.get("kind") != "reference":
        options |= {"layers": LAYERS, "world_visible": True}
    whole, _ = rendered(lit, tmp_path / "whole", **options)
    rows = [(1, 3), (4, 4), (5, 12)]
    for number, part in enumerate(rows):
        # One part at once, the others in bands: Blender's file beside ours.
        monkeypatch.setenv("LFSR_SECONDS_PER_PART", "60" if number == 1 else short)
        rendered(lit, tmp_path / f"part{number}", rows=part, parts=str(tmp_path / f"kept{number}"), **options)
    if not options.get("kind"):
        assert exr.size(tmp_path / "part0" / "lr_eia.exr") == (64, 12)
    merge([tmp_path / f"part{number}" for number in (2, 0, 1)], tmp_path / "merged")
    images = {path.name: exr.read_layers(path) for path in (tmp_path / "merged").glob("*.exr")}
    assert_same(images, whole)
