"""Training configs: what ships, what a command line changes, and what is refused."""

from __future__ import annotations

import dataclasses

import pytest

from lfsr_core.errors import LfsrError
from lfsr_core.reconstruct.networks import catalogue
from lfsr_lab.train.config import builtin_configs, from_values, load_config


def test_every_builtin_config_is_valid_and_states_the_papers_recipe():
    assert {"paper", "paper-gan", "paper-short", "espcn", "fsrcnn", "paper-6"} <= set(builtin_configs())
    for name in builtin_configs():
        catalogue.spec(load_config(name, ["scenes=here"] if name in ("light", "refine") else []).network)
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
    (["rate=-1"], "must be positive"),
    (["batch=0"], "must be at least 1"),
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


def test_bad_settings_of_light_fields():
    with pytest.raises(LfsrError, match="did you mean 'steps_per_epoch'"):
        from_values({"network": "light", "scenes": "x", "steps_epoch": 3}, "test")


def test_ablations_change_the_architecture():
    config = from_values({"network": "refine", "scenes": "x", "without": "albedo,normal", "blocks": 2}, "test")
    assert config.architecture.inputs == ("oidn", "guided", "color", "alpha") and config.architecture.blocks == 2
    alone = from_values({"network": "refine", "scenes": "x", "without": "guided"}, "test").architecture
    assert alone.inputs == ("oidn", "color", "alpha", "albedo", "normal") and not alone.second_base
    shipped = from_values({"network": "refine", "scenes": "x"}, "test").architecture
    assert shipped.inputs == ("oidn", "guided", "color", "alpha", "albedo", "normal") and shipped.blocks == 1
    assert shipped.second_base == "guided"
