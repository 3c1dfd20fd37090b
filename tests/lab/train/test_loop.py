"""The training loop can be stopped, killed and resumed."""

import dataclasses
import os
import re
import signal

import cv2
import pytest
import torch

from lfsr_core.base.messages import LfsrError
from lfsr_lab.networks import comparators
from lfsr_lab.train import loop
from lfsr_lab.train.config import DENOISER, DenoiserConfig, builtin_configs, load_config
from lfsr_lab.train.loop import TrainLog, read_log
from tests.lab.networks.test_networks import Evil
from tests.support.told import refuses


def test_every_builtin_config_is_valid_and_settings_override_with_their_types():
    assert {"paper", "paper-gan", "paper-short", "espcn", "fsrcnn", "paper-6"} <= set(builtin_configs())
    for name in {*builtin_configs()} - {DENOISER}:
        comparators.spec(load_config(name).network)
    assert isinstance(load_config(DENOISER, ["scenes=SCENES"]), DenoiserConfig)
    recipe = load_config("paper-gan")
    assert (recipe.crop, recipe.batch, recipe.epochs, recipe.rate, recipe.adversarial) == (256, 8, 100, 1e-4, 1e-3)
    assert load_config("paper") == dataclasses.replace(recipe, network="paper", adversarial=0.0)
    config = load_config("paper", ["epochs=3", "rate=1", "photographs=some/where"])
    assert (config.epochs, config.rate, config.photographs) == (3, 1.0, "some/where")


@pytest.mark.parametrize(("setting", "message"), [("epoch=3", "unknown key 'epoch': did you mean 'epochs'"),
    ("epochs=many", "epochs = 'many', .* of type int"), ("photographs=1", "photographs = 1, .* of type str"),
    ("network=[]", r"network = \[\], .* of type str"), ("epochs", "form key=value"),
    ("crop=30", "crop 30 is not a multiple of scale 4"), ("schedule=step", "schedule 'step' is unknown")])
def test_bad_settings(setting, message):
    refuses(message, load_config, "paper", [setting])


@pytest.mark.parametrize(("config", "changes"), [
    ("paper", "rate=-1 rate=nan rate=inf adversarial=nan batch=0 scale=0 crop=0 seed=-1 epochs=0 validate_every=0 "
              "checkpoint_every=0"),
    ("denoiser", "steps_per_epoch=0 epochs=0 rate=nan rate=0 seed=-1 side=0 count=-1 validate_every=0 "
                 "checkpoint_every=0 error_weight=nan error_weight=-1")])
def test_numbers_that_nothing_can_be_trained_with(config, changes):
    for change in [*changes.split(), "rate=1" + "0" * 400]:
        with pytest.raises(LfsrError, match=rf"{change.split('=')[0]} is \S+, but it must be between"):
            load_config(config, ["scenes=x"] * (config == "denoiser") + [change])
    refuses("size 'large' is unknown", load_config, "denoiser", ["scenes=x", "size=large"])


@pytest.mark.parametrize(("content", "message"), [(None, "no training config .*paper-gan"),
    ("network = ", "cannot be read"), ('network = "paper"', "has no 'photographs'")])
def test_missing_and_broken_config(tmp_path, content, message):
    if content is not None:
        (tmp_path / "papr.toml").write_text(content)
    refuses(message, load_config, str(tmp_path / "papr.toml"))


RESUME = loop.RunOptions(resume=True)


class Counter:
    """Task of two steps an epoch whose state is the list of what it did; at the step ``at`` it calls ``act``."""

    def __init__(self, at=None, act=None, name="run"):
        self.done, self._epoch, self._at, self._act, self._name = [], 0, at, act, name

    def identity(self):
        return {"name": self._name}

    def begin(self, epoch):
        self._epoch = epoch
        return 2

    def step(self, index):
        if 10 * self._epoch + index == self._at:
            self._act()
        self.done.append(10 * self._epoch + index)
        return {"loss": torch.tensor(float(self.done[-1]) + 1)}

    def validate(self):
        return {"validation.last": float(self.done[-1])}

    def state(self):
        return {"done": list(self.done)}

    def restore(self, state):
        self.done = state["done"]


def test_loop_logs_validates_and_draws_and_a_full_disk_is_one_sentence(tmp_path):
    outcome = loop.run(Counter(), loop.Schedule(5, validate_every=2, checkpoint_every=2), tmp_path)
    lines = read_log(tmp_path / "log.jsonl")
    assert [line["epoch"] for line in lines] == [1, 2, 3, 4, 5]
    assert [line["loss"] for line in lines] == [1.5, 11.5, 21.5, 31.5, 41.5]
    assert ["validation.last" in line for line in lines] == [False, True, False, True, True]
    assert not outcome.stopped and outcome.validation == {"validation.last": 41.0}
    assert cv2.imread(str(tmp_path / "loss.png")).std() > 1
    log = TrainLog(tmp_path)
    (tmp_path / "log.jsonl").unlink()
    (tmp_path / "log.jsonl").symlink_to("/dev/full")
    refuses("No space left on device", log.add, {"epoch": 1})


@pytest.mark.parametrize("stop_at", [0, 10, 21, 31])
def test_stopped_run_resumes_where_it_was(tmp_path, stop_at):
    stop, schedule = loop.Stop(), loop.Schedule(4, validate_every=2, checkpoint_every=3)
    counter = Counter(stop_at, lambda: setattr(stop, "asked", True))
    assert loop.run(counter, schedule, tmp_path, loop.RunOptions(stop=stop)).stopped
    again = Counter()
    outcome = loop.run(again, schedule, tmp_path, RESUME)
    assert again.done == [0, 1, 10, 11, 20, 21, 30, 31] and not outcome.stopped
    lines = read_log(tmp_path / "log.jsonl")
    assert [(line["epoch"], line["loss"]) for line in lines] == [(1, 1.5), (2, 11.5), (3, 21.5), (4, 31.5)]


def test_a_crash_repeats_epochs_without_double_lines_and_an_interrupt_leaves_a_checkpoint(tmp_path):
    again, schedule = Counter(), loop.Schedule(4, checkpoint_every=2)
    with pytest.raises(ZeroDivisionError):
        loop.run(Counter(30, lambda: 1 / 0), schedule, tmp_path)
    loop.run(again, schedule, tmp_path, RESUME)
    assert again.done == [0, 1, 10, 11, 20, 21, 30, 31]
    assert [line["epoch"] for line in read_log(tmp_path / "log.jsonl")] == [1, 2, 3, 4]
    before = signal.getsignal(signal.SIGINT)
    outcome = loop.run(Counter(10, lambda: os.kill(os.getpid(), signal.SIGINT)), loop.Schedule(4), tmp_path / "other")
    assert outcome.stopped and outcome.epochs == 1
    assert loop.load_checkpoint(tmp_path / "other" / "checkpoint.pt")["state"] == {"done": [0, 1, 10]}
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize(("name", "options", "message"), [
    ("run", loop.RunOptions(), "already holds a training run"), ("other", RESUME, "other settings or data")])
def test_a_folder_of_another_run_is_refused(tmp_path, name, options, message):
    refuses("nothing to resume", loop.run, Counter(), loop.Schedule(1), tmp_path, RESUME)
    loop.run(Counter(), loop.Schedule(1), tmp_path)
    refuses(message, loop.run, Counter(name=name), loop.Schedule(1), tmp_path, options)


def number_changed(path):
    """Save a checkpoint in which one number is another than its checksum says."""
    torch.save(WHOLE | {"state": torch.full((100,), 0.5)}, path)
    data = path.read_bytes()
    at = data.index(torch.full((100,), 0.5).numpy().tobytes()) + 41
    path.write_bytes(data[:at] + b"\x01" + data[at + 1:])


WHOLE = {"version": 1, "run": "x", "position": {}, "state": {}}


@pytest.mark.parametrize(("write", "message"), [
    (lambda path: torch.save({"version": 99}, path), "checkpoint version 99, expected 1"),
    (lambda path: torch.save(WHOLE | {"state": Evil(path.parent)}, path), "cannot be read as a checkpoint"),
    (lambda path: torch.save(WHOLE | {"state": torch.nn.Linear(1, 1)}, path), "cannot be read as a checkpoint"),
    (lambda path: path.write_bytes(b"PK" * 50), "cannot be read as a checkpoint"),
    (number_changed, "it is damaged, .*remove it"), (os.mkfifo, "not a regular file")])
def test_a_damaged_checkpoint_is_one_sentence_and_runs_no_code(tmp_path, write, message):
    write(tmp_path / "checkpoint.pt")
    with pytest.raises(LfsrError, match=message) as refused:
        loop.load_checkpoint(tmp_path / "checkpoint.pt")
    assert not {"weights_only", "arbitrary", "trusted"} & set(re.findall(r"\w+", str(refused.value)))
    assert not (tmp_path / "written").exists()


def test_a_checkpoint_of_other_content_is_one_sentence(tmp_path):
    loop.run(Counter(), loop.Schedule(1), tmp_path)
    path = tmp_path / "checkpoint.pt"
    whole = loop.load_checkpoint(path)
    for change in ({"position": {"epoch": 1, "steps": 3}}, {"position": {"epoch": -1}}, {"position": {"epoch": "1"}},
                   {"position": {"sums": [1]}}, {"position": 3}, {"state": {}}, {"state": 7}, {"run": None},
                   {"version": None}):
        torch.save(whole | change, path)
        with pytest.raises(LfsrError, match=r"checkpoint\.pt .*(remove it|another --output)"):
            loop.run(Counter(), loop.Schedule(3), tmp_path, RESUME)


@pytest.mark.parametrize("line", [
    "{", "[]", "3", "{}", '{"epoch": "1"}', '{"epoch": true}', '{"epoch": 1, "loss": "x"}', '{"epoch": 1, "loss": []}',
    "[" * 100_000, "\xff", '{"epoch": 1' + "0" * 5000 + "}", None])
def test_log_of_a_damaged_line_or_a_pipe(tmp_path, line):
    path = tmp_path / "log.jsonl"
    os.mkfifo(path) if line is None else path.write_bytes(line.encode("latin-1"))
    refuses("training log", TrainLog, tmp_path)
