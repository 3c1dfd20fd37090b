"""Whether a folder holds the render of a job, and the one sentence on the first difference."""

import dataclasses
import os

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.folder import (
    RAYS,
    FrameFolder,
    digest,
    first_difference,
    has_other_size,
    is_changed,
    is_of,
    is_same,
    phrases,
    request_facts,
    scene_stamp,
)
from lfsr_core.frames.frame import SUBPIXELS, write_frame
from lfsr_core.frames.request import AUTO
from lfsr_core.optics.rays import CameraArray
from tests.support.panels import cells, hexagonal, lenticular
from tests.support.requests import changed, make_request
from tests.support.synthetic import MINI, frame_of
from tests.support.told import refuses

JOB = make_request(output="film/0001", display=MINI, scale=2, samples=16)
FRAME = frame_of(2)
LENSES = ((0, 0), (1, 1))


@pytest.mark.parametrize(("changes", "sentence"), [
    ({"samples": 4}, "with 16 samples per pixel, but 4 were asked for"),
    ({"scales": (2, 4), "rays": 1.0}, "with 16 samples per pixel, but 4 were asked for"),
    ({"scale": 4, "samples": 4}, "with scale 2, but scale 4 was asked for"),
    ({"display": dataclasses.replace(MINI, name="other")}, "with display mini, but display other was"),
    ({"display": dataclasses.replace(MINI, viewing_angle_deg=33.0)},
     f"with display viewing angle deg {MINI.viewing_angle_deg}, but display viewing angle deg 33.0 was"),
    ({"convention": "paper"}, "with convention centred, but convention paper was"),
    ({"layout": "view-by-view"}, "with layout one-pass, but layout view-by-view was"),
    ({"lens_list": LENSES}, "with all lenses, but 2 lenses were"),
    ({"rows": (1, 3)}, "with all rows, but rows 1-3 were"),
    ({"view_aperture": 0.5}, "with view aperture 1.0, but view aperture 0.5 was"),
    ({"seed": 9}, "with seed 0, but seed 9 was"),
    ({"frame": 2}, "with frame number 1, but frame number 2 was"),
    ({"subject": "Things"}, "with no subject, but subject Things was"),
    ({"camera": "Left"}, "with no camera, but camera Left was"),
    ({"device": "OPTIX"}, "with device CPU, but device OPTIX was"),
    ({"world_visible": True}, "with no visible world, but visible world was"),
    ({"layers": ("albedo", "normal")}, "with no layers, but layers albedo, normal were")])
def test_the_first_difference_is_one_sentence(tmp_path, changes, sentence):
    job = changed(JOB, **changes)
    write_frame(tmp_path, FRAME)
    with pytest.raises(LfsrError) as caught:
        FrameFolder(tmp_path).check_rendered(job, advice="give --overwrite")
    assert sentence in str(caught.value) and str(caught.value).endswith(" asked for: give --overwrite")
    assert is_same(FRAME, job) is (set(changes) == {"device"} or changes.get("layout") == "view-by-view")
    if set(changes) & {"seed", "frame", "subject", "device", "layers"}:
        FrameFolder(tmp_path).check_rendered(job, names=RAYS)  # its rays are those


@pytest.mark.parametrize(("changes", "found"), [
    ({"device": AUTO}, {"device": "OPTIX"}),
    ({"layers": ("normal",)}, {"layers": ("albedo", "normal")}),
    ({"scales": (2, 4), "scale": 4}, {}),
    ({"scales": (2, 4), "scale": 4, "rays": 16.0}, {"samples": 64}),
    ({}, {"layout": "lens-card"}),
    ({}, {"world_visible": True}),
    ({}, {"light": "city"}),
    ({"light": "night"}, {"light": ""}),  # an older frame does not know
    ({"kind": "reference", "scale": 1}, {"scale": 1, "samples": 500, "lens_list": LENSES})])
def test_what_a_job_leaves_open_may_be_anything(changes, found):
    assert is_same(dataclasses.replace(FRAME, **found), changed(JOB, **changes))


def test_another_light_is_another_render_and_a_changed_file_told(tmp_path):
    write_frame(tmp_path, dataclasses.replace(FRAME, light="own"))
    with pytest.raises(LfsrError, match="with light own, but light night was asked for"):
        FrameFolder(tmp_path).check_rendered(changed(JOB, light="night"))
    write_frame(tmp_path, dataclasses.replace(FRAME, scene="a.blend", content="2 10; 7 10"))
    FrameFolder(tmp_path).check_rendered(JOB)
    with pytest.raises(LfsrError, match="was rendered before a.blend was changed: choose another folder"):
        FrameFolder(tmp_path).check_rendered(JOB, "2 11; 7 10")
    write_frame(tmp_path, FRAME)
    FrameFolder(tmp_path).check_rendered(JOB, "2 11; 7 10")


def test_a_light_field_is_no_render_of_subpixels():
    display = lenticular()
    frame, job = frame_of(1, display), changed(JOB, display=display, scale=1, device="OPTIX")
    assert is_same(frame, changed(job, layout="lens-card"))
    assert not is_same(dataclasses.replace(frame, layout=SUBPIXELS), job)
    assert not is_same(frame, changed(job, layout=SUBPIXELS))
    moved = changed(JOB, output="elsewhere", parts="p", world="w")
    assert digest(request_facts(JOB)) == digest(request_facts(moved))
    assert digest(request_facts(JOB)) != digest(request_facts(changed(JOB, seed=1)))


def test_a_scene_is_known_by_size_and_time_of_its_files(tmp_path):
    for name in ("a.gltf", "a.blend", "notes.txt"):
        (tmp_path / name).write_text(name)
    gltf, blend = scene_stamp(tmp_path / "a.gltf"), scene_stamp(tmp_path / "a.blend")
    assert not is_changed(gltf, scene_stamp(tmp_path / "a.gltf")) and not is_changed(gltf, "")
    (tmp_path / "a.bin").write_bytes(b"1")
    with_bin = scene_stamp(tmp_path / "a.gltf")
    assert is_changed(gltf, with_bin) and scene_stamp(tmp_path / "a.blend") == blend
    os.utime(tmp_path / "a.bin", ns=(1, 1))
    assert is_changed(with_bin, other_time := scene_stamp(tmp_path / "a.gltf"))
    assert not has_other_size(with_bin, other_time), "a copy on another machine"
    assert has_other_size(with_bin, gltf) and not has_other_size(with_bin, "")
    refuses("b.blend", scene_stamp, tmp_path / "b.blend")


def test_of_records_and_tuples_the_part_that_differs_is_shown():
    other = dataclasses.replace(FRAME, array=CameraArray.for_display(MINI, 9), clip=(0.5, 9.0))
    assert first_difference(vars(FRAME), vars(other)) == "array"
    here, there = phrases("array", FRAME.array, other.array)
    assert here.startswith("array ") and here.split()[:-1] == there.split()[:-1]
    assert phrases("clip", (0.1, 9.0), other.clip) == ("clip 0 0.1", "clip 0 0.5")
    assert phrases("clip", None, other.clip) == ("no clip", "clip (0.5, 9.0)")
    assert phrases("lens_list", LENSES, LENSES[::-1]) == ("other 2 lenses", "2 lenses")
    assert first_difference(vars(FRAME), vars(FRAME)) == ""


def test_of_displays_that_differ_the_field_is_named_and_no_record_printed():
    stripes, device = lenticular(), cells()
    assert phrases("display", stripes, device) == ("no display subpixels", "display subpixels")
    other = dataclasses.replace(device, lenticular=dataclasses.replace(device.lenticular, flip=(True, False)))
    assert phrases("display", device, other) == ("no display lenticular flip 0", "display lenticular flip 0")
    sheet = dataclasses.replace(hexagonal(), lenses=stripes.lenses, views=stripes.views)
    assert phrases("display", stripes, sheet) == ("no display lenslet", "display lenslet")


@pytest.mark.parametrize(("frame", "job", "own"), [
    ({"source": "../shot.blend"}, {"source": "../shot.blend"}, True),
    ({"source": "../shot.blend"}, {"source": "../other/shot.blend"}, False),
    ({"source": "../shot.blend"}, {}, True),  # a command knows no source
    ({"scene": "shot.blend"}, {"source": "../shot.blend"}, True),
    ({"scene": "shot.farm.blend"}, {"source": "../shot.blend"}, True),
    ({"scene": "shot.blend"}, {"source": "../other.blend"}, False),
    ({}, {"source": "../shot.blend"}, True),
    ({"scene_name": "Set"}, {"scene_name": "Set"}, True),
    ({"scene_name": "Set"}, {"scene_name": "Other"}, False),
    ({"scene_name": "Set"}, {}, True),
    ({}, {"scene_name": "Set"}, True)])
def test_frames_of_another_file_or_scene_are_other_renders(frame, job, own):
    found, wanted = dataclasses.replace(FRAME, **frame), changed(JOB, **job)
    assert is_same(found, wanted) is own
    assert is_of(found, wanted.source, wanted.scene_name or "") is own
