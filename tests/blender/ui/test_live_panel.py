"""The panel Live says what this Blender can do and what to do now."""

import bpy
import pytest

from blender_addon.live import nodes, session
from blender_addon.live.scene import EYE, PANEL
from blender_addon.scene import devices
from blender_addon.scene.array import rig
from blender_addon.ui import panels
from tests.blender.ui.test_panels import draw, greyed, labels, operators, properties


def test_off(scene):
    drawn = draw(panels.LFSR_PT_live)
    assert not bpy.ops.lfsr.live_full_screen.poll()
    assert operators(drawn) == {"lfsr.live_start", "lfsr.live_eye_start"}
    assert {"live_eye_right", "live_eye_up", "live_eye_near"} == properties(drawn)
    advanced = {"live_scale", "live_rays", "live_samples", "live_smooth", "live_denoise", "live_denoise_start"}
    assert properties(draw(panels.LFSR_PT_live_advanced)) == advanced


def test_a_lens_sheet_has_no_pixel_size(scene):
    scene.lfsr.display = "looking-glass-go"
    assert {"live_scale", "live_smooth"} <= greyed(draw(panels.LFSR_PT_live_advanced))


def test_on(scene, monkeypatch):
    monkeypatch.setattr(session, "_on", {PANEL: session._Shown(bpy.context.scene.session_uid)})
    assert "exact" in labels(draw(panels.LFSR_PT_live))
    session._on[PANEL].message = "the live window shows 5×5 pixels"
    drawn = draw(panels.LFSR_PT_live)
    assert operators(drawn) == {"lfsr.live_stop", "lfsr.live_full_screen", "lfsr.live_eye_start"}
    assert "5×5" in labels(drawn) and "full screen" in labels(drawn) and "exact" not in labels(drawn)
    session._on[EYE] = session._Shown(bpy.context.scene.session_uid, message="make the window larger")
    drawn = draw(panels.LFSR_PT_live)
    assert "Make the window larger" in labels(drawn)
    assert operators(drawn) == {"lfsr.live_stop", "lfsr.live_full_screen", "lfsr.live_eye_stop"}


def test_what_this_blender_cannot_do(scene, monkeypatch):
    monkeypatch.setattr(nodes, "can_interpolate", lambda: False)
    monkeypatch.setattr(devices, "has_denoiser", lambda: False)
    text = labels(draw(panels.LFSR_PT_live))
    assert "cannot interpolate" in text and "without a denoiser" in text


def test_a_scene_without_an_array_gets_one(scene):
    bpy.ops.lfsr.array_remove()
    with pytest.raises(RuntimeError, match="without a window"):
        bpy.ops.lfsr.live_start()
    assert rig.find(scene) is not None
