"""The methods of others, with weights made by hand whose result is known; rewritten layers against plain loops."""

import dataclasses
import re

import numpy as np
import pytest
import torch
from PIL import Image
from scipy.io import savemat
from scipy.ndimage import gaussian_filter

from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.frame import LOW_RES_FILE
from lfsr_core.images.image_files import read_layers, write_layers
from lfsr_core.metrics.eia_metrics import student_95
from lfsr_core.reconstruct.methods import denoise
from lfsr_lab.experiments.engine.records import Store
from lfsr_lab.experiments.engine.truth import Truth
from lfsr_lab.experiments.rivals import makers, matlab, study
from lfsr_lab.experiments.rivals.captured import FOLDERS, TASKS, compared, made, methods, read_field
from lfsr_lab.experiments.rivals.makers import EPICNN, WEIGHTS, AngularSR, LFDnPatch, _seen, of_cells
from lfsr_lab.experiments.rivals.sheared_epi import ShearedEPI, weighted_median
from tests.support.synthetic import MINI, fails, write_reference, write_render
from tests.support.told import refuses


def linear(views, ratio):
    weights = [np.maximum(1 - np.abs(np.arange(ratio * (n - 1) + 1)[:, None] / ratio - np.arange(n)), 0)
               for n in views.shape[:2]]
    return np.einsum("ai,bj,ijhwc->abhwc", *weights, views)


def shifted(y, x):
    """A texture that lies ``y`` pixels lower and ``x`` further left."""
    noise = gaussian_filter(np.random.default_rng(0).normal(0.5, 2, (40, 96, 3)), (1.5, 1.5, 0))
    return np.roll(np.clip(noise, 0, 1), (-y, -x), (0, 1))[4:36, 16:80]


def field(rows, columns, down, right):
    """Views (rows, columns, H, W, 3) of which each is ``shifted`` by so much from the one before."""
    return np.stack([np.stack([shifted(down * y, right * x) for x in range(columns)]) for y in range(rows)])


def test_sheared_epi_finds_the_shear_of_each_view(tmp_path):
    differences(tmp_path)
    corners = field(2, 2, 4, 4)
    made = ShearedEPI(tmp_path, 5)(corners, 4)
    for y, x in [(0, 1), (2, 2), (3, 1), (4, 3)]:
        ours, mixed = (np.abs(views[y, x] - shifted(y, x))[6:-6, 8:-8].mean() for views in (made, linear(corners, 4)))
        assert ours < 0.02 < mixed
    np.testing.assert_array_equal(made[::4, ::4], corners)


def test_a_weighted_median_keeps_edges_of_its_guide_colours_come_back_and_cells_share_borders():
    guide = np.zeros((20, 20, 3))
    guide[:, 10:] = 200
    labels = (guide[..., 0] > 0).astype(int) * 3
    labels[4, 4], labels[5, 15] = 5, 0
    clean = weighted_median(labels, guide, 6)
    assert (clean[:, :10] == 0).all() and (clean[:, 10:] == 3).all()
    views = np.random.default_rng(0).random((3, 3, 2, 2, 3)).astype(np.float32)
    np.testing.assert_allclose(of_cells(views, 4, lambda corners: linear(corners, 4)), linear(views, 4), atol=1e-6)
    extremes = matlab.to_ycbcr(np.array([[1.0, 1, 1], [0, 0, 0]])) * 255
    np.testing.assert_allclose(extremes, [[235, 128, 128], [16, 128, 128]], atol=1e-6)
    colours = np.random.default_rng(1).random((5, 3))
    np.testing.assert_allclose(matlab.from_ycbcr(matlab.to_ycbcr(colours)), colours, atol=1e-9)
    spot = np.zeros((5, 5, 2))
    spot[2, 2], spot[:, 4, 1] = 9, 1
    assert not matlab.median3(spot)[..., 0].any() and matlab.median3(spot).shape == (5, 5, 2)


def test_epicnn_interpolates_both_axes_of_views(tmp_path):
    tent(tmp_path)
    grey = np.repeat(field(2, 3, 1, 2)[..., :1], 3, -1)
    made = EPICNN(tmp_path)(grey)
    assert made.shape[:2] == (4, 7)
    np.testing.assert_allclose(made, linear(grey, 3), atol=2e-3)
    assert EPICNN(tmp_path)(grey[:1]).shape[:2] == (1, 7)


def test_angular_sr_puts_new_views_in_the_order_of_matlab(tmp_path):
    """Columns first, without the corners: number 6 lies below the top right of the first column's six."""
    numbered(tmp_path, 2)
    corners = torch.tensor([[0.1, 0.2], [0.3, 0.4]])[:, :, None, None].expand(2, 2, 140, 3)
    luma = AngularSR(tmp_path).luma(corners)[:, :, 70, 1]
    np.testing.assert_allclose(luma[::7, ::7], [[0.1, 0.2], [0.3, 0.4]])
    np.testing.assert_allclose(luma[1:7, 0] * 100, range(6), atol=1e-5)
    np.testing.assert_allclose(luma[:, 1] * 100, range(6, 14), atol=1e-5)
    colour = np.broadcast_to(np.random.default_rng(0).random((2, 2, 1, 1, 3)), (2, 2, 140, 3, 3))
    made = AngularSR(tmp_path)(colour)
    assert made.shape == (8, 8, 140, 3, 3) and np.ptp(made[3, 3, :, 0, 0]) < 1e-6  # bands join
    np.testing.assert_array_equal(made[::7, ::7], colour)


def test_lfdnpatch_sees_the_patches_that_match(tmp_path):
    views = field(3, 4, 2, 3)
    whole = np.round(views * 255).astype(np.int16)
    seen = _seen(whole, 1, 1)
    np.testing.assert_array_equal(seen[..., -3:], whole[1, 1])
    inside = seen[:20, 20:40].reshape(20, 20, 7, 3)  # three views of its row and the one above see all of it
    assert all(np.abs(inside[:, :, number] - inside[:, :, -1]).max() == 0 for number in range(4))
    path = tmp_path / WEIGHTS
    path.parent.mkdir(parents=True)
    weight = torch.zeros(3, 21, 3, 3)
    weight[range(3), range(3), 1, 1] = -0.5
    torch.save({"model.0.weight": weight, "model.0.bias": torch.full((3,), 0.1)}, path)
    expected = (seen[..., -3:] + 0.5 * seen[..., :3]) / 255 - 0.1
    np.testing.assert_allclose(LFDnPatch(tmp_path)(views)[1, 1], np.clip(expected, 0, 1), atol=1e-6)


def test_noise_is_estimated_and_views_keep_their_places(tmp_path):
    random = np.random.default_rng(0)
    assert makers.deviation(random.normal(0.5, 0.1, (200, 200))) == pytest.approx(0.1, rel=0.05)
    assert makers.deviation(np.zeros((8, 8))) == 0
    program = tmp_path / "LFBM5D" / makers.PROGRAM
    program.parent.mkdir()
    # A stand-in with its arguments: 4 and 5 count the views, 13 and 15 are the folders of noisy and clean ones.
    program.write_text('#!/bin/sh\n[ "$4 $5" = "3 2" ] && cp "${13}"/* "${15}"\n')
    program.chmod(0o755)
    views = random.integers(0, 256, (2, 3, 5, 7, 3)) / 255
    np.testing.assert_allclose(makers.filtered(makers.program(tmp_path), views), views, atol=1e-6)
    refuses("ended with 1 and no views", makers.filtered, program, views[:, :2])


@pytest.mark.parametrize(("load", "message"), [(makers.program, "has no program LFBM5Ddenoising: compile it"),
                                               (EPICNN, "clone the repository 'lfepicnn' into")])
def test_what_is_missing_is_one_sentence(tmp_path, load, message):
    refuses(message, load, tmp_path)


def test_matlabs_convolutions_and_resizing_are_made_as_by_its_own():
    weight = np.array([[1.0, 10], [100, 1000]])[:, :, None, None]
    made = matlab.transposed(torch.tensor([[[[1.0, 2]]]]), weight, np.array([0.5]), (2, 2))
    np.testing.assert_allclose(made[0, 0], np.array([[1, 10, 2, 20], [100, 1000, 200, 2000]]) + 0.5)
    weight = np.zeros((3, 3, 1, 1))
    weight[0, 1] = 1  # the pixel above
    made = matlab.convolution(torch.arange(6.0).reshape(1, 1, 3, 2), weight, np.zeros(1), 1)
    np.testing.assert_array_equal(made[0, 0], [[0, 0], [0, 1], [2, 3]])
    # (-.5, 1.25 and 1.75 samples away, of which one is mirrored): -.0703125 - .0234375
    assert matlab.resize_matrix(2, 4)[0, 1] == pytest.approx(-0.09375)
    np.testing.assert_allclose(matlab.resize_matrix(7, 23).sum(1), 1)
    line = np.arange(30.0)
    np.testing.assert_allclose(matlab.resized(line, 0, 15)[3:-3], line.reshape(15, 2).mean(1)[3:-3])
    line = np.arange(8.0)**2
    np.testing.assert_array_equal(matlab.moved(line, 0, 2.0, cubic=True), [4, 9, 16, 25, 36, 49, np.nan, np.nan])
    np.testing.assert_allclose(matlab.moved(line, 0, -0.5, cubic=False)[:3], [np.nan, 0.5, 2.5])
    assert matlab.moved(line, 0, 0.5, cubic=True)[3] == pytest.approx(3.5**2)  # exact for a parabola


@pytest.mark.parametrize(("pad", "step"), [((1, 0), 1), ((0, 1), 2)])
def test_four_axes_are_convolved_as_by_loops(pad, step):
    random = np.random.default_rng(0)
    x, weight, bias = (random.normal(size=size) for size in [(3, 4, 2, 5, 6), (3, 2, 2, 3, 2, 3), 3])
    made = matlab.convolution_4d(torch.tensor(x, dtype=torch.float32), weight, bias, pad, step).numpy()
    wide = np.pad(x, [(pad[1], pad[1])] * 2 + [(0, 0)] + [(pad[0], pad[0])] * 2)
    for row, column, out, y, left in [(0, 0, 0, 0, 0), np.array(made.shape) - 1]:
        part = wide[row * step:row * step + 2, column * step:column * step + 3, :, y:y + 3, left:left + 2]
        expected = (part * weight[..., out].transpose(2, 3, 4, 0, 1)).sum() + bias[out]
        assert made[row, column, out, y, left] == pytest.approx(expected, rel=1e-4)


SIZE = (50, 54)


def ramp(rows, columns):
    """Views that grow brighter downwards by 6 and rightwards by 2 of 255."""
    values = 60 + 6 * np.arange(rows)[:, None] + 2 * np.arange(columns)
    return np.broadcast_to(values[:, :, None, None, None], (rows, columns, *SIZE, 3)).astype(np.uint8)


@pytest.fixture
def clones(tmp_path):
    for field, views, pattern in [("antinous", ramp(9, 9), "input_Cam{number:03d}.png"),
                                  ("translucent", ramp(7, 7), "translucent_{row:02d}_{column:02d}.png"),
                                  ("Amethyst", ramp(1, 17), "out_00_{column:02d}_-399.5_{number}.25_.png")]:
        folder = tmp_path / FOLDERS[field]
        folder.mkdir(parents=True)
        for row, column in np.ndindex(views.shape[:2]):
            number = row * views.shape[1] + column
            Image.fromarray(views[row, column]).save(folder / pattern.format(row=row, column=column, number=number))
    return tmp_path


@pytest.mark.parametrize("task", [task for task in TASKS if task.field != "t_rex"], ids=lambda task: task.name)
def test_views_between_come_back_in_their_places(clones, task):
    views = read_field(clones, task)
    tent(clones)
    assert views.shape[1] == task.made and views.shape[0] in (1, task.made)
    for name in set(methods(task, views)) & {"bilinear", "bicubic", "EPICNN"}:
        shown = made(views, task, name, clones).astype(float)
        # The kernels of ours and cubic ones in the networks round the corners of a ramp that ends.
        assert np.abs(shown - views)[..., 10:-10, 10:-10, :].max() <= (3 if "bicubic" in name else 1.01), name
    assert ("Sheared-EPI" in methods(task, views)) == (task.shear > 0)


def test_only_views_that_were_left_out_count_and_renders_of_both_widths_have_their_folders(tmp_path):
    views = np.random.default_rng(0).integers(0, 200, (4, 4, *SIZE, 3)).astype(np.uint8)
    shown = views.copy()
    shown[::3, ::3] = 0
    assert compared(shown, views, 3).psnr == 100 and compared(shown, views, 3).ssim == pytest.approx(1)
    shown = views + np.uint8(51)  # luma has 219 steps for 255
    assert compared(shown, views, 3).psnr == pytest.approx(-20 * np.log10(0.2 * 219 / 255), abs=0.01)
    shown[:, :, :22] = shown[:, :, -22:] = 0
    assert compared(shown, views, 3).psnr == pytest.approx(-20 * np.log10(0.2 * 219 / 255), abs=0.01)
    (tmp_path / "cloth.blend").touch()
    where = study.place("cloth", Store(tmp_path / "out"), [tmp_path / "empty", tmp_path])
    wide, narrow = (study.job(where, view) for view in (study.View(7, 16), study.View(7, 16, study.NARROW)))
    assert (wide.view_aperture, narrow.view_aperture) == (7, 1)
    assert wide.output != narrow.output and narrow.output.endswith(study.folder_of(study.View(7, 16, study.NARROW)))
    assert wide.display.low_views(7) == (6, 6) and wide.display.low_views(3) == (14, 14)
    assert study.rendered_scenes([tmp_path], tmp_path, Store(tmp_path / "out", may_render=False)) == {}


def test_a_field_that_is_not_whole(clones, tmp_path, capsys):
    for path in (clones / FOLDERS["Amethyst"]).glob("out_00_1[56]_*"):
        path.unlink()
    with pytest.raises(LfsrError, match="has 15 views across, expected 16"):
        read_field(clones, next(task for task in TASKS if task.field == "Amethyst"))
    assert "is no folder" in fails(["study", "rivals", str(tmp_path / "none"), "-o", str(tmp_path / "out")], capsys)


NINE = dataclasses.replace(MINI, name="nine", panel_pixels=(144, 108), views=(9, 9))


@pytest.mark.skipif(bool(denoise.why_missing()), reason="needs Open Image Denoise")
def test_a_linear_network_is_linear_interpolation(tmp_path):
    tent(tmp_path)
    truth = Truth(write_reference(tmp_path / "reference", display=NINE))
    render = write_render(tmp_path / "render", 3, NINE)
    color = read_layers(render / LOW_RES_FILE)["color"]
    color[..., 3] = 1  # a denoiser leaves what shows nothing as it is, with a sharp edge
    write_layers(render / LOW_RES_FILE, {"color": color})
    row = study.measure(render, truth, "oidn", tmp_path)
    assert list(row.followers) == ["bilinear", "bicubic", "pool", "EPICNN"]
    linear, network = row.followers["bilinear"], row.followers["EPICNN"]
    assert len(linear.ssim) == len(truth.lenses) == len(network.squared)
    np.testing.assert_allclose(network.ssim, linear.ssim, atol=0.05)
    assert network.psnr == pytest.approx(linear.psnr, abs=1)


def test_a_page_is_made_of_means_and_differences_in_pairs():
    def row(*ssim):
        return study.Row(2.0, {name: study.Figures(tuple(value + shift for value in ssim), (0.01, 0.01), 1.0)
                         for name, shift in [("bilinear", -0.1), ("pool", 0.0)]})

    rows = {(scene, study.View(scale, samples, width), "denoise"): row(0.8, 0.9) for scene in list(study.SCENES)[:2]
            for scale in (7, 3) for samples in (4, 16) for width in ("wide", "narrow")}
    rows["helmet", study.View(7, 16), "oidn"] = row(0.7, 0.9)
    record = study.record(rows, {})
    entry = record["scenes"]["helmet"]["s7-spp16-wide"]
    assert entry["denoise+bilinear"] == [0.75, 20.0, 3.0, -0.1, 0.0]
    assert entry["oidn+pool"][3:] == [-0.05, pytest.approx(0.05 * student_95(1), abs=1e-3)]
    page = study.markdown(record)
    assert "| `denoise+pool` | .850, 20.0 |" in page and not re.search(r"\bnan\b", page)


def cells(path, layers):
    """Write (weights, biases) as two cell arrays of MATLAB."""
    path.parent.mkdir(parents=True)
    held = {}
    for key, values in zip(("weight", "bias"), zip(*layers, strict=True), strict=True):
        held[key] = np.empty((1, len(values)), object)
        for index, value in enumerate(values):
            held[key][0, index] = value.astype(np.float32)
    savemat(path, held)


def zeros(*shape):
    return np.zeros(shape), np.zeros(shape[2])


def differences(clones):
    """Sheared-EPI: the score is minus the absolute difference of both rows."""
    shapes = [(9, 32), (32, 64), (64, 64), (64, 64), (64, 64), (64, 128), (32, 128), (64, 1)]
    layers = [(np.zeros((3, 3, *shape)), np.zeros(shape[1] if index < 4 or index == 7 else shape[0]))
              for index, shape in enumerate(shapes)]
    layers[0][0][1, 1, [0, 8], 0] = 1, -1
    layers[0][0][1, 1, [0, 8], 1] = -1, 1
    layers[7][0][1, 1, 32:34, 0] = -1  # after 32 channels from below come those of the first layer
    cells(clones / "Sheared-EPI/Model/model.mat", layers)


def tent(clones):
    """EPICNN: three rows for each, by linear interpolation."""
    first, second, last = np.zeros((5, 5, 1, 64)), np.zeros((5, 5, 64, 32)), np.zeros((9, 9, 1, 32))
    first[2, 2, 0, 0] = second[2, 2, 0, 0] = 1
    last[2:7, 4, 0, 0] = np.array([1, 2, 3, 2, 1]) / 3
    cells(clones / "lfepicnn/EPICNN/EPICNN_model.mat", [(first, np.zeros(64)), (second, np.zeros(32)),
                                                        (last, np.zeros(1))])


def numbered(clones, pairs):
    """LightFieldAngularSR: the luma of the n-th new view is n / 100."""
    shapes = {"pre_level1_conv6d": ((3, 3, 3, 3, 1, 64), ""), "level1_conv6d": ((3, 3, 2, 2, 64, 60), ""),
              "pre_level1_conv6d_": ((3, 3, 2, 2, 1, 16), "_2"), "level1_conv6d_": ((3, 3, 2, 2, 16, 64), "_post"),
              "level1_conv6d__": ((3, 3, 2, 2, 64, 60), "_post2")}
    for pair in range(1, pairs + 1):
        shapes |= {f"level{pair}_conv6d___": ((3, 3, 1, 1, 64, 64), "_mid"),
                   f"level{pair}_conv6d____": ((1, 1, 3, 3, 64, 64), "_mid2")}
    entries = []
    for name, (shape, end) in shapes.items():
        bias = np.arange(60) / 100 if shape[-1] == 60 and not end else np.zeros(shape[-1])
        entries += [(f"{name.rstrip('_')}_f{end}", np.zeros(shape)), (f"{name.rstrip('_')}_b{end}", bias)]
    params = np.empty((1, len(entries)), [("name", object), ("value", object)])
    for index, entry in enumerate(entries):
        params[0, index] = entry
    path = clones / f"LightFieldAngularSR/pretrained_models/Layer{pairs}.mat"
    path.parent.mkdir(parents=True, exist_ok=True)
    savemat(path, {"net": {"params": params}})
