"""Find Cheapest Settings: its plan, using it, cancelling it with the render that it started."""

import dataclasses
import time
from pathlib import Path

import bpy
import pytest

from blender_addon.jobs import session
from blender_addon.scene import settings as scene_settings
from blender_addon.ui import panels
from blender_addon.ui.operators import plan
from blender_addon.ui.properties import method_items
from lfsr_core.base.notices import Notice
from lfsr_core.plan import options
from lfsr_core.plan.options import Candidate, Choice, Estimate, Guess, Rated, default_methods
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from tests.blender.ui.test_panels import draw, labels, operators, properties
from tests.support import panel

SECONDS_TO_START = 60


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """A small scene and a plan of few renders."""
    found = plan.wanted

    def few(scene: bpy.types.Scene) -> options.PlanOptions:
        return dataclasses.replace(found(scene), scales=(2,), samples=(1,), reference_samples=4, lenses=8)
    monkeypatch.setattr(plan, "wanted", few)
    with panel.registered():
        yield panel.artist_scene(tmp_path)


def test_plan_is_found_shown_and_used(scene):
    scene.lfsr.plan_target, scene.lfsr.scale, scene.lfsr.samples = 0.5, "4", 99
    before = panel.snapshot(scene)
    assert bpy.ops.lfsr.plan() == {"FINISHED"}
    assert panel.snapshot(scene) == before
    state = bpy.context.window_manager.lfsr
    assert state.plan_scene == scene.name and "SSIM 0.5" in state.plan_text
    drawn = draw(panels.LFSR_PT_plan)
    assert "cale 2×, 1 sample, " in labels(drawn) and operators(drawn) == {"lfsr.plan", "lfsr.plan_use"}
    assert bpy.ops.lfsr.plan_use() == {"FINISHED"}
    assert (scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.method) == ("2", 0, state.plan_method)
    assert (scene.lfsr.rays, scene_settings.resolve(scene).sampling.samples) == (0.25, 1)
    assert not list(Path(bpy.app.tempdir).glob("lfsr-*")), "what was rendered is gone"


def test_a_plan_that_finds_nothing_has_nothing_to_use(scene):
    plan.show(0.95, scene.name, Choice(None, None, Notice("plan-limit-unmeasured")))
    drawn = draw(panels.LFSR_PT_plan)
    assert "Nothing reaches" in labels(drawn) and operators(drawn) == {"lfsr.plan"}
    panel.refused("No settings were found", bpy.ops.lfsr.plan_use)


def test_a_plan_of_another_scene_is_not_shown(scene):
    plan.show(0.9, "Other", Choice(Rated(2, 4, DEFAULT_METHOD, 3.0, Estimate(0.95, 0.91, 48)), None))
    drawn = draw(panels.LFSR_PT_plan)
    assert properties(drawn) == {"plan_target"} and "0.91" not in labels(drawn)
    panel.refused("No settings were found for scene 'Scene'", bpy.ops.lfsr.plan_use)


def test_cancel_ends_the_render_it_started(scene):
    context = bpy.context
    scene.lfsr.display = "bupt-32in-8k"  # its quick render alone would go on for many seconds
    task = session.start("Plan", plan.LFSR_OT_plan.prepare(None, context))
    work = Path(bpy.app.tempdir)
    wait_for(lambda: children(work))
    started = time.perf_counter()
    assert bpy.ops.lfsr.cancel() == {"FINISHED"}
    assert time.perf_counter() - started < 5 and session.current() is None
    wait_for(lambda: not children(work), seconds=3)
    assert not list(work.glob("lfsr-*/*")) and task.ended
    assert not context.window_manager.lfsr.plan_text or "Not measured" in context.window_manager.lfsr.plan_text


def test_every_method_tried_can_be_set(scene):
    listed = {item[0] for item in method_items()}
    tried = plan.wanted(scene).methods or default_methods()
    assert set(tried) <= listed


def children(work: Path) -> list[str]:
    """Render processes whose job file lies under ``work``."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = entry.read_bytes().decode(errors="replace").split("\0")
        except OSError:
            continue
        if any(word.startswith(str(work)) and word.endswith("request.json") for word in words):
            found.append(" ".join(words))
    return found


def wait_for(condition, seconds: float = SECONDS_TO_START) -> None:
    ends = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < ends
        session._look()
        time.sleep(0.05)


def test_a_first_guess_comes_before_anything_is_measured(scene, monkeypatch):
    session.start("Find Cheapest Settings", plan.LFSR_OT_plan.prepare(None, bpy.context))
    try:
        panel.wait_for(lambda: bpy.context.window_manager.lfsr.plan_text)
        assert "scale 2×, 1 sample" in bpy.context.window_manager.lfsr.plan_text
        for reaches in (False, True):
            plan.guess(scene.name, Guess(Candidate(2, 1, DEFAULT_METHOD), reaches))
            drawn = draw(panels.LFSR_PT_plan)
            assert "First guess" in labels(drawn) and ("lfsr.plan_use" in operators(drawn)) == reaches
    finally:
        session.cancel()


def test_what_it_costs_is_said_before(scene):
    assert "as long as" in labels(draw(panels.LFSR_PT_plan)) and "images at most" in labels(draw(panels.LFSR_PT_plan))
    state = bpy.context.window_manager.lfsr
    state.probe_scene, state.probe_per_path = scene.name_full, 1e-6
    assert "Takes 1 min 40 s at most" in labels(draw(panels.LFSR_PT_plan))
