"""How near a panel's image comes to a reference: on the panel, and for eyes before it.

One reference is a light field of every view, woven; the other is a render of the panel's own subpixels. They differ by
the error of interpolating between views, so each favours some of the ways. The two halves of a reference are
independent, so that its noise cancels.
"""

from __future__ import annotations

import dataclasses
import math
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import (
    LOW_RES_FILE,
    REFERENCE_FILES,
    SUBPIXELS,
    Request,
    Sampling,
    read_frame,
    read_rendered,
    scales_up_to,
)
from lfsr_core.images.color import srgb_encode
from lfsr_core.images.image_files import read_finite
from lfsr_core.metrics.eia_metrics import Reference, mean_of, psnr, split_ssim_map
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.optics.eye import eye_view
from lfsr_core.optics.panel.weave import gather_map, weave
from lfsr_core.optics.rays import flip_order, from_views, to_elemental_images
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, SUBPIXEL_METHODS, MethodName
from lfsr_core.reconstruct.methods.denoise import denoise_image
from lfsr_core.reconstruct.second_stage import finished_linear, linear_panel_image
from lfsr_lab.experiments.engine.records import REFERENCE, Fingerprint, Records, Store, check_render, reference_of
from lfsr_lab.experiments.engine.timing import children_cpu_seconds, cpu_seconds
from lfsr_lab.experiments.engine.truth import split_mse

FULL_WIDTH = {"integral": 7680, "lenticular": 3840, "hexagonal": 7680}  # pixels of the real panels
STEP = 192  # pixels: 16:9 panels of whole integral lenses
LENS_PIXELS = 12  # behind an integral lens
HEXAGON_PIXELS, TURN_DEG, SHIFT_MM = 10.37, 0.3, (0.31, -0.17)
PIXEL_MM = 708.4 / 7680
DISTANCE = 1.4  # of the integral and hexagonal displays, in panel widths


def kind(name: str, width: int | None = None) -> DisplayProfile:
    """Return a display of FULL_WIDTH, its panel ``width`` pixels wide, None for the real one.

    A smaller panel keeps pixels, lens pitch, turn, slant, cells and viewing angle; the viewing distance shrinks with
    it, so that the scene's parallax is the same, counted in panel widths. LfsrError for a width that cannot be.
    """
    wide = FULL_WIDTH[name] if width is None else width
    if not STEP <= wide <= FULL_WIDTH[name] or wide % STEP:
        raise LfsrError(f"width is {wide}, but a panel must be a multiple of {STEP} pixels wide, at most "
                        f"{FULL_WIDTH[name]}")
    high = wide * 9 // 16
    panel = {"panel_pixels": [wide, high], "panel_mm": [wide * PIXEL_MM, high * PIXEL_MM],
             "viewing_distance_mm": DISTANCE * wide * PIXEL_MM, "viewing_angle_deg": 40.0}
    data: dict[str, Any]
    if name == "integral":
        data = panel | {"lenses": [wide // LENS_PIXELS, high // LENS_PIXELS], "views": [LENS_PIXELS, LENS_PIXELS]}
    elif name == "hexagonal":
        pitch = HEXAGON_PIXELS * PIXEL_MM
        lattice = {"pitch_mm": [pitch, pitch * math.sqrt(0.75)], "rotation_deg": TURN_DEG, "shift_mm": list(SHIFT_MM)}
        data = panel | {"format": 2, "lenslet": {"packing": "hexagonal", "lenses": lattice}}
    else:  # the 16 inch display of the third generation, with the light field that is proposed for the panel
        whole = load_display("looking-glass-16-gen3")
        fraction = wide / whole.panel_pixels[0]
        data = whole.to_dict() | {"panel_pixels": [wide, high],
                                  "panel_mm": [side * fraction for side in whole.panel_mm],
                                  "viewing_distance_mm": whole.viewing_distance_mm * fraction}
        data = {key: value for key, value in data.items() if key not in ("description", "lenses", "views")}
    return DisplayProfile.from_dict(data | {"name": f"{name}-{wide}"})


GUIDES = ("albedo", "normal")


@dataclasses.dataclass(frozen=True)
class Way:
    name: str
    folder: str  # of its renders, without samples
    layout: str  # how it is rendered, see frames.frame.LAYOUTS
    samples: tuple[int, ...]  # per pixel of the render, at which it is measured
    meaning: str

    def scales(self, profile: DisplayProfile) -> tuple[int, ...]:
        """Return the scales that the scene's depth chooses from, as `lfsr render` does, largest first; empty: 1."""
        if self != OURS:
            return ()
        method = MethodName.parse(DEFAULT_METHOD)
        return method.scales_of(scales_up_to(profile))


OURS = Way("default", "ours", "one-pass", (4, 16, 64),
           "fewer views in one pass, as many as `lfsr render` chooses, the default method, the weave")
EVERY_VIEW = Way("every view", "every-view", "one-pass", (1, 4, 16), "every view in one pass, OIDN, the weave")
SUBPIXEL = Way("direct subpixels", "straight", SUBPIXELS, (1, 4, 16),
               "rays of the panel's subpixels, each a pixel of the render, OIDN, no weave")
USUAL = Way("view by view", "every-view", "view-by-view", (4,), "one render per view, OIDN per view, the nearest view")
WAYS = (OURS, EVERY_VIEW, SUBPIXEL, USUAL)


def measured_at(profile: DisplayProfile) -> list[tuple[Way, int]]:
    """Return every way that a display has, with every number of samples."""
    return [(way, samples) for way in WAYS for samples in way.samples if way != SUBPIXEL or profile.is_woven]


def panel_image(folder: Path, way: Way) -> Array:
    """Return what the panel shows, (H, W, 3) uint8 sRGB, from the rendered frame in ``folder``."""
    if way == SUBPIXEL:
        return traced(folder, LOW_RES_FILE, SUBPIXEL_METHODS[0])
    frame = read_frame(folder)
    if way != USUAL:
        return shown(finished_linear(folder, DEFAULT_METHOD), frame.display)
    # Every view is denoised as Blender does: on its own, by its albedo and normal.
    layers = read_finite(folder / LOW_RES_FILE)[0]
    images = {name: to_elemental_images(layers[name][..., :3], frame.rays.tiles)
              for name in ("color", *GUIDES) if name in layers}
    py, px = images["color"].shape[2:4]
    views = np.empty((py, px, *images["color"].shape[:2], 3), np.float32)
    for row, column in np.ndindex(py, px):
        view = {name: image[:, :, row, column] for name, image in images.items()}
        guides = clean_guides({name: view[name] for name in GUIDES if name in view})
        views[row, column] = denoise_image(view["color"], guides.get("albedo"), guides.get("normal"),
                                          clean_aux=bool(guides), quality="balanced")
    return shown(from_views(views), frame.display, "nearest")


def traced(folder: Path, name: str, method: str = "none") -> Array:
    """Return what the panel shows of the file ``name`` of a render of its subpixels, (H, W, 3) uint8 sRGB."""
    layers, frame = read_finite(folder / name)[0], read_rendered(folder)
    return _encoded(linear_panel_image(layers, frame, MethodName.parse(method)))


def shown(linear: Array, display: DisplayProfile, sampling: str | None = None) -> Array:
    """Return the panel's image (H, W, 3) uint8 of a scene-linear light field (rows, columns, 3) in view order.

    ``sampling``: of display.WEAVES, None for the display's own; for a display that is woven.
    """
    eia = _encoded(linear)
    if display.is_woven:
        return weave(eia, gather_map(display, sampling or display.weave))
    return flip_order(eia, display.lenses) if display.ei_order == "flipped" else eia


def _encoded(linear: Array) -> Array:
    return np.rint(srgb_encode(linear) * 255).astype(np.uint8)


def clean_guides(guides: Mapping[str, Array]) -> dict[str, Array]:
    """Return noisy "albedo" and "normal" of one view (H, W, 3) without their noise, as Blender does it."""
    places = {"albedo": (0.0, 1.0), "normal": (1.0, 0.5)}  # from values to those in [0, 1]: (value + first) · second
    return {name: denoise_image(np.clip((guide + places[name][0]) * places[name][1], 0, 1), quality="fast")
            / places[name][1] - places[name][0] for name, guide in guides.items()}


PLACES = ((0.5, 0.5), (0.2, 0.4), (0.8, 0.6), (0.35, 0.75), (0.65, 0.25))  # of eyes, in the viewing zone
Halves = tuple[Array, Array]


@dataclasses.dataclass(frozen=True)
class Accuracy:
    psnr_panel: float | None  # decibels over all subpixels; None: below what the reference's noise lets see
    psnr_eye: float | None  # of what eyes see
    ssim_eye: float


@dataclasses.dataclass(frozen=True)
class Point:
    way: str
    samples: int
    render_cpu: float  # seconds on all cores beyond opening the scene
    finish_cpu: float  # seconds on all cores from the render to the panel's image
    accuracy: Accuracy  # against the woven reference, or the EIA where the panel has no lens sheet
    scale: int = 1  # by which views were divided
    # Against the traced reference of a panel with a lens sheet.
    traced: Accuracy | None = dataclasses.field(default=None, metadata={"key": "straight"})

    @property
    def cpu(self) -> float:
        return self.render_cpu + self.finish_cpu


@dataclasses.dataclass(frozen=True)
class Target:
    profile: DisplayProfile
    panels: Halves  # (H, W, 3) uint8
    eyes: tuple[Halves, ...]  # what eyes see of them, in [0, 1]

    @classmethod
    def of(cls, folder: Path) -> Target:
        """Read the frame folder of a reference of every view, or of the panel's subpixels."""
        frame = read_rendered(folder)
        if frame.layout == SUBPIXELS:
            a, b = (traced(folder, name) for name in REFERENCE_FILES)
        else:
            reference = Reference.read(folder)
            a, b = (shown(half, frame.display, "all") for half in (reference.half_a, reference.half_b))
        return cls(frame.display, (a, b), tuple(zip(seen(a, frame.display), seen(b, frame.display), strict=True)))

    def accuracy(self, panel: Array, seen: Sequence[Array]) -> Accuracy:
        """Return the accuracy of a panel's image (H, W, 3) uint8 and of what eyes see of it."""
        error = np.mean([split_mse(eye, *halves) for eye, halves in zip(seen, self.eyes, strict=True)])
        ssim = np.mean([mean_of(split_ssim_map(eye, *halves)) for eye, halves in zip(seen, self.eyes, strict=True)])
        on_panel = split_mse(panel / 255, *(half / 255 for half in self.panels))
        return Accuracy(psnr(on_panel), psnr(float(error)), float(ssim))


def measure(way: Way, samples: int, rendered: Path, render_cpu: float, targets: Callable[[], list[Target]]) -> Point:
    """Finish a way's render and compare it with the woven reference and, where there is one, the traced one."""
    for _ in range(1 if way == USUAL else 2):  # the first loads libraries, which hardly counts where OIDN runs per view
        started = cpu_seconds()
        panel = panel_image(rendered, way)
        seconds = cpu_seconds() - started
    woven, *others = targets()
    eyes = seen(panel, woven.profile)
    close, *traced_ = (target.accuracy(panel, eyes) for target in (woven, *others))
    scale = read_rendered(rendered).scale
    return Point(way.name, samples, render_cpu, seconds, close, scale, traced_[0] if traced_ else None)


def seen(panel: Array, profile: DisplayProfile) -> list[Array]:
    """Return what eyes at PLACES see of a panel's image, (rows, columns, 3) in [0, 1] each."""
    wide = 2 * profile.viewing_distance_mm * math.tan(math.radians(profile.viewing_angle_deg) / 2)
    high = profile.camera_spacing_mm * (profile.views[1] if profile.parallax[1] else 0)
    eyes = [((x - 0.5) * wide, (y - 0.5) * high, profile.viewing_distance_mm) for x, y in PLACES]
    return [eye_view(panel, profile, eye, width=1) / 255 for eye in eyes]


CPU_FOLDER = "cpu"
FEW = 4


@dataclasses.dataclass(frozen=True)
class Cost:
    """What a render took."""

    cpu: float  # seconds on all cores beyond those of a few lenses


@dataclasses.dataclass(frozen=True)
class Renders:
    store: Store
    scene: Path
    display: DisplayProfile
    reference_spp: int

    @property
    def folder(self) -> Path:
        return self.store.folder / self.scene.stem / self.display.name

    @property
    def reference(self) -> Path:
        """Frame folder of the whole light field in two halves."""
        return self.folder / REFERENCE

    @property
    def traced_reference(self) -> Path | None:
        """Frame folder of the panel's subpixels in two halves; None where the panel has no lens sheet."""
        return self.folder / f"{REFERENCE}-{SUBPIXEL.folder}" if self.display.is_woven else None

    def path(self, way: Way, samples: int) -> Path:
        """Return the frame folder of a way's render; the usual way's has every view too."""
        return self.folder / f"{way.folder}-spp{samples}"

    def fill(self) -> dict[tuple[str, int], float]:
        """Render what is missing and return the CPU seconds of each render, by way and samples."""
        jobs = {(way.name, samples): self._job(way, samples) for way, samples in measured_at(self.display)}
        usual = [self._job(EVERY_VIEW, samples) for name, samples in jobs if name == USUAL.name]
        ways = [(EVERY_VIEW, self.reference), (SUBPIXEL, self.traced_reference)]
        references = [reference_of(self._job(way, self.reference_spp), self.reference_spp, folder)
                      for way, folder in ways if folder]
        every = {job.output: job for job in (*jobs.values(), *usual, *references)}
        if missing := [job for job in every.values() if self._cost(job) is None]:
            self._render(missing)
        for job in every.values():
            check_render(job)
        costs = {}
        for key, job in jobs.items():
            cost = self._cost(job)
            if cost is None:
                raise LfsrError(f"what {job.output} took is not known: delete it and run this again")
            # Of the usual way the seconds that all views would take.
            costs[key] = cost.cpu * (math.prod(self.display.views) / math.prod(job.display.views))
        return costs

    def _render(self, jobs: Sequence[Request]) -> None:
        """Render one after the other, each in its own Blender; the seconds of a few lenses alone do not count."""
        few = dataclasses.replace(jobs[0], output=str(self.folder / "few-lenses"), sampling=Sampling(1, 1),
                                  kind="render", display=self.display, layout="one-pass",
                                  lens_list=tuple((row, column) for row in range(4) for column in range(4)))
        opening = 0.0
        for job in (few, *jobs):
            shutil.rmtree(job.output, ignore_errors=True)
            started = children_cpu_seconds()
            self.store.rendered(job)
            seconds = children_cpu_seconds() - started
            if job is few:
                opening = seconds
            else:
                self._costs.write(Path(job.output).name, _mark(job), Cost(max(0.0, seconds - opening)))

    @property
    def _costs(self) -> Records[Cost]:
        return Records(self.folder / CPU_FOLDER, Cost)

    def _cost(self, job: Request) -> Cost | None:
        folder = Path(job.output)
        return self._costs.read(folder.name, _mark(job)) if FrameFolder(folder).holds(job.kind) else None

    def _job(self, way: Way, samples: int) -> Request:
        scales, one_by_one = way.scales(self.display), way == USUAL
        return Request(output=str(self.folder / f"few-views-spp{samples}" if one_by_one else self.path(way, samples)),
                   display=with_few_views(self.display) if one_by_one else self.display,
                   scene=str(self.scene.resolve()), sampling=Sampling(max(scales, default=1), samples, scales),
                   layers=GUIDES if way == EVERY_VIEW else (), layout=way.layout)


def with_few_views(profile: DisplayProfile) -> DisplayProfile:
    """Return the display with FEW views along each axis that has several."""
    px, py = (FEW if many else 1 for many in profile.parallax)
    pixels = profile.panel_pixels if profile.is_woven else (profile.lenses[0] * px, profile.lenses[1] * py)
    return dataclasses.replace(profile, views=(px, py), panel_pixels=pixels)


def _mark(job: Request) -> Fingerprint:
    return {"samples": job.sampling.samples, "scale": job.sampling.scale, "layout": job.layout}
