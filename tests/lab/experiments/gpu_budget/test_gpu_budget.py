"""The counts, the milliseconds that follow from them, and the measurement on whatever device is here."""

import itertools

import pytest
import torch
from torch.utils.flop_counter import FlopCounterMode

from lfsr_core.optics.display import builtin_names, load_display
from lfsr_lab.experiments.engine.records import Store
from lfsr_lab.experiments.gpu_budget import study
from lfsr_lab.experiments.gpu_budget.study import best_device, measure, tensor_steps
from lfsr_lab.networks.denoiser import Denoiser
from tests.support.played_blender import played_blender
from tests.support.told import refuses

DISPLAY = load_display("bupt-32in-8k")


def test_the_denoiser_has_the_operations_that_pytorch_counts_and_samples_are_those_of_the_rendered_pixels():
    widths, inputs = study.shipped_network()
    with FlopCounterMode(display=False) as counted, torch.inference_mode():
        Denoiser(widths, inputs)(torch.zeros(1, inputs, 64, 48))
    assert study.denoiser_work(64 * 48).operations == counted.get_total_flops()
    assert {work.step: work.samples for work in study.frame_work(DISPLAY, 4, 16)}[study.TRACE] == 1920 * 1080 * 16


def test_each_display_has_its_steps_at_its_scales_and_the_samples_that_fit_fill_the_frame():
    for display in map(load_display, builtin_names()):
        steps = [work.step for work in study.frame_work(display, display.scales()[0], 1)]
        woven = [study.WEAVE] if display.is_woven else []
        assert steps == [study.TRACE, study.DENOISE, study.INTERPOLATE, *woven, study.SHOW]
        assert study.INTERPOLATE not in [work.step for work in study.frame_work(display, 1, 1)]
    refuses("scale is 3", study.frame_work, DISPLAY, 3, 1)
    for gpu, scale in itertools.product(study.read_gpus(), (2, 4, 8)):
        fitting, steps = study.fitting_samples(gpu, DISPLAY, scale), study.frame_work(DISPLAY, scale, 1000)
        at_highest, at_lowest = study.frame_ms(gpu, steps)
        others = sum(gpu.least_ms(work)[0] for work in steps if work.step != study.TRACE)
        for samples, whole in zip(fitting, (at_lowest, at_highest), strict=True):
            assert others + (whole - others) * samples / 1000 == pytest.approx(study.FRAME_MS)
        assert fitting[0] <= fitting[1]


def test_a_measured_frame_has_every_step_and_its_row_as_tensors_have_of_a_lenticular_panel(tmp_path):
    display = load_display("looking-glass-portrait")
    scale = display.scales()[0]
    steps = tensor_steps(torch.rand(4, 6, 1, display.views[0] // scale, 3).numpy(), (scale, 1), display, best_device())
    assert set(steps) == {study.INTERPOLATE, study.WEAVE, study.SHOW} and all(value > 0 for value in steps.values())
    scene = tmp_path / "disc.blend"
    scene.touch()
    measured = measure(Store(tmp_path / "out", played_blender(tmp_path / "blender")), scene, load_display("mini"), 2, 1)
    assert set(measured.milliseconds) == {study.TRACE, study.DENOISE, study.INTERPOLATE, study.SHOW}
    assert measured.samples_per_second > 0
    assert f"| {measured.device} | {measured.tensors} | 2, 1 |" in study.markdown(study.read_gpus(), [measured])
