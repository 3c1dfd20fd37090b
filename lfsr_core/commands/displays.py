"""``lfsr displays [NAME]``: list, show, import and calibrate display profiles; list those that are connected."""

import argparse
import dataclasses
import math
from pathlib import Path
from typing import Any

from lfsr_core.base.messages import LfsrError, Notice, cleaned
from lfsr_core.commands.common import position
from lfsr_core.commands.sentences import sentence
from lfsr_core.optics.display import DisplayProfile, builtin_names, load_display, proposed_light_field, write_profile


def displays_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `lfsr displays`."""
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


def run_displays(arguments: argparse.Namespace) -> Any:
    """List the profiles, show one, or make a profile or a pattern."""
    from lfsr_core.calibration.fit import calibrate
    from lfsr_core.calibration.makers import profile_from_calibration, profile_of_c1, read_calibration
    from lfsr_core.calibration.patterns import pattern
    from lfsr_core.exports.show import Bridge, chosen
    from lfsr_core.images.image_files import write_png

    output = arguments.output
    if arguments.bridge and not output:
        devices = Bridge().devices()
        for device in devices:
            try:
                told = ("{screenW:g}×{screenH:g} px, {viewCone:g}° cone, {pitch:.4f} cylinders per "
                        "inch".format(**device.calibration.numbers))
            except LfsrError as error:
                told = str(error)
            quilt = [device.quilt.get(name, "?") for name in ("tileX", "tileY", "quiltX", "quiltY")]
            place = f"{device.name} ({device.hardware}), at {device.corner[0]},{device.corner[1]}"
            told += f", quilt {quilt[0]}×{quilt[1]} of {quilt[2]}×{quilt[3]} px"
            print(f"{device.index:2}  {cleaned(place)}: {cleaned(told)}")
        return {"displays": devices}
    for name, asked, wanted in (("--import writes a profile", arguments.calibration or arguments.bridge, "FILE.toml"),
                                ("--cubevi writes a profile", arguments.cubevi, "FILE.toml"),
                                ("--fit writes a profile", arguments.fit and output, "FILE.toml"),
                                ("--pattern writes an image", arguments.pattern, "FILE.png")):
        if asked and (output is None or output.suffix.lower() != wanted[4:]):
            raise LfsrError(f"{name}, but {output or 'no file'} was given: give -o {wanted}")
    makes = (arguments.bridge, arguments.calibration, arguments.cubevi, arguments.pattern, arguments.fit)
    if output and not any(makes):
        raise LfsrError(f"there is nothing to write to {output}: add --bridge, --import, --cubevi, --pattern or --fit")
    if arguments.display and (arguments.calibration or arguments.cubevi):
        raise LfsrError(f"--import and --cubevi describe a whole display: leave {arguments.display} out")
    if arguments.places and not arguments.fit:
        raise LfsrError("--from is for the photographs of --fit, but none was given: leave it out")
    if (arguments.pattern or arguments.fit) and not arguments.display:
        raise LfsrError("--pattern and --fit need a display: give its name or FILE.toml")
    if arguments.bridge or arguments.calibration:
        if arguments.bridge:
            devices = Bridge().devices()
            if arguments.display is None and len(devices) > 1:
                listed = ", ".join(f"{device.index} ({device.name})" for device in devices)
                raise LfsrError(f"{len(devices)} displays are connected, but a profile is of one: name one of {listed}")
            device = chosen(devices, arguments.display)
            calibration, shape = device.calibration, device.shape
        else:
            calibration, shape = read_calibration(arguments.calibration), None
        for name, usual in (("fringe", 0), ("invView", 1)):
            if (value := calibration.numbers[name]) != usual:
                print(f"note: {sentence(Notice('number-ignored', {'name': name, 'value': value}))}")
        profile = profile_from_calibration(calibration, output.stem)
        profile = dataclasses.replace(profile, quilt=shape or profile.quilt)
        write_profile(output, profile)
    elif arguments.cubevi:
        slope, interval, x0 = arguments.cubevi
        profile = profile_of_c1(slope, interval, x0, output.stem)
        write_profile(output, profile)
    elif arguments.pattern:
        write_png(output, pattern(load_display(arguments.display), arguments.pattern))
        print(output)
        return {"file": output}
    elif arguments.fit:
        profile, photos = load_display(arguments.display), arguments.fit
        places = arguments.places or [(0.0, 0.0, profile.viewing_distance_mm)] * len(photos)
        if len(places) != len(photos):
            raise LfsrError(f"{len(photos)} photographs and {len(places)} positions were given: give --from X,Y,Z once "
                            "for each photograph")
        profile, notices = calibrate(profile, photos, places, output)
        print("\n".join(map(sentence, notices)))
        if output:
            print(f"taken and predicted: {output.with_suffix('.png')}")
    elif arguments.display:
        profile = load_display(arguments.display)
    else:
        profiles = [load_display(name) for name in builtin_names()]
        for profile in profiles:
            print(f"{profile.name:22} {_pair(profile.panel_pixels)} px, {_pair(profile.lenses)} lenses of "
                  f"{_pair(profile.views)} views. {profile.description}")
        return {"displays": profiles}
    print("\n".join(describe(profile)))
    return profile


def describe(profile: DisplayProfile) -> list[str]:
    """Lines that describe a profile: its own numbers, then those derived from them."""
    from lfsr_core.optics.eye import view_spread
    from lfsr_core.optics.panel.subpixel_rays import Geometry, elemental_lattice

    pitch_x, pitch_y = profile.lens_pitch_mm
    spacing = profile.camera_spacing_mm

    def angle(views: int) -> float:
        """Angle in degrees that ``views`` neighbouring views cover at the viewing distance."""
        return math.degrees(2 * math.atan(views * spacing / 2 / profile.viewing_distance_mm))

    woven = list[tuple[str, str]]()  # lens sheet, subpixels and weave, and how much of each view an eye sees
    if profile.is_woven:
        spread, geometry = view_spread(profile), Geometry.of(profile)
        (width, height), subpixels = profile.panel_mm, profile.pixel_layout
        if sheet := profile.lenslet:
            images = elemental_lattice(sheet, geometry)
            (across, down), (right, up) = sheet.lenses.pitch_mm, sheet.lenses.shift_mm
            woven += [("lens sheet", f"{sheet.packing}, {across:.4g} × {down:.4g} mm apart, turned by "
                                     f"{sheet.lenses.rotation_deg:g}°, shifted by {right:.4g} × {up:.4g} mm"),
                      ("pixels behind a lens", " × ".join(f"{pitch * profile.panel_pixels[0] / width:.3f}"
                                                          for pitch in images.pitch_mm))]
        if cylinders := profile.lenticular:
            across = cylinders.lenses_across(width)
            woven += [("cylinders", f"{across:.3f} across (P), {cylinders.pitch_mm:.6g} mm apart, "
                                    f"leaning {math.degrees(math.atan(cylinders.slant)):.4g}°"),
                      ("tilt", f"{cylinders.slant * height / width:.7f} panel heights per width"),
                      ("subpixels per cylinder", f"{3 * profile.panel_pixels[0] / across:.3f} in a row")]
        lenses, views = proposed_light_field(profile.panel_pixels, profile.panel_mm, profile.sheet)
        woven += [
            ("subpixels", f"{len(subpixels.cells)} cells, pixel x, y has number {subpixels.cell_rule}"
             if subpixels.cells else f"{subpixels.stripes} stripes".replace("white stripes", "in one place")),
            ("panel to lenses", f"{geometry.gap:.3f} mm"),
            ("full resolution", f"{_pair(lenses)} lenses of {_pair(views)} views"),
            ("weave", f"interpolates {profile.weave}" if profile.weave != "nearest" else "takes the nearest view"),
            ("an eye at a view sees", f"{spread.own:.0%} of that view, {spread.neighbours:.0%} of its neighbours"),
            ("crosstalk", f"{spread.others:.1%} of other views")]
    rows = [
        ("panel", f"{_pair(profile.panel_pixels)} px, {profile.panel_mm[0]:g} × {profile.panel_mm[1]:g} mm"),
        ("lenses", f"{_pair(profile.lenses)} = {math.prod(profile.lenses)}"),
        ("views per lens", f"{_pair(profile.views)} = {math.prod(profile.views)}"),
        ("viewing distance", f"{profile.viewing_distance_mm:g} mm"),
        ("viewing angle", f"{profile.viewing_angle_deg:g}° (horizontal)"),
        ("pixels inside an EI", profile.ei_order),
        ("background", " ".join(f"{value:g}" for value in profile.background) + " (scene-linear)"),
        *woven,
        ("lens pitch", f"{pitch_x:.3f} × {pitch_y:.3f} mm"),
        ("pixel pitch", f"{profile.panel_mm[0] / profile.panel_pixels[0]:.4f} mm"),
        ("view spacing", f"{spacing:.3f} mm at the viewing distance, {angle(1):.3f}°"),
        ("vertical angle", f"{angle(profile.views[1]):.1f}°" if profile.parallax[1] else "none: one view vertically"),
        ("scale factors", ", ".join(map(str, profile.scales())) or "none: no factor from 2 to 10 divides the views")]
    for scale in (1, *profile.scales()):
        front, behind = profile.depth_range_mm(scale)
        far = "without limit" if math.isinf(behind) else f"{behind:.1f} mm"
        rows.append((f"depth at scale {scale}", f"{front:.1f} mm in front, {far} behind the display"))
    heading = f"{profile.name}: {profile.title}" if profile.title else profile.name
    return [heading, f"  {profile.description}", *(f"  {label:22} {value}" for label, value in rows)]


def _pair(pair: tuple[int, int]) -> str:
    return f"{pair[0]}×{pair[1]}"
