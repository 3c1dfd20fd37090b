"""A whole plan on a synthetic light field with noise, its renders played by NumPy: estimates against whole frames."""

import dataclasses
import math
import re
import shutil
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.messages import LfsrError, Notice, Progress
from lfsr_core.base.records import read_record, write_record
from lfsr_core.base.system import read_json
from lfsr_core.frames.frame import LOW_RES_FILE, WORLD_FILE, Request, Sampling, read_frame, samples_at, write_frame
from lfsr_core.images.color import srgb_encode
from lfsr_core.images.image_files import read_layers, write_layers
from lfsr_core.metrics.eia_metrics import stacked_ssim
from lfsr_core.optics.display import load_display
from lfsr_core.optics.rays import to_elemental_images
from lfsr_core.optics.world_view import WorldImage
from lfsr_core.plan import options as plan_options
from lfsr_core.plan import planner
from lfsr_core.plan.options import Candidate, Estimate, PlanOptions, Rated, choose, estimate
from lfsr_core.plan.planner import LEAST_LENSES, Planned, SampleRenders, lens_count, make_plan, reach, sampled_lenses
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, PLAIN_METHOD
from lfsr_core.reconstruct.second_stage import finished_linear
from lfsr_core.reconstruct.upscaler import finished_layout
from tests.support import noisy_renders
from tests.support.finished import finished
from tests.support.noisy_renders import JOB, render
from tests.support.synthetic import MINI, frame_of, light_field
from tests.support.told import refuses

OPTIONS = PlanOptions(target=0.9, scales=(2, 4), samples=(4, 16, 64), methods=("nearest", "bilinear"), lenses=40,
                  reference_samples=1024)


def plan(job: Request, options: PlanOptions, render: Callable[[Request], None], folder: Path) -> Planned:
    return make_plan(job, options, lambda job, tell: render(job), folder)


@pytest.fixture
def rendered(tmp_path):
    """Jobs that were rendered, and a ``render`` that remembers them."""
    jobs = []

    def remember(job: Request) -> None:
        jobs.append(job)
        render(job)
    return jobs, remember


def accuracy(folder: Path, candidate) -> float:
    """Accuracy of a whole frame of ``candidate``, mean over the lenses that show foreground."""
    sampling = Sampling(candidate.scale, candidate.samples)
    render(dataclasses.replace(JOB, output=str(folder), sampling=sampling, seed=991))
    lenses = MINI.lenses
    image = to_elemental_images(finished_linear(folder, candidate.method), lenses)
    exact = to_elemental_images(light_field(), lenses)
    hit = exact[..., 3].any((2, 3))
    shown, wanted = (srgb_encode(values[hit][..., :3]) for values in (image, exact))
    return float(stacked_ssim(shown, wanted, wanted).mean())


def test_estimates_are_near_those_of_whole_frames_and_accuracy_of_the_whole_array_counts_every_lens(tmp_path):
    planned = plan(JOB, OPTIONS, render, tmp_path / "sample")
    assert len(planned.candidates) == 12
    for number, row in enumerate(planned.candidates):
        if row.estimate is None:
            continue
        true = accuracy(tmp_path / f"whole{number}", row.candidate)
        assert abs(row.estimate.mean - true) < 2 * (row.estimate.mean - row.low) + 0.004, row
    assert sum(row.estimate is not None for row in planned.candidates) >= 6
    options = dataclasses.replace(OPTIONS, metric="ssim_lens", scales=(4,), samples=(16,))
    planned = plan(JOB, options, render, tmp_path / "array")
    row, folder = next(row for row in planned.candidates if row.candidate.method == "bilinear"), tmp_path / "whole"
    render(dataclasses.replace(JOB, output=str(folder), sampling=Sampling(4, 16), seed=991))
    shown, wanted = (srgb_encode(to_elemental_images(image[..., :3], MINI.lenses)).reshape(-1, 8, 8, 3)
                     for image in (finished_linear(folder, "bilinear"), light_field()))
    true = float(stacked_ssim(shown, wanted, wanted).mean())
    assert abs(row.estimate.mean - true) < 2 * (row.estimate.mean - row.low) + 0.004


def test_chosen_meets_the_target_and_costlier_candidates_were_not_rendered(tmp_path, rendered):
    jobs, remember = rendered
    planned = plan(JOB, dataclasses.replace(OPTIONS, target=0.55), remember, tmp_path / "sample")
    chosen = planned.choice.chosen
    assert chosen is not None and chosen.estimate.low >= 0.55
    assert accuracy(tmp_path / "whole", chosen.candidate) >= 0.55
    assert (2, 64) not in {(job.sampling.scale, job.sampling.samples) for job in jobs}
    skipped = [row for row in planned.candidates if row.unmeasured]
    assert {row.unmeasured.code for row in skipped} == {"candidate-not-needed"}
    assert all(row.estimate is None and row.seconds > chosen.seconds for row in skipped)


def test_random_numbers_of_every_render_are_its_own(tmp_path, rendered):
    jobs, remember = rendered
    plan(JOB, OPTIONS, remember, tmp_path / "sample")
    assert len({job.seed for job in jobs}) == len(jobs)
    assert all(job.clamp_indirect == (0.0 if job.kind == "reference" else None) for job in jobs)
    assert {job.layers for job in jobs if job.kind == "render"} == {JOB.layers}
    assert {len(job.lens_list) for job in jobs if job.lens_list} == {40}
    options = dataclasses.replace(OPTIONS, scales=(2,), samples=(4,), methods=("denoise+bilinear",))
    plan(JOB, options, remember, tmp_path / "denoised")
    assert len(jobs[-1].lens_list) > 40, "a denoiser sees the neighbours"


def test_an_unreachable_target_names_the_best_and_what_takes_too_long_is_not_chosen(tmp_path):
    planned = plan(JOB, dataclasses.replace(OPTIONS, target=0.9999, scales=(4,)), render, tmp_path / "sample")
    assert planned.choice.chosen is None
    assert planned.choice.best.method == "bilinear" and planned.choice.best.samples >= 16
    assert planned.choice.limit.code in ("plan-limit-upscaling", "plan-limit-noise")
    write_record(tmp_path / "plan.json", planned)
    assert read_record(tmp_path / "plan.json", Planned, "a plan") == planned
    planned = plan(JOB, dataclasses.replace(OPTIONS, target=0.3, most_seconds=0.5), render, tmp_path / "slow")
    assert planned.choice.chosen is None and planned.choice.limit.code == "plan-limit-unmeasured"
    assert {row.unmeasured.code for row in planned.candidates} == {"candidate-too-slow"}


def test_a_sample_of_other_settings_is_not_taken_and_a_damaged_one_said(tmp_path):
    folder, options = tmp_path / "sample", dataclasses.replace(OPTIONS, scales=(4,))
    plan(JOB, options, render, folder)
    with pytest.raises(LfsrError, match="sample of another scene or of other options"):
        plan(dataclasses.replace(JOB, scene="other.blend"), options, render, folder)
    again = plan(JOB, dataclasses.replace(options, target=0.3), lambda job: pytest.fail("it renders"), folder)
    assert again.choice.chosen is not None
    (folder / "s4-spp4" / LOW_RES_FILE).write_bytes(b"damaged")  # which is no fault of the methods
    refuses(rf"s4-spp4/{LOW_RES_FILE} cannot be read", plan, JOB, options, render, folder)


def test_a_small_budget_leaves_costly_candidates_out(tmp_path, monkeypatch):
    monkeypatch.setattr(planner, "LEAST_LENSES", 4)
    monkeypatch.setattr(plan_options, "FREE_PATHS", 0)
    options = dataclasses.replace(OPTIONS, target=0.999, lenses=None, reference_samples=16, budget=0.5,
                                  methods=("nearest", "pool"))  # which sees neighbours, so a lens costs nine
    planned = plan(JOB, options, render, tmp_path / "sample")
    left_out, measured = ([row for row in planned.candidates if getattr(row, at)] for at in ("unmeasured", "estimate"))
    assert {row.unmeasured.code for row in left_out} == {"candidate-over-budget", "candidate-beaten"}
    assert all(any(better.scale == row.unmeasured.values["scale"] < row.scale == worse.scale
                   and better.rays(MINI) <= worse.rays(MINI) and better.estimate.mean >= worse.estimate.mean
                   for better in measured for worse in measured)
               for row in left_out if row.unmeasured.code == "candidate-beaten")
    assert planned.sample.fraction <= 0.5 * 1.01 + 0.02


def test_a_flat_scene_gets_the_simplest_method_and_the_fewest_samples(tmp_path, monkeypatch):
    monkeypatch.setattr(noisy_renders, "NOISE", 0.002)
    flat = np.full((96, 128, 4), (0.4, 0.3, 0.2, 1), np.float32)
    monkeypatch.setattr(noisy_renders, "light_field", lambda display: flat)
    options = dataclasses.replace(OPTIONS, target=0.95, scales=(4,), samples=(4, 16),
                                  methods=("oidn+bilinear", "bilinear"))
    assert plan(JOB, options, render, tmp_path / "sample").choice.chosen.candidate == Candidate(4, 4, "bilinear")


def test_a_visible_world_is_rendered_once_and_reused(tmp_path):
    rendered = []

    def with_world(job: Request) -> None:
        render(job)
        if job.kind == "reference":
            return
        folder = Path(job.output)
        frame = dataclasses.replace(read_frame(folder), world_visible=True, world_apart=True)
        color = read_layers(folder / LOW_RES_FILE)["color"]
        write_layers(folder / LOW_RES_FILE, {"color": color, "environment": np.repeat(1 - color[..., 3:], 3, -1)})
        seconds = {**frame.seconds, "world": 0.0}
        if job.world is None:
            rendered.append(job)
            width, height = WorldImage.of(finished_layout(frame)).size
            write_layers(folder / WORLD_FILE, {"color": np.full((height, width, 3), 0.2, np.float32)})
            seconds |= {"world": 50.0, "render": seconds["render"] + 50.0}
        else:
            shutil.copyfile(job.world, folder / WORLD_FILE)
        write_frame(folder, dataclasses.replace(frame, seconds=seconds))
    options = dataclasses.replace(OPTIONS, target=0.3, scales=(2, 4), samples=(4, 16))
    planned = plan(JOB, options, with_world, tmp_path / "sample")
    assert [Path(job.output).name for job in rendered] == ["quick"]
    assert all(50 < row.seconds < 60 for row in planned.candidates) and 50 < planned.sample.seconds < 100


def test_the_first_look_has_as_many_pixels_as_blender_renders(tmp_path):
    def first(job: Request) -> None:
        raise LfsrError(f"scale is {job.sampling.scale}")
    row = dataclasses.replace(MINI, panel_pixels=(128, 8), panel_mm=(128.0, 8.0), lenses=(16, 1))
    refuses("scale is 2", plan, dataclasses.replace(JOB, display=row), OPTIONS, first, tmp_path)


def test_an_empty_scene_is_refused_and_a_black_image_is_no_perfect_one(tmp_path):
    def empty(job: Request) -> None:
        render(job)
        path = Path(job.output, LOW_RES_FILE)
        write_layers(path, {"color": np.zeros((*reversed(frame_of(job.sampling.scale).rays.size), 4), np.float32)})
    refuses("no lens shows any foreground", plan, JOB, OPTIONS, empty, tmp_path / "empty")
    def black(job):
        render(job)
        for path in Path(job.output).glob("*.exr"):
            layers = read_layers(path)
            layers["color"][..., :3] *= 1e-5
            write_layers(path, layers)

    refuses("almost black, so that every setting would seem perfect", plan, JOB, OPTIONS, black, tmp_path / "black")


GRID = (7, 5)
lens_lists = st.lists(st.tuples(st.integers(0, 4), st.integers(0, 6)), min_size=1, max_size=20, unique=True)


@given(lens_lists, st.integers(0, 2))
def test_the_sample_eia_shows_each_sampled_lens_amid_its_neighbours(lenses, reach_):
    listed, blocks = planner.with_neighbours(lenses, reach_, GRID)
    assert len(listed) == len(set(listed))
    # A render of them as one row of tiles, each with its lens's number.
    numbers = np.array([row * GRID[0] + column for row, column in listed])
    index, centres = planner.sample_eia(blocks)
    for (row, column), (y, x) in zip(lenses, centres, strict=True):
        for down in range(-reach_, reach_ + 1):
            for right in range(-reach_, reach_ + 1):
                neighbour = np.clip(row + down, 0, 4) * GRID[0] + np.clip(column + right, 0, 6)
                assert numbers[index[y + down, x + right]] == neighbour


def test_a_sampled_lens_is_finished_as_in_its_frame(tmp_path):
    lenses = list(np.ndindex(*MINI.lenses[::-1]))
    quarters = [to_elemental_images(light_field()[..., :3], MINI.lenses).reshape(-1, 8, 8, 3)] * 4
    folder = finished(tmp_path / "deep")
    layers = read_layers(folder / LOW_RES_FILE)
    layers["index"] = np.where(layers["color"][..., 2:3] > 0.5, 1, 2).astype(np.float32)  # the nearer square alone
    write_layers(folder / LOW_RES_FILE, layers)
    whole = to_elemental_images(finished_linear(folder, "nearest")[..., :3], MINI.lenses).reshape(-1, 8, 8, 3)
    expected = planner.split_scores(srgb_encode(whole), quarters)
    scores = planner.scores(folder, "nearest", np.arange(len(lenses))[:, None, None], quarters)
    assert scores == pytest.approx(expected, abs=1e-6), "lenses without foreground are filled in"

    at = [(5, 5), (1, 12), (8, 3)]
    width, (listed, blocks) = MINI.lenses[0], planner.with_neighbours(at, 1, MINI.lenses)
    blocks = np.array([row * width + column for row, column in listed])[blocks]

    def scored(chosen: slice) -> np.ndarray:
        references = [quarter[[row * width + column for row, column in at[chosen]]] for quarter in quarters]
        return planner.scores(folder, "pool", blocks[chosen], references)
    together, alone = scored(slice(3)), [*scored(slice(1)), *scored(slice(1, 2)), *scored(slice(2, 3))]
    assert together == pytest.approx(alone, abs=1e-6), "a block of lenses sees no other block"


@given(st.integers(4, 60), st.integers(0, 9))
def test_sampled_lenses_are_different_ones_of_the_mask(count, seed):
    mask = np.zeros((12, 16), bool)
    mask[3:8, 4:11] = True
    lenses = sampled_lenses(mask, count, seed)
    assert len(set(lenses)) == len(lenses) == min(count, 35) and all(mask[lens] for lens in lenses)
    assert lenses == sampled_lenses(mask, count, seed)


def test_neighbours_are_as_many_as_a_denoiser_needs():
    display = load_display("bupt-32in-8k")
    assert [reach(display, scale, ["bilinear", "denoise+pool"]) for scale in (1, 2, 4, 8)] == [0, 0, 1, 1]
    lenticular = load_display("looking-glass-16")
    # A pixel of a view is a lens, at every scale.
    assert [reach(lenticular, scale, ["denoise"]) for scale in (1, 2, 4)] == [planner.REACH_IN_A_VIEW] * 3
    assert reach(display, 8, ["bilinear", "none"]) == reach(lenticular, 4, ["bicubic"]) == 0, "they see no neighbours"
    assert reach(display, 8, ["pool"])
    display, options = load_display("bupt-32in-8k"), PlanOptions()
    counts = [lens_count(display, dataclasses.replace(options, budget=budget)) for budget in (0.0001, 0.01, 1.0)]
    assert counts == sorted(counts) and counts[0] >= planner.LEAST_LENSES and counts[-1] == planner.USUAL_LENSES
    assert lens_count(display, dataclasses.replace(options, lenses=300)) == 300


def test_progress_of_a_render_moves_that_of_the_plan(tmp_path):
    told = []

    def telling(request, tell):
        for fraction in (0.0, 0.5, 1.0):
            tell(Progress("render", fraction, "Sample"))
        tell(Notice("subject-unseen"))
        render(request)
    renders = SampleRenders(tmp_path, JOB, telling, told.append)
    renders.whole = 4 * 64 * 48
    renders.rendered("s2-spp1", "2 lenses", sampling=Sampling(2, 1), lens_list=((0, 0), (5, 5)))
    renders.rendered("quick", "every lens", sampling=Sampling(4, 4))
    assert Notice("subject-unseen") in told
    fractions = [message.fraction for message in told if isinstance(message, Progress)]
    assert fractions == sorted(fractions) and fractions[-1] == pytest.approx(
        (2 * 16 + 4 * math.prod(MINI.lenses) * 4) / renders.whole)


def test_correction_takes_some_of_the_references_noise_out(monkeypatch):
    monkeypatch.setattr(planner, "srgb_encode", lambda image: image)  # noise that is normal in display values
    random, noise = np.random.default_rng(0), 0.08
    exact = np.full((300, 24, 24, 1), 0.5)
    exact[:, :, 12:] += 0.2 * np.sin(np.arange(12) / 1.7)[:, None]
    image = exact + random.normal(0, 0.015, exact.shape)
    true = float(stacked_ssim(image, exact, exact).mean())
    quarters = [exact + random.normal(0, noise, exact.shape) for _ in range(4)]
    plain = float(stacked_ssim(image, *(np.mean(quarters[half], 0) for half in (np.s_[:2], np.s_[2:]))).mean())
    assert plain < true - 0.003 and abs(float(planner.split_scores(image, quarters).mean()) - true) < abs(plain - true)


# The choice of the cheapest candidate, from estimates of sampled lenses, and how often it is right.
METHODS = ("bilinear", "oidn+bilinear", "bicubic")
DISPLAY = load_display("bupt-32in-8k")
ARRAY = (30, 40)
RECORD = Path(__file__).parents[2] / "docs/results/measured/plan-unseen.json"


def rated(scale: int, samples: int, method: str, seconds: float, low: float | None, mean: float | None = None) -> Rated:
    estimated = None if low is None else Estimate(low + 0.01 if mean is None else mean, low, 30)
    return Rated(scale, samples, method, seconds, estimated)


@st.composite
def rows(draw) -> list[Rated]:
    keys = draw(st.lists(st.tuples(st.sampled_from((1, 2, 4)), st.sampled_from((4, 16, 64)), st.sampled_from(METHODS)),
                         min_size=1, max_size=12, unique=True))
    accuracy = st.one_of(st.none(), st.floats(0.8, 1.0))
    return [rated(*key, draw(st.floats(0.1, 100)), draw(accuracy)) for key in keys]


@given(rows(), st.floats(0.8, 1.0), st.floats(0.1, 100))
def test_what_is_chosen_meets_the_target_and_nothing_that_does_is_much_cheaper(candidates, target, most):
    choice = choose(candidates, target, most)
    confirmed = [row for row in candidates if row.low >= target and row.seconds <= most]
    assert (choice.chosen is None) == (not confirmed)
    if choice.chosen is None:
        assert choice.limit is not None
    else:
        assert choice.chosen in confirmed
        assert choice.chosen.seconds <= plan_options.AS_GOOD * min(row.seconds for row in confirmed)


def test_of_equally_cheap_candidates_the_simplest_is_taken():
    candidates = [rated(4, 16, "denoise+oidn+bilinear", 10.0, 0.97), rated(4, 16, "oidn+bilinear", 10.2, 0.96),
                  rated(4, 64, "bilinear", 10.4, 0.96), rated(2, 16, "bilinear", 11.0, 0.96)]
    assert choose(candidates, 0.95).chosen.candidate == Candidate(4, 64, "bilinear")
    assert choose(candidates[:2], 0.95).chosen.candidate == Candidate(4, 16, "oidn+bilinear")
    values = np.linspace(0.8, 1, 20)
    estimated = estimate(values, np.ones(20, bool), 20)
    assert estimated.low == estimated.mean == pytest.approx(0.9) and estimated.lenses == 20
    for count in (0, 1):
        refuses(f"{count} of 4 sampled lenses", estimate, values[:4], np.arange(4) < count, 20)


TOO_SLOW = dataclasses.replace(rated(4, 16, "bilinear", 20, None), unmeasured=Notice("candidate-too-slow", {}))


@pytest.mark.parametrize(("candidates", "code"), [
    ([rated(4, 16, "bilinear", 1, 0.90, 0.92), rated(4, 64, "bilinear", 2, 0.93, 0.94)], "plan-limit-noise"),
    ([rated(4, 16, "bilinear", 1, 0.90, 0.920), rated(4, 64, "bilinear", 2, 0.91, 0.921)], "plan-limit-upscaling"),
    ([rated(1, 16, "none", 1, 0.90, 0.920), rated(1, 64, "none", 2, 0.91, 0.921)], "plan-limit-method"),
    ([rated(4, 4, "bilinear", 1, 0.80)], "plan-limit-noise"), ([rated(1, 4, "none", 1, 0.80)], "plan-limit-noise"),
    ([rated(4, 4, "bilinear", 1, 0.80), TOO_SLOW], "plan-limit-time"),
    ([rated(4, 16, "bilinear", 1, 0.94, 0.96)], "plan-limit-certainty"),
    ([rated(4, 16, "bilinear", 1, 0.90), rated(4, 64, "bilinear", 20, 0.97)], "plan-limit-time"),
    ([rated(4, 16, "bilinear", 1, None)], "plan-limit-unmeasured")])
def test_what_limits_is_told(candidates, code):
    choice = choose(candidates, 0.95, most_seconds=10)
    assert choice.chosen is None and choice.limit.code == code
    assert choice.best is max((row for row in candidates if row.estimate and row.seconds <= 10), default=None,
                              key=lambda row: row.low)


def test_lower_bound_lies_below_the_truth_in_95_of_100_draws():
    random, mask = np.random.default_rng(0), np.zeros(ARRAY, bool)
    values = 1 - 0.15 * random.random(ARRAY)**3 - 0.02 * random.exponential(1, ARRAY)  # near 1, with a tail of bad ones
    mask[4:26, 6:34] = True
    hit = mask & (random.random(ARRAY) < 0.8)  # not all that lie beside the foreground show any
    estimates = []
    for seed in range(400):
        places = tuple(np.array(sampled_lenses(mask, 24, seed)).T)
        estimates.append(estimate(values[places], hit[places], int(mask.sum())))
    truth = values[hit].mean()
    assert np.mean([drawn.low <= truth for drawn in estimates]) >= 0.95
    assert np.mean([drawn.mean for drawn in estimates]) == pytest.approx(truth, abs=0.003)


def test_plans_of_the_recorded_scenes_meet_their_target_at_little_more_than_the_least_cost():
    """17 scenes: their candidates' accuracies are the record's, and what lenses vary by follows from its bounds."""
    actual, counts, spreads = defaultdict(dict), {}, defaultdict(list)
    for plan in read_json(RECORD, "a record")["plans"]:
        scene, facts = plan["scene"], plan["sample"]
        counts[scene], sampled = facts["foreground"], facts["lenses"]["foreground"]
        for text, accuracy in zip(plan["measured"], plan["actuals"], strict=True):
            scale, samples, method = re.fullmatch(r"s(\d+)-spp(\d+) (.*)", text).groups()
            # The default of that time ended in "epi", which a name of today does not have.
            actual[scene][Candidate(int(scale), int(samples), method.replace("bilinear+epi", "pool"))] = accuracy
        if sampled < counts[scene]:  # its bound was about 2.5 standard errors wide
            spreads[scene].append((plan["estimate"] - plan["bound"]) / 2.5 / math.sqrt(1 / sampled - 1 / counts[scene]))
    usual, met, cheap, plans = np.median(np.concatenate([*spreads.values()])), [], [], 0
    for scene, accuracies in actual.items():
        spread, count = np.median(spreads[scene]) if spreads[scene] else usual, counts[scene]
        for seed in range(5):
            random = np.random.default_rng([seed, count])
            shared = 0.9 * spread * random.gamma(1.0, 1.0, count)
            chosen, rows = random.permutation(count)[:LEAST_LENSES], []
            for candidate, accuracy in accuracies.items():
                off = 0.44 * spread * random.normal(size=count) - shared
                values = (accuracy + off - off.mean())[chosen]
                rows.append(Rated(**vars(candidate), seconds=candidate.paths(DISPLAY),
                                  estimate=estimate(values, np.ones(len(chosen), bool), count)))
            for target in (0.7, 0.8, 0.9):
                plans += 1
                row = choose(rows, target).chosen
                if row is None:
                    continue
                met.append(accuracies[row.candidate] >= target)
                if met[-1]:
                    least = min(candidate.paths(DISPLAY) for candidate in accuracies if accuracies[candidate] >= target)
                    cheap.append(row.paths(DISPLAY) <= 1.2 * least)
    assert len(met) > 0.95 * plans and np.mean(met) >= 0.95 and np.mean(cheap) >= 0.85


def test_options_methods_limits_and_all_combinations_that_they_allow():
    assert PlanOptions().limit == math.inf and PlanOptions(most_seconds=3).limit == 3
    assert plan_options.methods_at(4, ("none", "bilinear")) == ("bilinear",)
    assert plan_options.methods_at(1, ("bilinear", "oidn+bilinear")) == ("none", "oidn")
    methods = plan_options.default_methods()
    assert methods[0] == PLAIN_METHOD and DEFAULT_METHOD in methods and len(set(methods)) == len(methods)
    assert PlanOptions().most_paths(load_display("mini")) == plan_options.FREE_PATHS
    assert PlanOptions().most_paths(load_display("bupt-32in-8k")) > plan_options.FREE_PATHS
    for wrong in [{"target": 1.0}, {"target": 0.0}, {"metric": "psnr"}, {"budget": 0.0}, {"lenses": 3},
                  {"reference_samples": 3}, {"samples": (0,)}, {"most_seconds": 0.0}, {"most_seconds": math.inf}]:
        refuses("but", PlanOptions, **wrong)
    for wrong in [{"scales": (3,)}, {"methods": ("bilina",)}, {"rays": (0.0,)}, {"scales": (2,), "methods": ("none",)}]:
        refuses("", PlanOptions(**wrong).candidates, MINI)
    candidates = PlanOptions(samples=(np.int64(4), 16), methods=("bilinear", "oidn+bilinear")).candidates(MINI)
    assert {candidate.scale for candidate in candidates} == {1, 2, 4, 8}
    assert {candidate.method for candidate in candidates if candidate.scale == 1} == {"none", "oidn"}
    assert {candidate.method for candidate in candidates if candidate.scale == 2} == {"bilinear", "oidn+bilinear"}
    costs = [candidate.paths(MINI) for candidate in candidates]
    assert costs == sorted(costs) and len(set(candidates)) == len(candidates) == 16


@given(st.sampled_from((2, 4)), st.integers(1, 4096))
def test_candidates_of_the_same_rays_cost_the_same(scale, samples):
    candidates = PlanOptions(methods=("bilinear",), rays=(1, 4)).candidates(MINI)
    assert {(candidate.scale, candidate.samples) for candidate in candidates} == {
        (1, 1), (1, 4), (2, 4), (2, 16), (4, 16), (4, 64), (8, 64), (8, 256)}
    assert len({candidate.paths(MINI) for candidate in candidates}) == 2
    assert samples_at(MINI, scale, Candidate(scale, samples, "bilinear").rays(MINI)) == samples
