"""What is shown of scene-linear values."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lfsr_core.images import color as viewing
from lfsr_core.images.color import ColorSettings, ViewTransform, extreme_tone, find_config, srgb_decode, srgb_encode
from lfsr_core.images.image_files import read_png
from tests.support.prerequisites import needs_bpy
from tests.support.told import refuses

SAVER = Path(__file__).parents[1] / "support" / "blender_saves_png.py"
CASES = [
    ColorSettings(), ColorSettings(exposure=1.3, gamma=1.4), ColorSettings(view_transform="AgX"),
    ColorSettings(view_transform="AgX", look="AgX - Punchy", exposure=-0.5),
    ColorSettings(view_transform="AgX", look="AgX - High Contrast", exposure=0.5, gamma=1.2),
    ColorSettings(view_transform="Filmic"), ColorSettings(view_transform="Khronos PBR Neutral"),
    ColorSettings(view_transform="Filmic", look="High Contrast", exposure=1.0, gamma=0.8),
    ColorSettings(view_transform="Raw")]


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A scene-linear image, and the PNG that Blender itself saves of it for every case."""
    folder = tmp_path_factory.mktemp("color")
    linear = np.exp(np.random.default_rng(0).normal(-1.5, 2, (96, 128, 3))).astype(np.float32)
    linear[:8] = 0
    linear[64:] = np.geomspace(1e-4, 100, 128)[:, None]
    np.save(folder / "linear.npy", linear)
    (folder / "cases.json").write_text(json.dumps([vars(case) for case in CASES]))
    run = subprocess.run([sys.executable, str(SAVER), str(folder)], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    return linear, folder


@needs_bpy
@pytest.mark.parametrize("case", range(len(CASES)),
                         ids=[f"{c.view_transform}-{c.look}-{c.exposure}-{c.gamma}" for c in CASES])
def test_looks_as_blender_saves_it(saved, case):
    linear, folder = saved
    theirs = read_png(folder / f"{case}.png").astype(int)
    ours = ViewTransform(CASES[case]).to_uint8(linear).astype(int)
    assert len(np.unique(theirs)) > 50, "the comparison must not be of a flat image"
    assert np.abs(ours - theirs).max() <= 1 and (ours != theirs).mean() < 1e-3


@needs_bpy
def test_float_and_byte_results_agree_and_any_leading_shape_is_kept():
    linear = np.random.default_rng(0).random((3, 5, 7, 3)).astype(np.float32)
    show = ViewTransform(ColorSettings(view_transform="AgX"))
    floats, values = show(linear), show.to_uint8(linear)
    assert floats.shape == values.shape == linear.shape and np.abs(np.round(floats * 255) - values).max() <= 1
    np.testing.assert_array_equal(values[1, 2:4, ::2], show.to_uint8(linear[1, 2:4, ::2]))
    linear = np.random.default_rng(0).random((4, 4, 3)).astype(np.float32)
    short, full, none = (ViewTransform(ColorSettings(view_transform="AgX", look=look))(linear)
                         for look in ("Punchy", "AgX - Punchy", "None"))
    np.testing.assert_array_equal(short, full)
    assert np.abs(full - none).max() > 0.01
    code = ("import sys; from lfsr_core.images.color import ColorSettings, ViewTransform; "
            "ViewTransform(ColorSettings()); print('bpy' in sys.modules)")
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "False"


@needs_bpy
@pytest.mark.parametrize(("settings", "message"), [
    (ColorSettings(view_transform="Filmik"), "view transform 'Filmik' is not"),
    (ColorSettings(display_device="TV"), "display device 'TV' is not"),
    (ColorSettings(look="Punchi"), "look 'Punchi' is not")])
def test_unknown_names_are_one_clear_sentence(settings, message):
    refuses(message, ViewTransform, settings)


def test_the_frames_configuration_comes_before_the_environments_and_a_damaged_one_is_one_sentence(tmp_path,
                                                                                                  monkeypatch):
    (tmp_path / "named.ocio").touch()
    (tmp_path / "environment.ocio").touch()
    monkeypatch.setenv("OCIO", str(tmp_path / "environment.ocio"))
    assert find_config(ColorSettings(config=str(tmp_path / "named.ocio"))).name == "named.ocio"
    assert find_config(ColorSettings(config=str(tmp_path / "gone.ocio"))).name == "environment.ocio"
    monkeypatch.delenv("OCIO", raising=False)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    refuses("install the package bpy", find_config, ColorSettings())
    config = tmp_path / "config.ocio"
    config.write_text("ocio_profile_version: 2\nroles: [" + "x" * 1000)
    refuses(r"config\.ocio cannot be used as a colour configuration", ViewTransform, ColorSettings(config=str(config)))
    for numbers in [{"exposure": float("nan")}, {"exposure": 1e4}, {"gamma": -1.0}]:
        refuses("exposure is .* and gamma .*, but they must be between", ColorSettings, **numbers)


@needs_bpy
def test_the_plain_view_needs_no_blender(monkeypatch):
    linear = np.random.default_rng(0).normal(0.4, 0.5, (64, 64, 3)).astype(np.float32)
    from_blender = ViewTransform(ColorSettings()).to_uint8(linear)
    monkeypatch.delenv("OCIO", raising=False)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    np.testing.assert_array_equal(ViewTransform(ColorSettings()).to_uint8(linear), from_blender)
    refuses("install the package bpy", ViewTransform, ColorSettings(view_transform="AgX"))


MANY = 1 << 25


def colors(count=200_000, most=8.0):
    """(1, count, 3) scene-linear colours, other ones than those that a table is tried on."""
    random = np.random.default_rng(7)
    stops = random.uniform(-14, 5, (1, count, 1)) + random.normal(0, 1.2, (1, count, 3))
    return np.minimum(2**stops, most).astype(np.float32)


@pytest.mark.parametrize(("view", "look"), [("AgX", "Punchy"), ("AgX", "None"), ("Filmic", "High Contrast")])
def test_table_shows_what_the_chain_shows(view, look):
    settings = ColorSettings(view_transform=view, look=look)
    exact, baked = ViewTransform(settings), ViewTransform(settings, MANY)
    values = colors()
    assert baked.table
    steps = np.abs(exact.to_uint8(values).astype(int) - baked.to_uint8(values)).max(-1)
    assert steps.max() <= 3 and np.mean(steps <= 1) >= 0.999 and (steps > 0).any(), "else it is no table"
    np.testing.assert_array_equal(exact(values), baked(values))


def test_what_lies_outside_the_table_is_exact():
    settings = ColorSettings(view_transform="AgX", look="Punchy")
    exact, baked = ViewTransform(settings), ViewTransform(settings, MANY)
    values = colors(1000)
    values[0, ::2] = [[20.0, 0.1, 0.3]]
    values[0, 1] = [-0.5, 0.2, 0.2]
    outside = (values < 0).any(-1) | (values > 8).any(-1)
    np.testing.assert_array_equal(baked.to_uint8(values)[outside], exact.to_uint8(values)[outside])
    assert not ViewTransform(ColorSettings(view_transform="False Color"), MANY).table
    assert not ViewTransform(ColorSettings(view_transform="AgX", look="Punchy"), 10_000).table
    assert not ViewTransform(ColorSettings(), MANY).table, "the plain view costs less than a table"
    tried = viewing.random_colors()[0]
    assert np.mean((tried == 0).any(1)) == 0.5 and tried.max() <= viewing.BRIGHTEST


@pytest.mark.parametrize(("counts", "near"), [
    ([90_000, 9_950, 50, 0, 0], True), ([90_000, 9_900, 100, 0, 0], True), ([90_000, 9_890, 110, 0, 0], False),
    ([99_950, 0, 45, 5, 0], True), ([99_900, 0, 0, 100, 0], False), ([99_999, 0, 0, 0, 1], False)])
def test_a_table_is_accurate_where_steps_are_small_and_large_ones_rarer_still(counts, near):
    assert viewing.is_accurate(np.repeat(np.arange(len(counts)), counts)) == near


def test_almost_black_and_almost_white_images_but_for_sparks_and_background():
    shown = np.zeros((100, 100, 3), np.uint8)
    shown[:4, :5] = 255
    assert extreme_tone(shown) == "black"
    assert extreme_tone(shown, np.zeros(3, np.uint8)) == "white", "all that is not background"
    shown[:10, :10] = 200
    assert extreme_tone(shown) == "" and extreme_tone(np.zeros((4, 4, 3), np.uint8), np.zeros(3, np.uint8)) == "black"
    assert extreme_tone(np.zeros((0, 3), np.uint8)) == ""
    for value, tone in [(0, "black"), (8, "black"), (12, ""), (128, ""), (248, ""), (252, "white"), (255, "white")]:
        shown = np.full((40, 40, 3), value, np.uint8)
        assert extreme_tone(shown) == tone and extreme_tone(shown.astype(np.float32) / 255) == tone


def test_srgb_curve_at_known_points():
    np.testing.assert_allclose(srgb_encode(np.array([-1, 0, 0.0031308, 0.18, 0.5, 1, 7])),
                               [0, 0, 0.04045, 0.46135613, 0.73535698, 1, 1], atol=1e-5)
    values = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(srgb_decode(srgb_encode(values)), values, atol=1e-6)
    assert srgb_encode(np.float32([0.5])).dtype == np.float32
