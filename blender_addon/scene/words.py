"""Texts as Blender shows them: the sentences of notices, names, numbers and times."""

import re

from lfsr_core.base.messages import Notice, cleaned
from lfsr_core.commands import sentences
from lfsr_core.commands.sentences import DARK, MOST_NAMES, Wording, listed

DIRECT = "Direct Subpixel Rendering"  # of a display with a lens sheet
MOST_TEXT = 2000  # letters of an error, which may quote files and devices of others
# Absolute paths, of which a panel shows the last name only.
PATH = re.compile(r"(?<![\w.:/\\])(?:[A-Za-z]:)?[\\/](?:[^\\/\s'\"]+[\\/])+([^\\/\s'\",:;)]+)")
# What differs from the command line, which names its options.
PANEL: dict[str, Wording] = {
    "frames-older": lambda values: f"{sentences.older(values)} than this file. Turn on Overwrite to render them again",
    "averaging-other-rays": lambda values: f"frames {listed(values['frames'])} were not averaged, because their camera "
                                           "array or render settings differ",
    "averaging-same-seed": lambda values: f"frames {listed(values['frames'])} were not averaged, because they have the "
                                          "same seed",
    "page-large": lambda values: f"the page has {values['bytes'] / 1e6:.0f} MB: phones and mail may refuse it",
    "disparity-missing": "disparity was not written: it needs the position layer, which is rendered at scale 2 or more",
    "candidate-over-budget": "not measured: beyond the budget of the sample",
    "camera-chosen": lambda values: f"the file's camera {values['camera']!r} is used",
    "camera-missing": lambda values: "the scene has no active camera, so the array stands in front of the subject: of "
                                     "a room it sees the outer wall. For a view from inside "
                                     + (f"make a camera active ({listed(values['others'], MOST_NAMES)}), or "
                                        if values["others"] else "")
                                     + "add one and move it with Align Active Camera to View",
    "light-weak": f"{DARK['dark']}, so it will be almost black. Increase the lights or the exposure, or choose "
                  "another light under Quality",
    "light-replaced": lambda values: sentences.replaced(values) + ": choose another light under Quality"}


def sentence(notice: Notice) -> str:
    """Return the sentence of a notice, with a capital."""
    return capitalized(sentences.sentence(notice, PANEL))


def for_panel(text: str) -> str:
    """Return a message as the panel shows it: without the folders of its paths, and with a capital."""
    return capitalized(PATH.sub(r"\1", cleaned(text, MOST_TEXT)))


def capitalized(text: str) -> str:
    """Return ``text`` with a capital, unless it begins with a name such as that of a file."""
    return text[:1].upper() + text[1:] if text.split(" ", maxsplit=1)[0].isalpha() else text


def counted(count: int, noun: str) -> str:
    """Return a number with its noun, as in "1 problem" or "2 problems"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def clock(seconds: float) -> str:
    """Return a time as a clock shows it, as in "0:42" or "1:02:03"."""
    minutes, whole = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{whole:02d}" if minutes >= 60 else f"{minutes}:{whole:02d}"
