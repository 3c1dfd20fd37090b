"""``lfsr displays [NAME]``."""

from __future__ import annotations

import argparse
import math

from lfsr_core.optics.display import DisplayProfile, builtin_names, load_display

NAME = "displays"
HELP = "list the display profiles, or show one with its derived numbers"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of this verb."""
    parser.add_argument("display", nargs="?", metavar="NAME|FILE.toml", help="profile to show")


def run(arguments: argparse.Namespace) -> None:
    """Print one line per profile, or every number of one."""
    if arguments.display:
        print("\n".join(describe(load_display(arguments.display))))
        return
    for name in builtin_names():
        profile = load_display(name)
        print(f"{name:14} {_pair(profile.panel_pixels)} px, {_pair(profile.lenses)} lenses of "
              f"{_pair(profile.views)} views. {profile.description}")


def describe(profile: DisplayProfile) -> list[str]:
    """Lines that show a profile: what it states, then what follows from it."""
    rows = [*_stated(profile), *_derived(profile)]
    rows += [(f"depth at scale {scale}", _depth(profile, scale)) for scale in (1, *profile.scales())]
    return [profile.name, f"  {profile.description}", *(f"  {label:22} {value}" for label, value in rows)]


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


def _derived(profile: DisplayProfile) -> list[tuple[str, str]]:
    pitch_x, pitch_y = profile.lens_pitch_mm
    spacing = profile.camera_spacing_mm
    per_view = math.degrees(2 * math.atan(spacing / 2 / profile.viewing_distance_mm))
    return [
        ("lens pitch", f"{pitch_x:.3f} × {pitch_y:.3f} mm"),
        ("pixel pitch", f"{profile.panel_mm[0] / profile.panel_pixels[0]:.4f} mm"),
        ("view spacing", f"{spacing:.3f} mm at the viewing distance, {per_view:.3f}°"),
        ("vertical angle", f"{_vertical_angle(profile):.1f}°"),
        ("scale factors", ", ".join(map(str, profile.scales())) or "none: views share no factor from 2 to 10"),
    ]


def _vertical_angle(profile: DisplayProfile) -> float:
    """Viewing angle in degrees that the vertical views fill at the same spacing."""
    return math.degrees(2 * math.atan(profile.views[1] * profile.camera_spacing_mm / 2 / profile.viewing_distance_mm))


def _depth(profile: DisplayProfile, scale: int) -> str:
    front, behind = profile.depth_range_mm(scale)
    far = "without limit" if math.isinf(behind) else f"{behind:.1f} mm"
    return f"{front:.1f} mm in front, {far} behind the display"


def _pair(pair: tuple[int, int]) -> str:
    return f"{pair[0]}×{pair[1]}"
