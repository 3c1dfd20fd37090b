"""The training loop can be stopped, killed and resumed."""

from __future__ import annotations

import os
import re
import signal

import cv2
import pytest
import torch

from lfsr_core.base.errors import LfsrError
from lfsr_lab.train import loop
from lfsr_lab.train.loop import TrainLog, read_log

RESUME = loop.RunOptions(resume=True)


class Counter:
    """Task of two steps an epoch whose state is the list of what it did."""

    def __init__(self, stop=None, stop_at=None, name="run"):
        self.done, self._epoch, self._stop, self._stop_at, self._name = [], 0, stop, stop_at, name

    def identity(self):
        return {"name": self._name}

    def begin(self, epoch):
        self._epoch = epoch
        return 2

    def step(self, index):
        self.done.append(10 * self._epoch + index)
        if self.done[-1] == self._stop_at:
            self._stop.asked = True
        return {"loss": torch.tensor(float(self.done[-1]) + 1)}

    def validate(self):
        return {"validation.last": float(self.done[-1])}

    def state(self):
        return {"done": list(self.done)}

    def restore(self, state):
        self.done = state["done"]


def test_loop_logs_validates_and_draws(tmp_path):
    outcome = loop.run(Counter(), loop.Schedule(5, validate_every=2, checkpoint_every=2), tmp_path)
    lines = read_log(tmp_path / "log.jsonl")
    assert [line["epoch"] for line in lines] == [1, 2, 3, 4, 5]
    assert [line["loss"] for line in lines] == [1.5, 11.5, 21.5, 31.5, 41.5]
    assert ["validation.last" in line for line in lines] == [False, True, False, True, True]
    assert not outcome.stopped and outcome.validation == {"validation.last": 41.0}
    assert cv2.imread(str(tmp_path / "loss.png")).std() > 1


@pytest.mark.parametrize("stop_at", [0, 10, 21, 31])
def test_stopped_run_resumes_where_it_was(tmp_path, stop_at):
    stop = loop.Stop()
    schedule = loop.Schedule(4, validate_every=2, checkpoint_every=3)
    first = loop.run(Counter(stop, stop_at), schedule, tmp_path, loop.RunOptions(stop=stop))
    assert first.stopped
    again = Counter()
    outcome = loop.run(again, schedule, tmp_path, RESUME)
    assert again.done == [0, 1, 10, 11, 20, 21, 30, 31] and not outcome.stopped
    lines = read_log(tmp_path / "log.jsonl")
    assert [(line["epoch"], line["loss"]) for line in lines] == [(1, 1.5), (2, 11.5), (3, 21.5), (4, 31.5)]


def test_crash_between_checkpoints_repeats_epochs_without_double_lines(tmp_path):
    class Crashing(Counter):
        def step(self, index):
            if self._epoch == 3:
                raise RuntimeError("power cut")
            return super().step(index)

    schedule = loop.Schedule(4, checkpoint_every=2)
    with pytest.raises(RuntimeError, match="power cut"):
        loop.run(Crashing(), schedule, tmp_path)
    again = Counter()
    loop.run(again, schedule, tmp_path, RESUME)
    assert again.done == [0, 1, 10, 11, 20, 21, 30, 31]
    assert [line["epoch"] for line in read_log(tmp_path / "log.jsonl")] == [1, 2, 3, 4]


def test_interrupt_signal_ends_the_run_with_a_checkpoint(tmp_path):
    class Interrupting(Counter):
        def step(self, index):
            if self._epoch == 1:
                os.kill(os.getpid(), signal.SIGINT)
            return super().step(index)

    before = signal.getsignal(signal.SIGINT)
    outcome = loop.run(Interrupting(), loop.Schedule(4), tmp_path)
    assert outcome.stopped and outcome.epochs == 1
    assert loop.load_checkpoint(tmp_path / "checkpoint.pt")["state"] == {"done": [0, 1, 10]}
    assert signal.getsignal(signal.SIGINT) is before


def test_checkpoint_of_another_run_and_other_mistakes(tmp_path):
    schedule = loop.Schedule(1)
    with pytest.raises(LfsrError, match="nothing to resume"):
        loop.run(Counter(), schedule, tmp_path, RESUME)
    loop.run(Counter(), schedule, tmp_path)
    with pytest.raises(LfsrError, match="already holds a training run"):
        loop.run(Counter(), schedule, tmp_path)
    with pytest.raises(LfsrError, match="other settings or data"):
        loop.run(Counter(name="other"), schedule, tmp_path, RESUME)
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(LfsrError, match="cannot be read as a checkpoint"):
        loop.run(Counter(), schedule, tmp_path, RESUME)


def test_checkpoint_version_and_code_in_a_checkpoint(tmp_path):
    path = tmp_path / "checkpoint.pt"
    torch.save({"version": 99}, path)
    with pytest.raises(LfsrError, match="checkpoint version 99, expected 1"):
        loop.load_checkpoint(path)

    class Evil:
        def __reduce__(self):
            return (open, (str(tmp_path / "proof"), "w"))

    torch.save({"version": 1, "state": Evil()}, path)
    with pytest.raises(LfsrError, match="cannot be read as a checkpoint"):
        loop.load_checkpoint(path)
    assert not (tmp_path / "proof").exists()


@pytest.mark.parametrize("change", [
    {"position": {"epoch": 1, "steps": 3}}, {"position": {"epoch": -1}}, {"position": {"epoch": "1"}},
    {"position": {"sums": [1]}}, {"position": 3}, {"state": {}}, {"state": 7}, {"run": None}, {"version": None}])
def test_a_checkpoint_of_other_content_is_one_sentence(tmp_path, change):
    loop.run(Counter(), loop.Schedule(1), tmp_path)
    path = tmp_path / "checkpoint.pt"
    torch.save(loop.load_checkpoint(path) | change, path)
    with pytest.raises(LfsrError, match=r"checkpoint\.pt .*(remove it|another --output)"):
        loop.run(Counter(), loop.Schedule(3), tmp_path, RESUME)


def test_a_checkpoint_with_a_changed_number_is_refused(tmp_path):
    path = tmp_path / "checkpoint.pt"
    torch.save({"version": 1, "run": "x", "position": {}, "state": torch.full((100,), 0.5)}, path)
    data = path.read_bytes()
    at = data.index(torch.full((100,), 0.5).numpy().tobytes()) + 41
    path.write_bytes(data[:at] + b"\x01" + data[at + 1:])
    with pytest.raises(LfsrError, match="it is damaged, .*remove it"):
        loop.load_checkpoint(path)


def test_advice_of_pytorch_is_not_passed_on(tmp_path):
    path = tmp_path / "checkpoint.pt"
    torch.save({"version": 1, "run": "x", "position": {}, "state": torch.nn.Linear(1, 1)}, path)
    with pytest.raises(LfsrError) as refused:
        loop.load_checkpoint(path)
    assert not {"weights_only", "arbitrary", "trusted"} & set(re.findall(r"\w+", str(refused.value)))


def test_a_checkpoint_or_log_that_is_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "checkpoint.pt")
    with pytest.raises(LfsrError, match="not a regular file"):
        loop.load_checkpoint(tmp_path / "checkpoint.pt")
    os.mkfifo(tmp_path / "log.jsonl")
    with pytest.raises(LfsrError, match="not a regular file"):
        TrainLog(tmp_path)


@pytest.mark.parametrize("line", [
    "{", "[]", "3", "{}", '{"epoch": "1"}', '{"epoch": true}', '{"epoch": 1, "loss": "x"}', '{"epoch": 1, "loss": []}',
    "[" * 100_000, "\xff", '{"epoch": 1' + "0" * 5000 + "}"])
def test_log_of_a_damaged_line(tmp_path, line):
    (tmp_path / "log.jsonl").write_bytes(line.encode("latin-1"))
    with pytest.raises(LfsrError, match="training log"):
        TrainLog(tmp_path)


def test_log_on_a_full_disk_is_one_sentence(tmp_path):
    log = TrainLog(tmp_path)
    (tmp_path / "log.jsonl").unlink()
    (tmp_path / "log.jsonl").symlink_to("/dev/full")
    with pytest.raises(LfsrError, match=r"log\.jsonl cannot be written \(No space left on device\): free some space"):
        log.add({"epoch": 1})
