"""frame.json keeps everything that decides a render."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfsr_core.base.messages import Notice
from lfsr_core.frames.frame import FRAME_FILE, REFERENCE_FILES, Frame, read_frame, read_part, write_frame
from lfsr_core.images.color import ColorSettings
from lfsr_core.metrics.eia_metrics import Reference, check_reference, listed_images
from lfsr_core.optics.display import load_display
from lfsr_core.optics.rays import CameraArray, to_elemental_images
from tests.support.synthetic import IDENTITY, MINI, frame_of, light_field, write_reference
from tests.support.told import refuses

# No field has its default, so that one forgotten on the way shows.
FRAME = Frame(
    display=MINI, scale=2, array=dataclasses.replace(CameraArray.for_display(MINI, 2.0), clip=(0.25, 30.0)),
    matrix_world=IDENTITY, samples=7, seed=3, frame=5, convention="paper", view_aperture=0.5, rows=(2, 3),
    lens_list=((1, 2), (3, 4)), layout="view-by-view", gpus=("0000:01:00",), layers=("albedo", "normal"),
    world_visible=True, world_apart=True, scale_reason=Notice("scale-unseen", {"scale": 2}), scene="scene.blend",
    seeds=(3, 4), color=ColorSettings("Rec.2020", "AgX", "AgX - Punchy", 0.5, 1.1, "config.ocio"),
    scene_name="Set", source="../shot.blend", subject="Things", camera="Left", content="abc",
    blender="5.0.1", device="OPTIX", notes=(Notice("render-note", {"text": "a note"}),),
    light="city", seconds={"render": 1.5})


def test_round_trip_keeps_every_field_and_rays_follow_the_frame(tmp_path):
    defaults = {field.name: field.default for field in dataclasses.fields(Frame)}
    assert all(getattr(FRAME, name) != default for name, default in defaults.items())
    write_frame(tmp_path, FRAME)
    assert read_part(tmp_path) == FRAME
    rays = FRAME.rays
    assert rays.views == (4, 4) and rays.spacing == pytest.approx(2 * FRAME.array.spacing)
    assert (rays.convention, rays.view_aperture, rays.lens_list) == ("paper", 0.5, ((1, 2), (3, 4)))
    write_frame(tmp_path, dataclasses.replace(FRAME, lens_list=None, rows=None))
    assert read_frame(tmp_path).lens_list is None


@pytest.mark.parametrize(("change", "message"), [(lambda data: data.update(format=99), "is not of format 1"),
    (lambda data: data.pop("format"), "is not of format 1"), (lambda data: data.pop("array"), "incomplete.*array"),
    (lambda data: data.update(matrix_world=[[1.0] * 4] * 3), "four rows of four"),
    (lambda data: data.update(matrix_world=[[0.0] * 4] * 4), "matrix_world is .*expected a rotation and a place"),
    (lambda data: data["matrix_world"].__setitem__(0, [2.0, 0.0, 0.0, 0.0]), "expected a rotation and a place"),
    (lambda data: data["matrix_world"].__setitem__(0, [1.0, 1.0, 0.0, 0.0]), "expected a rotation and a place"),
    (lambda data: data["matrix_world"].__setitem__(0, [1e308, 1e308, 1e308, 0.0]), "expected a rotation and a place"),
    (lambda data: data["matrix_world"].__setitem__(0, [1.0, 0.0, 0.0, 1e308]), "expected a rotation and a place"),
    (lambda data: data["matrix_world"].__setitem__(3, [0.0, 0.0, 1.0, 1.0]), "expected a rotation and a place"),
    (lambda data: data.update(samples=0), "samples are 0"),
    (lambda data: data.update(layout="round"), "layout is 'round'"),
    (lambda data: data["array"].update(distance=0.0), "array.distance is 0.0"),
    (lambda data: data["color"].update(exposure=1e9), "exposure is 1000000000.0"),
    (lambda data: data.update(lens_list=[[0, 0]] * 193), "lens_list names 193 lenses"),
    (lambda data: data.update(lens_list=[[0, 99]]), "outside the"), (lambda data: data.update(scale=3), "scale is 3"),
    (lambda data: data["display"].update(lenses=[3, 3]), "frame.json: panel_pixels")])
def test_damaged_frame_is_refused(tmp_path, change, message):
    write_frame(tmp_path, FRAME)
    data = json.loads((tmp_path / FRAME_FILE).read_text())
    change(data)
    (tmp_path / FRAME_FILE).write_text(json.dumps(data))
    refuses(message, read_frame, tmp_path)


@settings(max_examples=30)
@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda numbers: np.linalg.norm(numbers) > 0.1),
       st.sampled_from([1, -1]), st.tuples(*[st.floats(-1e6, 1e6)] * 3))
def test_every_rotation_mirrored_or_not_is_taken_to_single_precision(numbers, hand, place):
    w, *axis = numbers / np.linalg.norm(numbers)
    cross = np.cross(np.eye(3), axis)
    turn = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    rows = np.c_[turn @ np.diag([1, 1, hand]), place].astype(np.float32).tolist()
    matrix = tuple(map(tuple, [*rows, [0.0, 0.0, 0.0, 1.0]]))
    assert dataclasses.replace(FRAME, matrix_world=matrix).matrix_world == matrix


def test_folders_without_a_frame_or_a_whole_reference_are_named(tmp_path):
    refuses(r"frame.json does not exist, expected the frame.json of a rendered", read_frame, tmp_path / "nowhere")
    for clip in [(-1.0, 2.0), (2.0, 1.0), (0.0, float("inf"))]:
        refuses("two depths", dataclasses.replace, FRAME, array=dataclasses.replace(FRAME.array, clip=clip))
    folder = write_reference(tmp_path)
    write_frame(folder, frame_of(1, lens_list=LISTED))
    refuses("but frame.json says", Reference.read, folder)
    write_frame(folder, frame_of(1))
    first, second = (folder / name for name in REFERENCE_FILES)
    second.write_bytes(first.read_bytes())
    refuses("both halves in .* are the same image", Reference.read, folder)
    second.unlink()
    refuses(REFERENCE_FILES[1], Reference.read, folder)


LISTED = tuple((row, column) for row in range(1, 9) for column in (2, 7, 8))[:23]


def test_a_reference_holds_every_lens_or_those_listed_without_spare_tiles(tmp_path):
    reference = Reference.read(write_reference(tmp_path, noise=1e-6))
    sx, sy = reference.frame.display.lenses
    field = light_field()
    assert reference.folder == tmp_path and reference.lens_list is None
    np.testing.assert_allclose(reference.half_a, field[..., :3], atol=1e-4)
    np.testing.assert_allclose(reference.half_b, field[..., :3], atol=1e-4)
    assert reference.lenses.tolist() == [[row, column] for row in range(sy) for column in range(sx)]
    hits = to_elemental_images(field[..., 3:], (sx, sy)).any((2, 3, 4))
    assert 0 < hits.sum() < hits.size and np.array_equal(reference.hits, hits)
    assert np.array_equal(reference.foreground.reshape(sy, sx), hits)
    listed = Reference.read(write_reference(tmp_path / "listed", noise=1e-6, lens_list=LISTED))
    whole = Reference.read(write_reference(tmp_path / "whole", noise=1e-6))
    places = [row * whole.hits.shape[1] + column for row, column in LISTED]
    assert listed.lens_list == LISTED and listed.lenses.tolist() == [list(lens) for lens in LISTED]
    assert listed.hits.size > len(LISTED)  # a square of tiles
    assert np.array_equal(listed.foreground, whole.foreground[places])
    for half in ("half_a", "half_b"):
        ours, theirs = (listed_images(getattr(stored, half), stored.frame) for stored in (listed, whole))
        np.testing.assert_allclose(ours, theirs[places], atol=1e-4)


REFERENCE = frame_of(1)
SHIFTED = tuple(tuple(value + 0.3 * (column == 3) for column, value in enumerate(row))
                for row in REFERENCE.matrix_world[:3]) + REFERENCE.matrix_world[3:]


def test_matching_references_pass_and_others_are_refused():
    nudged = tuple(tuple(value + 1e-7 for value in row) for row in REFERENCE.matrix_world)
    check_reference(frame_of(4), dataclasses.replace(REFERENCE, matrix_world=nudged, samples=512, seed=9))
    check_reference(frame_of(4), dataclasses.replace(REFERENCE, lens_list=((0, 0), (3, 4))))
    refuses("own, but the frame with light city", check_reference, frame_of(4, light="city"), frame_of(1, light="own"))
    check_reference(frame_of(4, light="city"), frame_of(1))
    check_reference(frame_of(4), frame_of(1, light="own"))
    refuses("other lenses", check_reference, frame_of(4, lens_list=((0, 0),)), frame_of(1, lens_list=((0, 1),)))
    for changes, message in [
        ({"scale": 2}, "has scale 2"), ({"convention": "paper"}, "convention paper"),
        ({"display": dataclasses.replace(load_display("mini"), name="other")}, "display other"),
        ({"frame": 7}, "frame number 7"), ({"world_visible": True}, "with visible world, but .* no visible world"),
        ({"array": CameraArray.for_display(MINI, 0.8)}, r"plane is [\d.]+ from the cameras, the frame's [\d.]+\. "),
        ({"array": dataclasses.replace(REFERENCE.array, spacing=REFERENCE.array.spacing * 1.01)}, "elsewhere"),
        ({"array": dataclasses.replace(REFERENCE.array, clip=(1.0, 9.0))}, "its cameras stand, face or clip elsewhere"),
        ({"matrix_world": SHIFTED}, "its cameras stand, face or clip elsewhere"),
        ({"matrix_world": SHIFTED, "scene": "two.glb"}, r"shows another scene, two\.glb, but the frame one\.blend")]:
        other = dataclasses.replace(REFERENCE, **{"scene": "one.blend"} | changes)
        refuses(message, check_reference, frame_of(4, scene="one.blend"), other)
