"""``lfsr displays [NAME]``: list, show, import and calibrate display profiles; list those that are connected."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.commands.arguments import position
from lfsr_core.commands.sentences import sentence
from lfsr_core.optics.display import DisplayProfile, builtin_names, load_display
from lfsr_core.optics.proposal import PanelShape, proposed_light_field
from lfsr_core.optics.sheet import Lenslet, Lenticular

if TYPE_CHECKING:
    from lfsr_core.calibration.visual_json import Calibration

NAME = "displays"
HELP = "list the display profiles, show one with its derived numbers, import or calibrate one"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("display", nargs="?", metavar="NAME|FILE.toml", help="profile to show")
    parser.add_argument("--import", dest="calibration", type=Path, metavar="VISUAL.json",
                        help="make a profile from a Looking Glass calibration; needs -o FILE.toml")
    parser.add_argument("--bridge", action="store_true",
                        help="list the displays of Looking Glass Bridge; with -o FILE.toml: make the profile of one, "
                             "named by its index or name where there are several")
    parser.add_argument("--cubevi", nargs=3, type=float, metavar=("SLOPE", "INTERVAL", "X0"),
                        help="make a profile of a CubeVi C1 from what Cubestage shows as obliquity, lineNumber "
                             "and deviation; needs -o FILE.toml; negative ones as \" -1.95\"")
    parser.add_argument("--pattern", metavar="phase|lens|band|rgb|grid",
                        help="write a test image for the panel, for judging by eye or for a photograph; needs -o "
                             "FILE.png")
    parser.add_argument("--fit", nargs="+", type=Path, metavar="PHOTO",
                        help="find pitch, rotation and shift of the lens sheet from photographs (JPEG, PNG) of the "
                             "phase pattern; -o FILE.toml writes the profile, and FILE.png with what it predicts")
    parser.add_argument("--from", dest="places", action="append", type=position, metavar="X,Y,Z",
                        help="camera position of each photograph, in order, in millimetres from the centre of the "
                             "lenses: rightwards, upwards, towards the viewer; default: 0,0 and the viewing distance")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="file to write")


def run(arguments: argparse.Namespace) -> None:
    """List the profiles, show one, or make a profile or a pattern."""
    if arguments.bridge and not arguments.output:
        return _print_connected()
    if arguments.bridge or arguments.calibration:
        profile = _imported(arguments)
    elif arguments.cubevi:
        profile = _of_c1(arguments)
    elif arguments.pattern:
        return _write_pattern(arguments)
    elif arguments.fit:
        profile = _fitted(arguments)
    elif arguments.display:
        profile = load_display(arguments.display)
    else:
        return print("\n".join(map(_line, builtin_names())))
    return print("\n".join(describe(profile)))


def _line(name: str) -> str:
    profile = load_display(name)
    return (f"{name:22} {_pair(profile.panel_pixels)} px, {_pair(profile.lenses)} lenses of "
            f"{_pair(profile.views)} views. {profile.description}")


def _print_connected() -> None:
    """A line for each display of Looking Glass Bridge; a calibration that cannot be used is said in its place."""
    from lfsr_core.exports.bridge import Bridge

    for device in Bridge().devices():
        try:
            numbers = device.calibration.numbers
            found = "{screenW:g}×{screenH:g} px, {viewCone:g}° cone, {pitch:.4f} cylinders per inch".format(**numbers)
        except LfsrError as error:
            found = str(error)
        quilt = [device.quilt.get(name, "?") for name in ("tileX", "tileY", "quiltX", "quiltY")]
        print(f"{device.index:2}  {device.name} ({device.hardware}), at {device.corner[0]},{device.corner[1]}: "
              f"{found}, quilt {quilt[0]}×{quilt[1]} of {quilt[2]}×{quilt[3]} px")


def _connected(name: str | None) -> Calibration:
    """Calibration of a display of Looking Glass Bridge; LfsrError where none is named among several."""
    from lfsr_core.exports.bridge import Bridge, chosen

    devices = Bridge().devices()
    if name is None and len(devices) > 1:
        known = ", ".join(f"{device.index} ({device.name})" for device in devices)
        raise LfsrError(f"{len(devices)} displays are connected, but a profile is of one: name one of {known}")
    return chosen(devices, name).calibration


def _imported(arguments: argparse.Namespace) -> DisplayProfile:
    """Profile of a calibration, written to the output file and named after it."""
    from lfsr_core.calibration.visual_json import profile_from_calibration, read_calibration
    from lfsr_core.optics.profile_file import write_profile

    output = _output(arguments, "--import writes a profile", "-o FILE.toml")
    calibration = _connected(arguments.display) if arguments.bridge else read_calibration(arguments.calibration)
    profile = profile_from_calibration(calibration, output.stem)
    write_profile(output, profile)
    for name, usual in (("fringe", 0), ("invView", 1)):
        if (value := calibration.numbers[name]) != usual:
            print(f"note: {sentence(Notice('number-ignored', {'name': name, 'value': value}))}")
    return profile


def _of_c1(arguments: argparse.Namespace) -> DisplayProfile:
    """Profile of a CubeVi C1, written to the output file and named after it."""
    from lfsr_core.calibration.cubevi import profile_of_c1
    from lfsr_core.optics.profile_file import write_profile

    output = _output(arguments, "--cubevi writes a profile", "-o FILE.toml")
    slope, interval, x0 = arguments.cubevi
    profile = profile_of_c1(slope, interval, x0, output.stem)
    write_profile(output, profile)
    return profile


def _write_pattern(arguments: argparse.Namespace) -> None:
    from lfsr_core.calibration.patterns import pattern
    from lfsr_core.images.png import write_png

    output = _output(arguments, "--pattern writes an image", "-o FILE.png")
    write_png(output, pattern(_given(arguments), arguments.pattern))
    print(output)


def _fitted(arguments: argparse.Namespace) -> DisplayProfile:
    """Profile with the lens sheet of the photographs, written if an output file is given."""
    from lfsr_core.calibration.measure import calibrate

    profile, photos = _given(arguments), arguments.fit
    places = arguments.places or [(0.0, 0.0, profile.viewing_distance_mm)] * len(photos)
    if len(places) != len(photos):
        raise LfsrError(f"{len(photos)} photographs and {len(places)} positions were given: give --from X,Y,Z once for "
                        "each photograph")
    if arguments.output and arguments.output.suffix != ".toml":
        raise LfsrError(f"{arguments.output} cannot be a display profile: end its name in .toml")
    found, notices = calibrate(profile, photos, places, arguments.output)
    print("\n".join(map(sentence, notices)))
    if arguments.output:
        print(f"taken and predicted: {arguments.output.with_suffix('.png')}")
    return found.profile


def _given(arguments: argparse.Namespace) -> DisplayProfile:
    if not arguments.display:
        raise LfsrError("--pattern and --fit need a display: give its name or FILE.toml")
    return load_display(arguments.display)


def _output(arguments: argparse.Namespace, what: str, wanted: str) -> Path:
    if arguments.output is None:
        raise LfsrError(f"{what}, but no file was given: add {wanted}")
    return Path(arguments.output)


def describe(profile: DisplayProfile) -> list[str]:
    """Lines that describe a profile: its own numbers, then those derived from them."""
    rows = [*_stated(profile), *(_sheet(profile) if profile.is_woven else ()), *_derived(profile)]
    rows += [(f"depth at scale {scale}", _depth(profile, scale)) for scale in (1, *profile.scales())]
    heading = f"{profile.name}: {profile.title}" if profile.title else profile.name
    return [heading, f"  {profile.description}", *(f"  {label:22} {value}" for label, value in rows)]


def _stated(profile: DisplayProfile) -> list[tuple[str, str]]:
    return [
        ("panel", f"{_pair(profile.panel_pixels)} px, {profile.panel_mm[0]:g} × {profile.panel_mm[1]:g} mm"),
        ("lenses", f"{_pair(profile.lenses)} = {math.prod(profile.lenses)}"),
        ("views per lens", f"{_pair(profile.views)} = {math.prod(profile.views)}"),
        ("viewing distance", f"{profile.viewing_distance_mm:g} mm"),
        ("viewing angle", f"{profile.viewing_angle_deg:g}° (horizontal)"),
        ("pixels inside an EI", profile.ei_order),
        ("background", " ".join(f"{value:g}" for value in profile.background) + " (scene-linear)"),
    ]


def _sheet(profile: DisplayProfile) -> list[tuple[str, str]]:
    """Lens sheet, subpixels and weave of the panel, and how much of each view an eye sees."""
    from lfsr_core.optics.panel.crosstalk import view_spread
    from lfsr_core.optics.panel.subpixel_rays import Geometry

    spread, geometry = view_spread(profile), Geometry.of(profile)
    shape = PanelShape(profile.panel_pixels, profile.panel_mm)
    lenses, views = proposed_light_field(shape, profile.sheet)
    return [*(_lenslet(profile, profile.lenslet) if profile.lenslet else ()),
            *(_lenticular(profile, profile.lenticular) if profile.lenticular else ()), _subpixels(profile),
            ("panel to lenses", f"{geometry.gap:.3f} mm"),
            ("full resolution", f"{_pair(lenses)} lenses of {_pair(views)} views"),
            ("weave", f"interpolates {profile.weave}" if profile.weave != "nearest" else "takes the nearest view"),
            ("an eye at a view sees", f"{spread.own:.0%} of that view, {spread.neighbours:.0%} of its neighbours"),
            ("crosstalk", f"{spread.others:.1%} of other views")]


def _lenticular(profile: DisplayProfile, sheet: Lenticular) -> list[tuple[str, str]]:
    width, height = profile.panel_mm
    across = sheet.lenses_across(width)
    return [("cylinders", f"{across:.3f} across (P), {sheet.pitch_mm:.6g} mm apart, "
                          f"leaning {math.degrees(math.atan(sheet.slant)):.4g}°"),
            ("tilt", f"{sheet.slant * height / width:.7f} panel heights per width"),
            ("subpixels per cylinder", f"{3 * profile.panel_pixels[0] / across:.3f} in a row")]


def _lenslet(profile: DisplayProfile, sheet: Lenslet) -> list[tuple[str, str]]:
    from lfsr_core.optics.panel.subpixel_rays import Geometry, elemental_lattice

    pixel, images = profile.panel_mm[0] / profile.panel_pixels[0], elemental_lattice(sheet, Geometry.of(profile))
    return [("lens sheet", f"{sheet.packing}, {_mm(sheet.lenses.pitch_mm)} apart, turned by "
                           f"{sheet.lenses.rotation_deg:g}°, shifted by {_mm(sheet.lenses.shift_mm)}"),
            ("pixels behind a lens", " × ".join(f"{pitch / pixel:.3f}" for pitch in images.pitch_mm))]


def _subpixels(profile: DisplayProfile) -> tuple[str, str]:
    subpixels = profile.pixel_layout
    if subpixels.cells:
        return "subpixels", f"{len(subpixels.cells)} cells, pixel x, y has number {subpixels.cell_rule}"
    return "subpixels", f"{subpixels.stripes} stripes" if subpixels.stripes != "white" else "in one place"


def _derived(profile: DisplayProfile) -> list[tuple[str, str]]:
    pitch_x, pitch_y = profile.lens_pitch_mm
    spacing, vertical = profile.camera_spacing_mm, f"{_seen_angle(profile, profile.views[1]):.1f}°"
    return [
        ("lens pitch", f"{pitch_x:.3f} × {pitch_y:.3f} mm"),
        ("pixel pitch", f"{profile.panel_mm[0] / profile.panel_pixels[0]:.4f} mm"),
        ("view spacing", f"{spacing:.3f} mm at the viewing distance, {_seen_angle(profile, 1):.3f}°"),
        ("vertical angle", vertical if profile.parallax[1] else "none: one view vertically"),
        ("scale factors", ", ".join(map(str, profile.scales())) or "none: no factor from 2 to 10 divides the views"),
    ]


def _seen_angle(profile: DisplayProfile, views: int) -> float:
    """Angle in degrees of so many neighbouring views at the viewing distance."""
    return math.degrees(2 * math.atan(views * profile.camera_spacing_mm / 2 / profile.viewing_distance_mm))


def _depth(profile: DisplayProfile, scale: int) -> str:
    front, behind = profile.depth_range_mm(scale)
    far = "without limit" if math.isinf(behind) else f"{behind:.1f} mm"
    return f"{front:.1f} mm in front, {far} behind the display"


def _mm(pair: tuple[float, float]) -> str:
    return f"{pair[0]:.4g} × {pair[1]:.4g} mm"


def _pair(pair: tuple[int, int]) -> str:
    return f"{pair[0]}×{pair[1]}"
