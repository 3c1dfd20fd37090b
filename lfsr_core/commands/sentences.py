"""The sentences of notices, as the command line shows them: what is, and what can be done."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lfsr_core.base.messages import Notice, cleaned

MOST_NAMES, EVEN = 3, "even"  # the light of a scene that no world image reaches
Values = Mapping[str, Any]
Wording = str | Callable[[Values], str]  # with the values in place of {name}, or made of them


def listed(items: Sequence[Any], most: int | None = None) -> str:
    """Return the first items of a list, as in "a, b, c"."""
    return ", ".join(map(str, items[:most]))


def _scale_chosen(values: Values) -> str:
    scale, largest, rays, moved = (values[name] for name in ("scale", "largest", "rays", "moved"))
    there = "" if scale == largest else f", at scale {largest} by {moved * largest:.2g}"
    return (f"scale {scale} is predicted to lose least at {rays:.3g} ray{'' if rays == 1 else 's'} per finished pixel: "
            f"half of the subject moves by at least {moved * scale:.2g} lenses between neighbouring rendered views"
            f"{there}")


def older(values: Values) -> str:
    """Return which frames are older."""
    which = "1 frame is" if values["count"] == 1 else f"{values['count']} frames (from {values['first']}) are"
    return f"{which} older"


def replaced(values: Values) -> str:
    """Return which light replaces the scene's own, and why."""
    reason, light = DARK[values["reason"]], values["light"]
    return f"{reason}, and something encloses it. It is lit evenly, without shadows" if light == EVEN else (
        f"{reason}. It is lit with Blender's world image {light!r}")


# What a view layer does with collections.
SWITCHES = {"exclude": "excludes", "holdout": "holds out", "indirect_only": "makes indirect-only"}
# Where a subject is if no ray meets it.
PLACES = {"behind": "lies behind the camera", "left": "lies to the left", "right": "lies to the right",
          "below": "lies below", "above": "lies above", "beyond": "lies beyond the clip end of the camera",
          "hidden": "is hidden or too small"}
# Why another light replaces the scene's own, and why the world is not rendered separately.
DARK = {"dark": "almost no light reaches what the array sees", "none": "the scene has no light"}
WORLDS = {"volume": "the world has a volume", "coordinates": "the world uses window or camera coordinates",
          "sun": "a sun lamp is visible to the camera"}

SENTENCES: dict[str, Wording] = {
    # Scale and light
    "scale-chosen": _scale_chosen,
    "scale-unseen": "scale {scale}: the middle view sees nothing of the subject",
    # The image
    "subject-unseen": lambda values: "no lens sees the subject: " + (
        f"background objects fill {values['background']:.0%} of the image" if values["background"] else
        "no object is in sight"),
    "image-extreme": lambda values: f"the image is almost {values['tone']}: make lights or exposure "
                                    f"{'stronger' if values['tone'] == 'black' else 'weaker'}, or check where the "
                                    "camera looks",
    "pixels-replaced": "{replaced} of {pixels} rendered pixels were not finite and are black: find the material or "
                       "light that makes them",
    "denoised-on-cpu": "denoised on the CPU, since the {device} device of the render cannot be used here ({error}): "
                       "check its driver, or finish the frame where it was rendered",
    "averaging-other-rays": lambda values: f"frames {listed(values['frames'])} were not averaged, because their camera "
                                           "array or render settings differ: leave out --temporal-averaging while the "
                                           "camera array moves",
    "averaging-same-seed": lambda values: f"frames {listed(values['frames'])} were not averaged, because they have the "
                                          "same seed: render the animation with --temporal-averaging",
    # Renders
    "frame-left-out": "frame {frame} is left out: {error}",
    "frames-older": lambda values: f"{older(values)} than this file. Use --overwrite to render them again",
    "parts-kept": "render again to continue, or delete {folder} to start over",
    "parts-removed": "the parts of an earlier render were made with other {input}: they are removed, and the render "
                     "starts from the beginning",
    # Plans
    "candidate-beaten": "not measured: scale {scale} is better with as many rays", "candidate-failed": "{error}",
    "candidate-not-needed": "not needed: costs hardly less than s{scale}-spp{samples} {method}, or more",
    "candidate-over-budget": "not measured: beyond the budget of the sample (--budget)",
    "candidate-too-slow": "takes too long",
    "plan-kept": "the renders of this plan stay for a day in {folder}: run the same plan again to continue",
    "plan-limit-certainty": "certainty: the best candidate's mean reaches the target, its lower bound does not; look "
                            "at more lenses",
    "plan-limit-method": "noise: more samples hardly help at full resolution; try another method",
    "plan-limit-noise": "noise: more than {samples} samples may reach the target",
    "plan-limit-time": "time: slower settings, above {seconds:g} s, may reach the target",
    "plan-limit-unmeasured": "no candidate could be measured: allow more seconds, scales or methods",
    "plan-limit-upscaling": "upscaling: at scale {scale} even many more samples would stay below the target; choose a "
                            "smaller scale or another method",
    # The scene
    "file-unreadable": "the {kind} file {path} is {state}, and what needs it looks wrong",
    "files-outside": lambda values: f"the scene names files outside its folder ({listed(values['names'], MOST_NAMES)})",
    "scripts-off": "Blender did not run the Python in this file ({reason}), so its drivers and scripts move nothing",
    "engine-ignored": "light fields are rendered with Cycles. Materials and lights may look different in the scene's "
                      "own engine, {engine}",
    "eevee-nodes": "node {node} of material {material!r} works in EEVEE only. Cycles leaves it out, so that what "
                   "needs it has a plain color or is black. Connect a shader of Cycles",
    "material-clear": "material {material!r} has Alpha 0, so that it shows nothing. Set its Alpha to 1 to see it",
    "filter-ignored": "the pixel filter {filter} is ignored, since it would mix neighbouring views. A box of one pixel "
                      "is used",
    "clamp-ignored": "the scene's clamping of light (direct {direct:g}, indirect {indirect:g}) is ignored. Direct "
                     "light is not clamped, indirect light at 10",
    "motion-ignored": "motion blur is ignored",
    "markers-ignored": lambda values: f"markers' cameras ({listed(values['names'], MOST_NAMES)}) are ignored. All "
                                      "frames are rendered from the camera array",
    "border-ignored": "the render region is ignored. The whole image is rendered",
    "view-ignored": lambda values: f"of the scene's color management, {' and '.join(values['names'])} are ignored. "
                                   "Apply them to exported views",
    "aspect-ignored": "the pixel aspect {x:g}:{y:g} is ignored. Pixels have the shape of the display's",
    "lines-left-out": lambda values: f"lines ({listed(values['names'], MOST_NAMES)}) are left out. Cycles draws none",
    "coordinates-differ": lambda values: f"window coordinates ({listed(values['names'], MOST_NAMES)}) follow the "
                                         "encoded image, not what the eye sees. Use other coordinates",
    "world-negative": "the world {world!r} has negative light, which is cut at black where it shows",
    "focus-ignored": "the depth of field of camera {camera!r} is ignored, since the viewer's eye focuses",
    "camera-sheared": "camera {camera!r} is sheared by the scale of a parent, but a camera array cannot be. Clear that "
                      "scale",
    "camera-parallel": "camera {camera!r} is orthographic, but eyes are at a place: they see it in perspective",
    "world-override-ignored": "the world override {world!r} of view layer {layer!r} is ignored. The scene's world is "
                              "shown",
    "shift-followed": "the camera's shift ({x:g}, {y:g}) becomes a turn. The array looks at the middle of its picture",
    "override-ignored": "the material override {material!r} of view layer {layer!r} is ignored. Objects keep their own "
                        "materials",
    "collections-switched": lambda values: f"view layer {values['layer']!r} {SWITCHES[values['switch']]} "
                                           f"{listed(values['names'], MOST_NAMES)}, and so does this render",
    "layers-left-out": lambda values: f"only view layer {values['layer']!r} is rendered, without "
                                      f"{listed(values['names'], MOST_NAMES)}",
    "compositor-ignored": lambda values: f"compositor nodes ({listed(values['names'], MOST_NAMES)}) are not applied to "
                                         "the light field. Apply them to exported views",
    "sequencer-ignored": "the sequencer's strips are not rendered. The light field shows the scene itself",
    "camera-missing": lambda values: "the scene has no active camera, so the array stands in front of the subject: of "
                                     "a room it sees the outer wall. For a view from inside "
                                     + (f"choose a camera with --camera ({listed(values['others'], MOST_NAMES)}), or "
                                        if values["others"] else "")
                                     + "add one in Blender and move it with Align Active Camera to View",
    "camera-chosen": lambda values: f"the file's camera {values['camera']!r} is used. Choose another with --camera: "
                                    + (f"{listed(values['others'], MOST_NAMES)} or " if values["others"] else "")
                                    + "fit, which places the array in front of the subject",
    "camera-mirrored": "camera {camera!r} is mirrored by a negative scale, of its own or of a parent. The mirror is "
                       "undone: left and right are as in the scene",
    "walls-near": "the views are at {part:.0%} of the display's spacing, because the array would reach through what "
                  "stands beside the camera: the image is flatter",
    "array-blind": lambda values: (f"the array sees {listed(values['seen'], MOST_NAMES)}, but nothing of the subject, "
                                   "which " if values["seen"] else "the array sees nothing, and the subject ")
                                  + PLACES[values["place"]],
    "light-weak": "almost no light reaches what the array sees, so it will be almost black. Increase the lights "
                  "or the exposure, or choose another light (--light)",
    "light-replaced": lambda values: f"{replaced(values)}: choose another light with --light",
    "noisy": "the first view is noisy, so the image takes {times} times the rays of the setting",
    "noisy-long": "the first view is noisy, but {times} times the rays of the setting would take about {seconds:.0f} "
                  "s, so the image takes fewer: ask for more rays where you can wait",
    "world-inside": lambda values: f"{WORLDS[values['reason']]}, so the world is rendered with the subject and is less "
                                   "sharp",
    # Exports and imports
    "page-reduced": "the page holds {width}×{height} of the {eia_width}×{eia_height} pixels: browsers show no more "
                    "than {most} a side",
    "page-large": lambda values: f"the page has {values['bytes'] / 1e6:.0f} MB: phones and mail may refuse it; a lower "
                                 "--quality makes it smaller",
    "views-nearest": "scene-linear views are not interpolated: each part is the rendered view nearest to the one asked "
                     "for",
    "disparity-missing": "disparity was not written, because the frame has no position layer: render at scale 2 or "
                         "more, or with --layers position",
    "display-plane": "things on the display's plane have a depth of {depth:.2f} (0 black, 1 white): set the focus "
                     "there",
    "cameras-cut": "only the {side}×{side} cameras in the middle of {across}×{down} are imported: elemental images are "
                   "square",
    "aspect-assumed": "the quilt's name has no aspect ratio, assumed: --quilt {across}x{down}a{aspect:.4g}",
    "geometry-assumed": lambda values: "there is no camera geometry, assumed: " + listed(
        [f"--{name.replace('_', '-')} {value:g}" for name, value in values.items()]),
    "angle-assumed": "the angle of the cameras is not known, assumed: that of the display, --angle-deg {angle_deg:g}",
    "browser-missing": "no browser was found here: open that page yourself",
    "flip-missing": "FLIP was not computed: the Python that compared has no package flip-evaluator",
    # Calibrations
    "calibrated": lambda values: f"by {values['photographs']} photograph{'' if values['photographs'] == 1 else 's'}: "
                                 f"pitch ±{values['pitch']:.1e} of it, rotation ±{values['turn']:.1e}, shift "
                                 f"±{values['shift']:.4f} of a lens pitch (standard deviations)",
    "calibrated-at-distance": "an error of 1 mm in the camera's distance changes the pitch by {pitch:.1e} of it",
    "number-ignored": "the calibration's {name} of {value:g} is ignored, as by the maker's programs",
    "photograph-mirrored": "{photograph} is mirrored and was mirrored back; if the panel itself mirrors its image, set "
                           "flip in the profile",
    "photograph-turned": "{photograph} shows the panel turned by {degrees}° and was turned back; camera positions "
                         "count along the pattern's own right and up",
    "lens-distorts": "the lens of {photograph} distorts by {fraction:.1%} at the corner, now corrected"}


def sentence(notice: Notice, table: Mapping[str, Wording] | None = None) -> str:
    """Return the sentence of a notice, of ``table`` where that has it."""
    wording = (table or {}).get(notice.code) or SENTENCES[notice.code]
    values = {name: cleaned(value) for name, value in notice.values.items()}
    return wording.format(**values) if isinstance(wording, str) else wording(values)
