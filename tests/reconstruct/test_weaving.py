"""The last step of the second stage, where a display has a lens sheet."""

import dataclasses
import json

import numpy as np
import pytest

from lfsr_core.cli import main
from lfsr_core.frames.frame import PANEL_FILE, read_frame
from lfsr_core.images.png import read_png
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eia import flip_order
from lfsr_core.optics.panel.weave import gather_map, weave
from lfsr_core.pipeline.make import finish_frame
from tests.support.panels import hexagonal, lenticular, whole
from tests.support.prerequisites import needs_bpy
from tests.support.synthetic import MINI, write_reference, write_render

pytestmark = needs_bpy  # for Blender's colour configuration


def small(display: DisplayProfile) -> DisplayProfile:
    """Its light field with fewer lenses and views, the artist's choice."""
    views = (8, 8) if display.lenslet else (8, 1)
    return dataclasses.replace(display, lenses=(20, 16), views=views)


@pytest.mark.parametrize("display", [small(lenticular()), small(hexagonal())], ids=["lenticular", "hexagonal"])
def test_the_panels_image_is_woven_from_the_finished_eia(tmp_path, display):
    write_render(tmp_path, display=display)
    report = finish_frame(tmp_path, "bilinear")
    assert read_frame(tmp_path).display == display
    eia, panel = read_png(tmp_path / "eia.png"), read_png(tmp_path / PANEL_FILE)
    np.testing.assert_array_equal(panel, weave(eia, gather_map(display, "views")))
    assert panel.shape == (160, 240, 3) and panel.std() > 10
    assert {"map", "weave"} <= report.seconds.keys()


def test_a_whole_number_sheet_shows_what_a_profile_of_format_1_shows(tmp_path):
    display = whole("lenslet", subpixels={"stripes": "white"})
    for name, profile in (("old", MINI), ("new", display)):
        write_render(tmp_path / name, display=profile)
        finish_frame(tmp_path / name, "bicubic")
    assert not (tmp_path / "old" / PANEL_FILE).exists()
    old, new = (read_png(tmp_path / name) for name in ("old/eia.png", "new/panel.png"))
    np.testing.assert_array_equal(new, old)
    np.testing.assert_array_equal(read_png(tmp_path / "new/eia.png"), flip_order(old, MINI.lenses))


def test_every_verb_that_reads_a_folder_takes_it(tmp_path, capsys):
    display = small(lenticular())
    frame, reference = write_render(tmp_path / "frame", display=display), write_reference(tmp_path / "reference",
                                                                                         display=display)
    assert main(["upscale", str(frame)]) == 0
    assert PANEL_FILE in capsys.readouterr().out
    assert main(["views", str(frame), "--eye=20,0,300"]) == 0
    assert read_png(frame / "eye.png").std() > 10
    assert main(["compare", str(frame), str(reference)]) == 0
    metrics = json.loads((frame / "report.json").read_text())["metrics"]
    assert 0.5 < metrics["ssim_eia"] <= 1
    assert json.loads((frame / "report.json").read_text())["method"] == "denoise+pool"
