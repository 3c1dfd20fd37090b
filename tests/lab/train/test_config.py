"""Training configs: what ships, what a command line changes, and what is refused."""

from __future__ import annotations

import dataclasses

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_lab.networks import comparators
from lfsr_lab.train.config import DENOISER, DenoiserConfig, builtin_configs, load_config


def test_every_builtin_config_is_valid_and_states_the_papers_recipe():
    assert {"paper", "paper-gan", "paper-short", "espcn", "fsrcnn", "paper-6"} <= set(builtin_configs())
    for name in {*builtin_configs()} - {DENOISER}:
        comparators.spec(load_config(name).network)
    assert isinstance(load_config(DENOISER, ["scenes=SCENES"]), DenoiserConfig)
    recipe = load_config("paper-gan")
    assert (recipe.crop, recipe.batch, recipe.epochs, recipe.rate, recipe.adversarial) == (256, 8, 100, 1e-4, 1e-3)
    assert load_config("paper") == dataclasses.replace(recipe, network="paper", adversarial=0.0)


def test_settings_override_with_their_types():
    config = load_config("paper", ["epochs=3", "rate=1", "photographs=some/where"])
    assert (config.epochs, config.rate, config.photographs) == (3, 1.0, "some/where")


@pytest.mark.parametrize(("settings", "message"), [
    (["epoch=3"], "unknown key 'epoch': did you mean 'epochs'"),
    (["epochs=many"], "epochs = 'many', expected a value of type int"),
    (["photographs=1"], "photographs = 1, expected a value of type str"),
    (["epochs"], "form key=value"),
    (["crop=30"], "crop 30 is not a multiple of scale 4"),
    (["schedule=step"], "schedule 'step' is unknown"),
    (["rate=-1"], "rate is -1.0, but it must be"),
    (["rate=nan"], "rate is nan, but it must be"),
    (["rate=inf"], "rate is inf, but it must be"),
    (["rate=1" + "0" * 400], "rate is inf, but it must be"),
    (["adversarial=nan"], "adversarial is nan, but it must be"),
    (["batch=0"], "batch is 0, but it must be"),
    (["scale=0"], "scale is 0, but it must be"),
    (["crop=0"], "crop is 0, but it must be"),
    (["seed=-1"], "seed is -1, but it must be"),
    (["epochs=0"], "epochs is 0, but it must be"),
    (["validate_every=0"], "validate_every is 0, but it must be"),
    (["checkpoint_every=0"], "checkpoint_every is 0, but it must be"),
    (["network=[]"], r"network = \[\], expected a value of type str"),
])
def test_bad_settings(settings, message):
    with pytest.raises(LfsrError, match=message):
        load_config("paper", settings)


def test_missing_and_broken_config(tmp_path):
    with pytest.raises(LfsrError, match=r"no training config 'papr'.*paper-gan"):
        load_config("papr")
    (tmp_path / "a.toml").write_text("network = ")
    with pytest.raises(LfsrError, match="cannot be read"):
        load_config(str(tmp_path / "a.toml"))
    (tmp_path / "b.toml").write_text('network = "paper"')
    with pytest.raises(LfsrError, match="has no 'photographs'"):
        load_config(str(tmp_path / "b.toml"))


@pytest.mark.parametrize("change", [
    "steps_per_epoch=0", "epochs=0", "rate=nan", "rate=0", "seed=-1", "side=0", "count=-1", "validate_every=0",
    "checkpoint_every=0", "error_weight=nan", "error_weight=-1"])
def test_numbers_that_no_denoiser_can_be_trained_with(change):
    with pytest.raises(LfsrError, match=rf"{change.split('=')[0]} is \S+, but it must be between"):
        load_config("denoiser", ["scenes=x", change])
