"""Whether a folder holds the render of a job, and the one sentence on the first difference."""

import dataclasses
import itertools
import json
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.base.records import from_data, to_data, write_record
from lfsr_core.frames import folder
from lfsr_core.frames import frame as records
from lfsr_core.frames.folder import FrameFolder, has_other_size, is_changed, is_same, phrases, scene_stamp
from lfsr_core.frames.frame import Finish, Report, check_light, check_scene, parse_frames, read_request, write_frame
from lfsr_core.optics.depth_scale import ScaleChoice
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
    ({"scales": (2, 4), "rays": 0.75}, "with 16 samples per pixel, but 3 were asked for"),
    ({"scale": 4, "samples": 4}, "with scale 2, but scale 4 was asked for"),
    ({"display": dataclasses.replace(MINI, name="other")}, "with display mini, but display other was"),
    ({"display": dataclasses.replace(MINI, viewing_angle_deg=33.0)},
     f"with display viewing angle deg {MINI.viewing_angle_deg}, but display viewing angle deg 33.0 was"),
    ({"convention": "paper"}, "with convention centred, but convention paper was"),
    ({"layout": "view-by-view"}, "with layout one-pass, but layout view-by-view was"),
    ({"lens_list": LENSES}, "with all lenses, but 2 lenses were"),
    ({"rows": (1, 3)}, "with all rows, but rows 1-3 were"),
    ({"view_aperture": 0.5}, "with view aperture 1.0, but view aperture 0.5 was"),
    ({"seed": 9}, "with seed 0, but seed 9 was"), ({"frame": 2}, "with frame number 1, but frame number 2 was"),
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
        rays = ("display", "convention", "layout", "lens_list", "rows", "scale", "samples")
        FrameFolder(tmp_path).check_rendered(job, names=rays)


@pytest.mark.parametrize(("changes", "stored"), [
    ({"device": records.AUTO}, {"device": "OPTIX"}), ({"layers": ("normal",)}, {"layers": ("albedo", "normal")}),
    ({"scales": (2, 4), "scale": 4}, {}), ({"scales": (2, 4), "scale": 4, "rays": 16.0}, {"samples": 64}),
    ({}, {"layout": "lens-card"}), ({}, {"world_visible": True}),
    ({}, {"light": "city"}),
    ({"light": "night"}, {"light": ""}),  # an older frame does not know
    ({"kind": "reference", "scale": 1}, {"scale": 1, "samples": 500, "lens_list": LENSES})])
def test_what_a_job_leaves_open_may_be_anything(changes, stored):
    assert is_same(dataclasses.replace(FRAME, **stored), changed(JOB, **changes))


def test_another_light_and_subpixels_are_other_renders_and_a_changed_file_told(tmp_path):
    write_frame(tmp_path, dataclasses.replace(FRAME, light="own"))
    with pytest.raises(LfsrError, match="with light own, but light night was asked for"):
        FrameFolder(tmp_path).check_rendered(changed(JOB, light="night"))
    write_frame(tmp_path, dataclasses.replace(FRAME, scene="a.blend", content="2 10; 7 10"))
    FrameFolder(tmp_path).check_rendered(JOB)
    with pytest.raises(LfsrError, match="was rendered before a.blend was changed: choose another folder"):
        FrameFolder(tmp_path).check_rendered(JOB, "2 11; 7 10")
    write_frame(tmp_path, FRAME)
    FrameFolder(tmp_path).check_rendered(JOB, "2 11; 7 10")
    display = lenticular()
    frame, job = frame_of(1, display), changed(JOB, display=display, scale=1, device="OPTIX")
    assert is_same(frame, changed(job, layout="lens-card"))
    assert not is_same(dataclasses.replace(frame, layout=records.SUBPIXELS), job)
    assert not is_same(frame, changed(job, layout=records.SUBPIXELS))
    moved = changed(JOB, output="elsewhere", parts="p", world="w")
    assert folder.digest(folder.request_facts(JOB)) == folder.digest(folder.request_facts(moved))
    assert folder.digest(folder.request_facts(JOB)) != folder.digest(folder.request_facts(changed(JOB, seed=1)))


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


def test_of_what_differs_the_part_or_the_field_is_shown_and_no_record_printed():
    other = dataclasses.replace(FRAME, array=CameraArray.for_display(MINI, 9))
    assert folder.first_difference(vars(FRAME), vars(other)) == "array"
    here, there = phrases("array", FRAME.array, other.array)
    assert here.startswith("array ") and here.split()[:-1] == there.split()[:-1]
    assert phrases("array clip", None, (0.5, 9.0)) == ("no array clip", "array clip (0.5, 9.0)")
    assert phrases("lens_list", LENSES, LENSES[::-1]) == ("other 2 lenses", "2 lenses")
    assert folder.first_difference(vars(FRAME), vars(FRAME)) == ""
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
    ({"scene": "shot.blend"}, {"source": "../other.blend"}, False), ({}, {"source": "../shot.blend"}, True),
    ({"scene_name": "Set"}, {"scene_name": "Set"}, True), ({"scene_name": "Set"}, {"scene_name": "Other"}, False),
    ({"scene_name": "Set"}, {}, True), ({}, {"scene_name": "Set"}, True)])
def test_frames_of_another_file_or_scene_are_other_renders(frame, job, own):
    stored, wanted = dataclasses.replace(FRAME, **frame), changed(JOB, **job)
    assert is_same(stored, wanted) is own and folder.is_of(stored, wanted.source, wanted.scene_name or "") is own


DEEP = Notice("scale-unseen", {"scale": 2})

FULL = make_request("out", MINI, scene="s.blend", kind="reference", scale=2, samples=9, layers=("albedo",),
                    layout="view-by-view", convention="paper", view_aperture=0.5, seed=5, frame=3, subject="Things",
                    lens_list=((1, 2), (3, 4)), device="OPTIX", clamp_indirect=0.0, world_visible=True,
                    scene_name="Set", first_view="first.npy", parts="kept", source="../shot.blend", camera="Camera",
                    scales=(4, 2), frames=(1, 9), rays=2.5, reason=DEEP, world="world.exr", light="night",
                    allow_missing=True, calm=0.02)


@pytest.mark.skipif(os.sep == "\\", reason="it separates folders there")
@pytest.mark.parametrize("output", ["a\\b", "/tmp/back\\slash/frame"])
def test_a_backslash_is_refused_because_blender_takes_it_for_a_slash(output):
    refuses("output .* has a backslash, which Blender takes for a slash: choose another", make_request, output, MINI)


def test_json_round_trip_keeps_every_field_and_a_bad_job_file_is_named(tmp_path):
    plain = make_request("out", MINI)
    same = {key for key, value in to_data(plain).items() if to_data(FULL)[key] == value}
    assert same == {"output", "display", "rows"}, "a field left at its default could be lost unnoticed"
    for job in (FULL, plain, make_request("out", MINI, rows=(2, 5))):
        write_record(tmp_path / "job.json", job)
        assert read_request(tmp_path / "job.json") == job
    (tmp_path / "job.json").write_text(json.dumps(to_data(FULL) | {"sed": 3}))
    refuses("job.json: unknown field 'sed'", read_request, tmp_path / "job.json")
    (tmp_path / "job.json").write_text("[]")
    refuses("it is .., but it must be an object", read_request, tmp_path / "job.json")


@pytest.mark.parametrize(("options", "message"), [({"scale": 3}, "scale is 3"), ({"scale": 2.0}, "scale is 2.0"),
    ({"samples": 2**24 + 1}, "samples per pixel is 16777217"), ({"seed": 2**31}, "seed is 2147483648"),
    ({"seed": -(10**400)}, "seed is -1000"), ({"frame": 10**9}, "frame is 1000000000"),
    ({"frames": (1, 10**9)}, "frame is 1000000000"), ({"rays": -2.0}, "rays per finished pixel are -2"),
    ({"clamp_indirect": -1.0}, "clamp indirect is -1.0"), ({"samples": 0}, "samples per pixel is 0"),
    ({"samples": 1.5}, "samples per pixel is 1.5"),
    ({"samples": 1, "kind": "reference", "scale": 1}, "samples per pixel is 1"),
    ({"layout": "viewbyview"}, "'view-by-view'"),
    ({"convention": "old"}, "convention is 'old': It must be one of centred, paper"),
    ({"kind": "film"}, "kind is 'film'"), ({"layers": ("albedo", "norma")}, "'normal'"),
    ({"light": "nihgt"}, "'night'"),
    ({"layers": ("denoised",)}, "layer is 'denoised': It must be one of albedo, normal, position, index"),
    ({"view_aperture": -0.1}, "view aperture is -0.1"), ({"view_aperture": float("nan")}, "view aperture is nan"),
    ({"rows": (0, 3)}, "rows are 0-3"),
    ({"rows": (2, 2), "layout": "view-by-view"}, "rows 2 were asked for, but the layout view-by-view is not"),
    ({"rows": (1, 5), "lens_list": ((1, 2),)}, "but a list of lenses is not")])
def test_bad_value_is_named(options, message):
    refuses(message, make_request, "out", MINI, **options)


def test_samples_follow_from_the_rays_and_a_noisy_scene_takes_more_of_the_same_render():
    job = make_request("out", MINI, scale=4, samples=5, scales=(4, 2, 1), frames=(1,))
    assert job.with_scale(ScaleChoice(2, DEEP)) == make_request("out", MINI, scale=2, samples=5, reason=DEEP)
    assert job.judged_rays == 5 / 16
    by_rays = job.sampled(rays=4.0)
    assert [by_rays.with_scale(ScaleChoice(scale)).sampling.samples for scale in job.sampling.scales] == [64, 16, 4]
    assert by_rays.judged_rays == 4
    usual = job.sampled(rays=records.usual_rays(MINI))
    assert [records.more_rays(usual, noise) for noise in (0.0, 0.039, 0.05, 0.07, 1.0)] == [1, 1, 2, 4, 4]
    bare = dataclasses.replace(usual, calm=records.CALM / 2)
    assert [records.more_rays(bare, noise) for noise in (0.0, 0.019, 0.039, 0.05, 1.0)] == [1, 1, 4, 8, 16]
    assert [records.more_rays(usual.sampled(rays=usual.sampling.rays * times), 0.07)
            for times in (0.25, 1, 2, 4)] == [1, 4, 2, 1] and records.more_rays(usual.sampled(rays=None), 1.0) == 1
    job = make_request("out", MINI, scale=4, scales=(4, 2)).sampled(rays=1.0)
    for samples, same in ((16, True), (32, True), (64, True), (48, False), (8, False)):
        frame = dataclasses.replace(FRAME, scale=4, samples=samples)
        assert (folder.wanted_facts(job, frame)["samples"] == samples) == same


def test_scene_and_light_are_checked_before_blender_starts(tmp_path, monkeypatch):
    (tmp_path / "c0ffee").touch()  # in a store of files by their content, as of DVC
    (tmp_path / "scene.GLB").symlink_to("c0ffee")
    assert check_scene(tmp_path / "scene.GLB") == str(tmp_path / "scene.GLB")
    refuses(r"absent.blend does not exist", check_scene, tmp_path / "absent.blend")
    refuses(r"scene \S+ is no file: check the path", check_scene, tmp_path)
    (tmp_path / "scene.fbx").touch()
    refuses(r"scene.fbx is not a scene file.*\.blend, \.glb", check_scene, tmp_path / "scene.fbx")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "Sky.HDR").symlink_to("c0ffee")
    (tmp_path / "a.hdr").mkdir()
    assert check_light("even") == "even" and check_light("Sky.HDR") == str(tmp_path / "Sky.HDR")
    assert records.light_parts(check_light("city:.5")) == ("city", 0.5) and records.light_parts("night") == ("night", 1)
    for light, sentence in (("sky.exr", "sky.exr does not exist"), ("a.hdr", "a.hdr is no file"),
                            ("sky", "light is 'sky'"), ("city:0", "is 'city:0'"), ("even:2", "even:2")):
        refuses(sentence, check_light, light)


def test_a_finish_and_a_report_are_read_as_they_were_written(tmp_path):
    finish = Finish("bicubic", 2, "weights.tza", True, 1)
    assert from_data(Finish, to_data(finish), "finish") == finish and Finish.of("bicubic") == Finish("bicubic")
    for options in [{"dilate": -1}, *({"temporal_averaging": count}
                                      for count in (-1, records.MOST_AVERAGED + 1, 10**400))]:
        refuses("", Finish, "bicubic", **options)
    report = Report(Finish("bicubic", temporal_averaging=2), "bicubic", "mini", 2, 16, {"render": 1.0}, None, 0.5,
                    (Notice("scale-unseen", {"scale": 2}),), metrics={"p": 0.5})
    records.write_report(tmp_path, report)
    assert records.read_report(tmp_path) == report
    data = json.loads((tmp_path / "report.json").read_text())
    assert (data["foreground_fraction"], data["finish"]["temporal_averaging"]) == (0.5, 2)


@pytest.mark.parametrize("count", range(records.MOST_AVERAGED + 1))
def test_frames_that_are_averaged_have_each_seed_once(count):
    finish, across = Finish("bicubic", temporal_averaging=count), 2 * count + 1
    for first in (-3, 1, 40):
        assert sorted(finish.seeds_of(5, range(first, first + across)).values()) == list(range(5, 5 + across))
    for frames in (range(1, 48, 3), range(1, 200, across), (1, 4, 7, 8, 9, 12, 27, 45)):
        seeds = [*finish.seeds_of(5, frames).values()]
        assert all(len({*seeds[at:at + across]}) == across for at in range(len(frames) - across + 1))
    assert 0 <= finish.seeds_of(2**31 - 1, [2])[2] < 2**31


@pytest.mark.parametrize(("text", "frames"), [
    ("1-4", (1, 2, 3, 4)), ("1-9x4", (1, 5, 9)), ("1-10x4", (1, 5, 9)), ("1-9:4", (1, 5, 9)), ("7", (7,)),
    ("9, 1,5-6,5", (9, 1, 5, 6)), ("-3--1", (-3, -2, -1)), ("-1-1", (-1, 0, 1)), ("0", (0,))])
def test_frames_are_read(text, frames):
    assert parse_frames(text) == frames


@pytest.mark.parametrize("text", ["", "a", "4-1", "1-4x0", "1-", "1-2-3", "1,,2", "1-99999999", "0-1000000", "9" * 99])
def test_what_is_no_frames_is_refused(text):
    refuses("frames ", parse_frames, text)


@given(st.lists(st.integers(), unique=True, max_size=30), st.integers(1, 9))
def test_a_few_are_spread_over_all(frames, most):
    few = records.spread(frames, most)
    assert len(few) == min(len(frames), most) and set(few) <= set(frames)
    assert most < 2 or not frames or (few[0], few[-1]) == (frames[0], frames[-1])
    steps = [frames.index(second) - frames.index(first) for first, second in itertools.pairwise(few)]
    assert not steps or max(steps) - min(steps) <= 1
