"""Training scenes at tiny size: complete, repeatable, resumable files that agree with each other."""

import json
import zipfile

import bpy
import numpy as np
import OpenImageIO as oiio
import pytest

from lfsr_core.optics.display import DisplayProfile, write_profile
from lfsr_core.optics.panel.subpixel_rays import rendered_size
from lfsr_lab.scenes.training.models import find_models, load_model, prepare_models, prepare_textures
from lfsr_lab.scenes.training.stage import training_display
from tests.support.processes import ROOT, run_script
from tests.support.told import refuses

pytestmark = pytest.mark.slow
SCALE, LENSES, VIEWS = 2, (6, 4), (8, 8)
SPPS, REFERENCE_SPP, SEED = (1, 16), 96, 10
NAMES = ("1_0", "1_1", "1_2", "1_3", "16_0", "16_1", "target")
DISPLAY = DisplayProfile("tiny", (48, 32), (88.56, 59.04), LENSES, VIEWS, 500.0, 40.0)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A display file and two photographs."""
    folder = tmp_path_factory.mktemp("inputs")
    write_profile(folder / "tiny.toml", DISPLAY)
    rng = np.random.default_rng(0)
    for index in range(2):
        write_picture(folder / "photos" / f"{index}.png", rng.random((48, 64, 3), np.float32))
    return folder


def write_picture(path, pixels):
    path.parent.mkdir(exist_ok=True)
    assert oiio.ImageBuf((pixels * 255).astype(np.uint8)).write(str(path))


def run(inputs, models, output, *options):
    """The script in a process of its own: exit code and its messages."""
    return run_script("training_scenes.py", "--output", output, "--display", inputs / "tiny.toml", "--textures",
                      inputs / "photos", "--models", models, "--scale", SCALE, "--spps", ",".join(map(str, SPPS)),
                      "--reference-spp", REFERENCE_SPP, "--seed", SEED, "--threads", 2, *options)


CUBE = "mtllib cube.mtl\n" + "".join(f"v {x} {y} {z}\n" for x in (0, 40) for y in (0, 20) for z in (0, 20)) + \
    "usemtl paint\nf 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 4 8 7\nf 1 3 7 5\nf 2 4 8 6\n"


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """A folder with one model."""
    folder = tmp_path_factory.mktemp("models")
    folder.joinpath("cube.obj").write_text(CUBE, encoding="utf-8")
    folder.joinpath("cube.mtl").write_text("newmtl paint\nKd 0.8 0.5 0.2\n", encoding="utf-8")
    folder.joinpath("licenses.json").write_text('{"cube.obj": {"license": "CC0", "author": "nobody"}}', "utf-8")
    return folder


@pytest.fixture(scope="module")
def scenes(inputs, models, tmp_path_factory):
    """Folder with scenes 8 and 9."""
    folder = tmp_path_factory.mktemp("scenes")
    code, messages = run(inputs, models, folder, "--first", 8, "--count", 2)
    assert code == 0, messages
    return folder


def load(folder, index):
    with np.load(folder / f"scene_{index:06d}.npz", allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    return arrays, json.loads(str(arrays.pop("meta")))


def test_a_file_holds_every_render_and_how_it_was_made(scenes):
    (arrays, meta), (_, following) = (load(scenes, index) for index in (8, 9))
    assert not meta["validates"] and following["validates"], "every tenth scene"
    width, height = (lens * view // SCALE for lens, view in zip(LENSES, VIEWS, strict=True))
    shapes = {"color": (height, width, 4), "guides": (height, width, 6)}
    assert {name: array.shape for name, array in arrays.items()} == {
        f"{kind}_{name}": shape for kind, shape in shapes.items() for name in NAMES}
    assert all(array.dtype == np.float16 and np.isfinite(array).all() for array in arrays.values())
    assert (meta["lenses"], meta["views"], meta["scale"]) == (list(LENSES), list(VIEWS), SCALE)
    assert (meta["spps"], meta["reference_spp"]) == (list(SPPS), REFERENCE_SPP)
    assert (meta["seed"], meta["index"], following["index"]) == (SEED, 8, 9)
    assert len(set(meta["seeds"].values())) == len(NAMES)


@pytest.mark.parametrize("index", [8, 9])
def test_layers_hold_what_their_names_say_and_renders_are_the_clean_target_and_noise_of_their_own(scenes, index):
    arrays, meta = load(scenes, index)
    for name in NAMES:
        color, guides = (arrays[f"{kind}_{name}"].astype(np.float32) for kind in ("color", "guides"))
        alpha, albedo, normal = color[..., 3], guides[..., :3], guides[..., 3:]
        assert alpha.min() >= 0 and alpha.max() <= 1.001 and alpha.max() > 0.3
        assert albedo.min() >= 0 and albedo.max() > 0.02
        assert np.linalg.norm(normal, axis=-1).max() <= 1.01 and normal.min() < 0 < normal.max()
        assert max(np.abs(layer[alpha == 0]).max(initial=0) for layer in (color, guides)) < 1e-3
    lit, (rows, columns) = arrays["color_target"][..., 3], (view // SCALE for view in VIEWS[::-1])
    sees = (lit.reshape(LENSES[1], rows, LENSES[0], columns).max((1, 3)) > 0).mean()
    assert meta["p"] == pytest.approx(sees) and meta["p"] >= 0.25
    color = {name: np.clip(arrays[f"color_{name}"].astype(np.float64), 0, 2) for name in NAMES}
    assert not np.array_equal(color["16_0"], color["16_1"])
    errors = {name: (color[name] - color["target"]) ** 2 for name in NAMES}
    assert errors["16_0"].mean() < errors["1_0"].mean() / 2
    # The mean of two renders: their difference tells its noise, and the target has a third of that.
    noise, error = ((color["16_0"] - color["16_1"]) / 2) ** 2, ((color["16_0"] + color["16_1"]) / 2
                                                                - color["target"]) ** 2
    kept = error <= np.quantile(error, 0.98)  # clamped highlights apart
    assert error[kept].mean() < 3 * noise[kept].mean() + 1e-6
    shifted = ((color["16_0"] + color["16_1"]) / 2 - np.roll(color["target"], 1, axis=1)) ** 2
    assert shifted[kept].mean() > error[kept].mean()


def test_a_scene_does_not_depend_on_order_or_place_but_on_its_number_and_seed(inputs, models, scenes, tmp_path):
    for folder, options in ((tmp_path, ()), (tmp_path / "other", ("--seed", SEED + 1))):
        code, messages = run(inputs, models, folder, "--first", 9, *options)
        assert code == 0, messages
    described = [load(*where)[1]["scene"] for where in ((scenes, 8), (scenes, 9), (tmp_path / "other", 9))]
    assert described[1] not in (described[0], described[2])
    (arrays, meta), (again, meta_again) = load(scenes, 9), load(tmp_path, 9)
    assert meta_again["exposure"] == meta["exposure"]
    assert meta_again["scene"] == meta["scene"] and meta_again["seeds"] == meta["seeds"]
    for name in arrays:
        close = np.isclose(arrays[name].astype(np.float32), again[name].astype(np.float32), rtol=0.02, atol=0.02)
        assert close.mean() > 0.98, name


def test_a_second_run_makes_only_what_is_missing(inputs, models, scenes):
    kept, lost = (scenes / f"scene_{index:06d}.npz" for index in (8, 9))
    before = kept.stat().st_mtime_ns
    lost.unlink()
    remains = scenes / ".scene_000009-killed.npz"
    remains.write_bytes(b"half")
    code, messages = run(inputs, models, scenes, "--first", 8, "--count", 2)
    assert code == 0 and messages[0] == {"stage": "start", "scenes": 1, "complete": 1}
    assert kept.stat().st_mtime_ns == before and lost.is_file() and not remains.exists()


def test_bad_input_is_one_sentence(inputs, models, scenes, monkeypatch):
    code, messages = run(inputs, models, scenes, "--first", 7, "--spps", "4")
    assert code == 2 and messages[-1]["stage"] == "error"
    assert "other settings" in messages[-1]["message"] and "\n" not in messages[-1]["message"]
    assert not (scenes / "scene_000007.npz").exists()
    monkeypatch.syspath_prepend(str(ROOT / "scripts" / "lab" / "lfsr_lab" / "scenes"))
    import training_scenes

    for option, value, pattern in (("--reference-spp", "0", "is 0"), ("--textures", "nowhere", "nowhere"),
                                   ("--spps", "1,x", "'1,x'"), ("--scale", "3", "scale is 3")):
        words = ["--output", str(scenes), "--display", str(inputs / "tiny.toml"), option, value]
        refuses(pattern, lambda words=words: training_scenes.run(training_scenes.parse(words)))


def test_photographs_are_made_small_and_random_displays_stay_small(monkeypatch, tmp_path):
    monkeypatch.setattr("lfsr_lab.scenes.training.models.SIZE", 40)
    write_picture(tmp_path / "big" / "photo.png", np.full((60, 120, 3), [0.2, 0.5, 0.8], np.float32))
    assert prepare_textures(tmp_path / "big", tmp_path / "small") == 1
    small = oiio.ImageBuf(str(tmp_path / "small" / "photo.jpg"))
    assert (small.spec().width, small.spec().height) == (40, 20)
    assert small.get_pixels(oiio.FLOAT).mean((0, 1)) == pytest.approx([0.2, 0.5, 0.8], abs=0.02)
    chosen = [training_display(np.random.default_rng(seed)) for seed in range(200)]
    pixels = [np.prod(rendered_size(profile) if scale == 1 else np.multiply(profile.lenses, profile.low_views(scale)))
              for profile, scale in chosen]
    assert min(pixels) > 20_000 and max(pixels) < 80_000
    assert {scale for _, scale in chosen} == {1, 2, 3, 4, 5}
    assert {profile.parallax for profile, _ in chosen} == {(True, True), (True, False)}


def test_models_are_centred_and_named_with_their_license_and_torn_ones_and_those_of_tests_left_out(models, tmp_path):
    (path, fact), = find_models(models).items()
    assert fact == {"file": "cube.obj", "license": "CC0", "author": "nobody"}
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    corners = np.array([vertex.co for vertex in load_model(path).data.vertices])
    assert corners.min(0) == pytest.approx([-1, -0.5, -0.5]) and corners.max(0) == pytest.approx([1, 0.5, 0.5])
    catalog = "license=Public domain\n"
    with zipfile.ZipFile(tmp_path / "some.sh3f", "w") as archive:
        for number, (name, texture) in enumerate({"stool": "", "torn": "map_Kd lost.jpg", "japaneseMaple": ""}.items()):
            archive.writestr(f"some/{name}/{name}.obj", CUBE)
            archive.writestr(f"some/{name}/{name}.mtl", f"newmtl paint\n{texture}\n")
            catalog += f"model#{number}=/some/{name}/{name}.obj\ncreator#{number}=Ann\n"
        archive.writestr("PluginFurnitureCatalog.properties", catalog)
    assert prepare_models(tmp_path, tmp_path / "models") == 1
    assert list(find_models(tmp_path / "models").values()) == [
        {"file": "some/some/stool/stool.obj", "license": "Public domain", "author": "Ann"}]
