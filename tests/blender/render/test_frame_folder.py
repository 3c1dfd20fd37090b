"""A reference is two halves with independent noise."""

import dataclasses

import bpy
import numpy as np
import pytest

from blender_addon.render import frame_folder
from lfsr_core.base.notices import Notice
from lfsr_core.frames.frame import read_frame
from lfsr_core.frames.views import read_views
from lfsr_core.images import exr
from lfsr_core.pipeline.make import finish_frame
from tests.support.requests import make_request
from tests.support.scenes import MINI

LENSES = ((0, 0), (3, 4), (5, 8), (6, 9), (11, 15))


def rendered(scene, folder, **options):
    options = {"samples": 4, "scale": 1, "world_visible": False} | options
    frame_folder.render_job(scene, make_request(str(folder), MINI, **options))
    return {path.stem: exr.read_layers(path)["color"][..., :3] for path in folder.glob("*.exr")}


def noise(image):
    """Differences between neighbouring pixels."""
    return image[:, 1:] - image[:, :-1]


def correlation(first, second):
    return np.corrcoef(noise(first).ravel(), noise(second).ravel())[0, 1]


def test_halves_and_candidates_have_independent_noise(lit, tmp_path):
    halves = rendered(lit, tmp_path / "reference", kind="reference")
    assert set(halves) == {"reference_a", "reference_b"}
    low = rendered(lit, tmp_path / "low", samples=2)["lr_eia"]
    same, other = (rendered(lit, tmp_path / str(seed), samples=2, seed=seed)["lr_eia"] for seed in (0, 1))
    first, second = halves.values()
    assert first.mean() == pytest.approx(second.mean(), rel=0.02)
    np.testing.assert_array_equal(low, same)
    # The rest of the correlation is that of the edges in the image.
    edges = correlation(first, second)
    assert edges < 0.6
    assert max(correlation(low, image) for image in (first, second, other)) < edges + 0.1


@pytest.mark.parametrize(("options", "expected"), [
    ({"scale": 4}, ("albedo", "normal", "position")),
    ({"scale": 4, "layers": ("normal", "position")}, ("normal", "position", "albedo")),
    ({"scale": 1}, ()), ({"scale": 1, "kind": "reference"}, ())])
def test_the_second_stage_gets_albedo_normal_and_position_where_views_are_left_out(lit, tmp_path, options, expected):
    rendered(lit, tmp_path, **options)
    assert read_frame(tmp_path).layers == expected
    files = [exr.read_layers(path) for path in tmp_path.glob("*.exr")]
    assert all({"albedo", "normal"} & set(layers) == {"albedo", "normal"} & set(expected) for layers in files)


def test_reference_of_listed_lenses(lit, tmp_path):
    halves = rendered(lit, tmp_path, kind="reference", lens_list=LENSES, scale=4)
    frame = read_frame(tmp_path)
    assert (frame.scale, frame.lens_list, frame.rays.size) == (1, LENSES, (2 * 8, 3 * 8))
    assert all(half.shape == (3 * 8, 2 * 8, 3) for half in halves.values())


def test_halves_share_the_samples_and_are_not_clamped(lit, tmp_path):
    seen = []

    def look(*_):
        seen.append((lit.cycles.samples, lit.cycles.sample_clamp_indirect, lit.cycles.seed))

    bpy.app.handlers.render_pre.append(look)
    try:
        rendered(lit, tmp_path / "low", samples=1)
        rendered(lit, tmp_path / "reference", samples=5, kind="reference")
        rendered(lit, tmp_path / "own", samples=1, clamp_indirect=3.0)
    finally:
        bpy.app.handlers.render_pre.remove(look)
    # Before each, a tiny one has looked for light.
    seen = [each for each in seen if each[0] != frame_folder.LIGHT_SAMPLES]
    assert [each[:2] for each in seen] == [(1, 10.0), (3, 0.0), (2, 0.0), (1, 3.0)]
    assert len({seed for _, _, seed in seen[:3]}) == 3


@pytest.mark.parametrize("world_visible", [False, True])
def test_the_first_view_is_the_middle_of_the_image_which_keeps_its_bytes(lit, tmp_path, world_visible):
    first, told = tmp_path / "first.npy", []
    options = {"samples": 64, "scale": 1, "world_visible": world_visible}
    request = make_request(str(tmp_path / "with"), MINI, **options)
    frame_folder.render_job(lit, dataclasses.replace(request, first_view=str(first)), tell=told.append)
    assert Notice("first-view", {"path": str(first)}) in told
    without = rendered(lit, tmp_path / "without", **options)["lr_eia"]
    np.testing.assert_array_equal(exr.read_layers(tmp_path / "with" / "lr_eia.exr")["color"][..., :3], without)
    view = np.load(first)
    assert view.dtype == np.uint8 and view.shape == (1, 1, MINI.lenses[1], MINI.lenses[0], 3)
    finish_frame(tmp_path / "with", "none")
    views = read_views(tmp_path / "with").astype(float)
    middle = views[3:5, 3:5].mean((0, 1))
    border = views[0, 0]
    error = [np.abs(view[0, 0] - other).mean() for other in (middle, border)]
    assert error[0] < 8 and error[0] < error[1] / 2


@pytest.mark.parametrize("layout", ["one-pass", "view-by-view"])
def test_braces_in_a_path_are_no_template(lit, tmp_path, layout):
    folder = tmp_path / "{scene} {x" / "{blend_name}}"
    folder.mkdir(parents=True)
    assert set(rendered(lit, folder, samples=1, scale=4, layout=layout)) == {"lr_eia"}
    assert [path.name for path in tmp_path.iterdir()] == ["{scene} {x"]
