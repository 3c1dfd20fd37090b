"""frame.json keeps everything that decides a render."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfsr_core.base.notices import Notice
from lfsr_core.frames.frame import FRAME_FILE, Frame, read_frame, read_part, write_frame
from lfsr_core.images.color import ColorSettings
from lfsr_core.optics.display import load_display
from lfsr_core.optics.rays import CameraArray
from tests.support.told import refuses

MINI = load_display("mini")
IDENTITY = tuple(tuple(float(row == column) for column in range(4)) for row in range(4))
# No field has its default, so that one forgotten on the way shows.
FRAME = Frame(
    display=MINI, scale=2, array=CameraArray.for_display(MINI, 2.0), matrix_world=IDENTITY, samples=7, seed=3, frame=5,
    convention="paper", view_aperture=0.5, lens_list=((1, 2), (3, 4)), rows=(2, 3), layout="view-by-view",
    clip=(0.25, 30.0),
    gpus=("0000:01:00",), layers=("albedo", "normal"), world_visible=True, world_apart=True,
    scale_reason=Notice("scale-unseen", {"scale": 2}),
    color=ColorSettings("Rec.2020", "AgX", "AgX - Punchy", 0.5, 1.1, "config.ocio"),
    scene="scene.blend", scene_name="Set", source="../shot.blend", subject="Things", camera="Left", content="abc",
    blender="5.0.1", device="OPTIX", notes=(Notice("render-note", {"text": "a note"}),),
    light="city", seconds={"render": 1.5})


def test_round_trip_keeps_every_field(tmp_path):
    defaults = {field.name: field.default for field in dataclasses.fields(Frame)}
    assert all(getattr(FRAME, name) != default for name, default in defaults.items())
    write_frame(tmp_path, FRAME)
    assert read_part(tmp_path) == FRAME


def test_rays_follow_the_frame(tmp_path):
    rays = FRAME.rays
    assert rays.views == (4, 4)
    assert rays.spacing == pytest.approx(2 * FRAME.array.spacing)
    assert (rays.convention, rays.view_aperture, rays.lens_list) == ("paper", 0.5, ((1, 2), (3, 4)))
    write_frame(tmp_path, dataclasses.replace(FRAME, lens_list=None, rows=None))
    assert read_frame(tmp_path).lens_list is None


def damage(folder, change) -> None:
    write_frame(folder, FRAME)
    data = json.loads((folder / FRAME_FILE).read_text())
    change(data)
    (folder / FRAME_FILE).write_text(json.dumps(data))


@pytest.mark.parametrize(("change", "message"), [
    (lambda data: data.update(format=99), "is not of format 1"),
    (lambda data: data.pop("format"), "is not of format 1"), (lambda data: data.pop("scale"), "incomplete.*scale"),
    (lambda data: data.pop("array"), "incomplete.*array"), (lambda data: data.update(surplus=1), "surplus"),
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
    (lambda data: data.update(lens_list=[[0, 0]] * 100_000), "lens_list names 100000 lenses"),
    (lambda data: data.update(lens_list=[[0, 99]]), "outside the"), (lambda data: data.update(scale=3), "scale is 3"),
    (lambda data: data.update(seconds={"render": 10**400}), "seconds.render is 1000"),
    (lambda data: data["display"].update(lenses=[3, 3]), "frame.json: panel_pixels")])
def test_damaged_frame_is_refused(tmp_path, change, message):
    damage(tmp_path, change)
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


def test_folder_without_frame_is_named(tmp_path):
    refuses(r"frame.json does not exist, expected the frame.json of a rendered", read_frame, tmp_path / "nowhere")
    for clip in [(-1.0, 2.0), (2.0, 1.0), (0.0, float("inf"))]:
        refuses("two depths", dataclasses.replace, FRAME, clip=clip)
