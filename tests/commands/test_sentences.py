"""Every notice has a sentence, and every sentence a notice."""

import ast
from pathlib import Path

import pytest

from lfsr_core.base.messages import MOST_LETTERS, Notice, cleaned
from lfsr_core.commands.sentences import SENTENCES, sentence

# Values of each notice, and a word of its sentence that the reader needs.
EXAMPLES = {
    "angle-assumed": ({"angle_deg": 40.0}, "--angle-deg 40"),
    "array-blind": ({"seen": ["Wall"], "place": "behind"}, "sees Wall, but nothing of the subject, which lies behind"),
    "aspect-assumed": ({"across": 5, "down": 9, "aspect": 1.6}, "--quilt 5x9a1.6"),
    "averaging-other-rays": ({"frames": [1, 3]}, "frames 1, 3"),
    "averaging-same-seed": ({"frames": [1, 3]}, "same seed"), "browser-missing": ({}, "open that page yourself"),
    "calibrated": ({"photographs": 2, "pitch": 1e-5, "turn": 2e-5, "shift": 0.001}, "by 2 photographs: pitch ±1.0e-05"),
    "calibrated-at-distance": ({"pitch": 1e-6}, "1.0e-06"),
    "camera-chosen": ({"camera": "Front", "others": ["Side"]}, "'Front' is used. Choose another with --camera: Side"),
    "camera-mirrored": ({"camera": "Front"}, "'Front' is mirrored"),
    "camera-missing": ({"others": ["Side"]}, "--camera (Side)"),
    "candidate-beaten": ({"scale": 2}, "scale 2 is better"), "candidate-failed": ({"error": "no light"}, "no light"),
    "candidate-not-needed": ({"scale": 4, "samples": 16, "method": "bilinear"}, "s4-spp16 bilinear"),
    "candidate-over-budget": ({"budget": 0.05}, "--budget"), "candidate-too-slow": ({"seconds": 60.0}, "too long"),
    "plan-kept": ({"folder": "cache"}, "in cache"), "plan-limit-certainty": ({"lenses": 12}, "more lenses"),
    "plan-limit-method": ({"scale": 1}, "another method"), "plan-limit-noise": ({"samples": 16}, "more than 16"),
    "plan-limit-time": ({"seconds": 60.0}, "above 60 s"), "plan-limit-unmeasured": ({}, "could be measured"),
    "plan-limit-upscaling": ({"scale": 4}, "at scale 4"),
    "cameras-cut": ({"side": 4, "across": 8, "down": 4}, "4×4 cameras in the middle of 8×4"),
    "aspect-ignored": ({"x": 2.0, "y": 1.0}, "aspect 2:1"), "border-ignored": ({}, "render region"),
    "camera-parallel": ({"camera": "Front"}, "orthographic"),
    "camera-sheared": ({"camera": "Front"}, "'Front' is sheared"),
    "clamp-ignored": ({"direct": 1.0, "indirect": 10.0}, "direct 1, indirect 10"),
    "coordinates-differ": ({"names": ["Sky"]}, "(Sky)"), "material-clear": ({"material": "Skin"}, "'Skin' has Alpha 0"),
    "eevee-nodes": ({"material": "Toon", "node": "Shader to RGB"}, "RGB of material 'Toon' works in EEVEE only"),
    "engine-ignored": ({"engine": "EEVEE"}, "EEVEE"), "filter-ignored": ({"filter": "gaussian"}, "filter gaussian"),
    "focus-ignored": ({"camera": "Front"}, "camera 'Front'"),
    "lines-left-out": ({"names": ["Freestyle"]}, "(Freestyle)"), "motion-ignored": ({}, "motion blur"),
    "markers-ignored": ({"names": ["A", "B"]}, "(A, B)"), "world-negative": ({"world": "Sky"}, "'Sky'"),
    "world-override-ignored": ({"layer": "Main", "world": "Sky"}, "override 'Sky' of view layer 'Main'"),
    "collections-switched": ({"layer": "Main", "switch": "holdout", "names": ["Trees"]}, "holds out Trees"),
    "compositor-ignored": ({"names": ["Glare"]}, "(Glare)"),
    "denoised-on-cpu": ({"device": "OPTIX", "error": "no driver"}, "the OPTIX device"),
    "disparity-missing": ({}, "--layers position"),
    "walls-near": ({"part": 0.25}, "the views are at 25% of the display's spacing"),
    "display-plane": ({"depth": 0.25}, "depth of 0.25"),
    "file-unreadable": ({"kind": "image", "path": "wood.png", "state": "damaged"}, "image file wood.png is damaged"),
    "files-outside": ({"names": ["/etc/wood.png"]}, "(/etc/wood.png)"), "flip-missing": ({}, "flip-evaluator"),
    "frame-left-out": ({"frame": 7, "error": "no light"}, "frame 7 is left out: no light"),
    "frames-older": ({"count": 3, "first": 1}, "3 frames (from 1) are older"),
    "geometry-assumed": ({"width_mm": 600.0, "distance_mm": 1000.0}, "--width-mm 600, --distance-mm 1000"),
    "image-extreme": ({"tone": "black"}, "almost black: make lights or exposure stronger"),
    "layers-left-out": ({"layer": "Main", "names": ["beauty"]}, "without beauty"),
    "lens-distorts": ({"photograph": "a.jpg", "fraction": 0.02}, "a.jpg distorts by 2.0%"),
    "light-replaced": ({"reason": "none", "light": "even"}, "lit evenly"), "light-weak": ({}, "--light"),
    "noisy": ({"times": 4}, "4 times the rays"),
    "noisy-long": ({"times": 4, "seconds": 99.6, "taken": 1}, "would take about 100 s, so the image takes fewer:"),
    "number-ignored": ({"name": "fringe", "value": 0.5}, "fringe of 0.5"),
    "override-ignored": ({"layer": "Main", "material": "clay"}, "override 'clay'"),
    "page-large": ({"bytes": 45_000_000}, "45 MB"),
    "page-reduced": ({"width": 8, "height": 4, "eia_width": 16, "eia_height": 8, "most": 10}, "8×4 of the 16×8"),
    "parts-kept": ({"folder": ".frame-parts"}, "delete .frame-parts"),
    "parts-removed": ({"input": "scene file"}, "other scene file"),
    "photograph-mirrored": ({"photograph": "a.jpg"}, "a.jpg is mirrored"),
    "photograph-turned": ({"photograph": "a.jpg", "degrees": 90}, "turned by 90°"),
    "pixels-replaced": ({"replaced": 5, "pixels": 9}, "5 of 9"),
    "scale-chosen": ({"scale": 2, "largest": 4, "rays": 1.0, "moved": 0.5}, "by at least 1 lenses"),
    "scale-unseen": ({"scale": 4}, "scale 4"), "scripts-off": ({"reason": "driver"}, "(driver)"),
    "sequencer-ignored": ({}, "strips are not rendered"),
    "shift-followed": ({"camera": "Front", "x": 0.0, "y": 0.25}, "(0, 0.25)"),
    "subject-unseen": ({"background": 0.5}, "background objects fill 50% of the image"),
    "view-ignored": ({"names": ["curves", "white balance"]}, "curves and white balance are ignored"),
    "views-nearest": ({}, "not interpolated"), "world-inside": ({"reason": "volume"}, "the world has a volume")}


def test_every_notice_has_a_sentence_every_sentence_a_notice_and_text_from_elsewhere_is_cleaned():
    root, made = Path(__file__).parents[2], set()  # codes of the notices that the sources make
    for path in (*root.joinpath("lfsr_core").rglob("*.py"), *root.joinpath("blender_addon").rglob("*.py")):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and ast.unparse(call.func) == "Notice" and call.args:
                code = call.args[0]
                either = (code.body, code.orelse) if isinstance(code, ast.IfExp) else (code,)
                made |= {one.value for one in either if isinstance(one, ast.Constant)}
    assert made - {"first-view"} == set(SENTENCES) == set(EXAMPLES), "that is acted on by a program, which shows none"
    assert cleaned("a\x1b[31m\nb\x00") == "a [31m b" and cleaned(["a\rb"]) == ["a b"]
    assert len(cleaned("x" * 9999)) == MOST_LETTERS
    assert "\x1b" not in sentence(Notice("camera-mirrored", {"camera": "\x1b[2Jevil"}))


@pytest.mark.parametrize("code", EXAMPLES)
def test_a_sentence_has_its_values(code):
    values, part = EXAMPLES[code]
    assert part in sentence(Notice(code, values))
