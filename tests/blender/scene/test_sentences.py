"""The panel's sentences name no options of the command line."""

import pytest

from blender_addon.scene.words import PANEL, sentence
from lfsr_core.base.notices import Notice
from lfsr_core.commands.sentences import SENTENCES
from tests.commands.test_sentences import EXAMPLES

IMPORTS = {"angle-assumed", "aspect-assumed", "geometry-assumed"}  # of light fields, which the panel does not have


@pytest.mark.parametrize("code", sorted(set(EXAMPLES) - IMPORTS))
def test_the_panel_names_no_options(code):
    assert "--" not in sentence(Notice(code, EXAMPLES[code][0]))


def test_the_panel_words_what_there_is():
    assert set(PANEL) <= set(SENTENCES)
