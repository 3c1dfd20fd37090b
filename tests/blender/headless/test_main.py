"""Blender as a process of its own: its lines, its exit codes, what it leaves behind, and the demo scene's views."""

import dataclasses
import os
import re
import resource
import runpy
import signal
import subprocess
import sys

import bpy
import numpy as np
import pytest

from lfsr_core.base.messages import Progress
from lfsr_core.base.records import to_data
from lfsr_core.base.system import write_json
from lfsr_core.exports.light_field import read_views
from lfsr_core.frames.frame import DEVICES, read_frame
from lfsr_core.images import image_files
from lfsr_core.images.image_files import read_layers, read_png
from lfsr_core.pipeline.make import MADE, make, open_blender, render_all
from lfsr_core.process.child import ENDS_WITH_INPUT, EXIT_BAD_INPUT, find_blender, parse_progress, told_of
from tests.support.other_systems import FOLDER, SYSTEMS
from tests.support.processes import run_lfsr, run_script
from tests.support.requests import make_request
from tests.support.scenes import MINI, ROOT, add_box, add_camera, add_lamp, emission, link
from tests.support.told import refuses


@pytest.fixture
def blend(scene, tmp_path):
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5), emission((1, 0.5, 0.2)))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return tmp_path / "scene.blend"


def start(tmp_path, limit=None, ends_with_input=False, **options):
    data = to_data(make_request(str(tmp_path / "out"), MINI, **{"scale": 4, "samples": 2} | options))
    write_json(tmp_path / "job.json", data)
    command = [sys.executable, "-P", ROOT / "blender_addon/headless/from_sources.py", "--", tmp_path / "job.json"]
    smaller = (lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))) if limit else None
    more = {"PYTHONUNBUFFERED": "1"} | ({ENDS_WITH_INPUT: "1"} if ends_with_input else {})
    return subprocess.Popen(command, text=True, stdin=subprocess.PIPE if ends_with_input else None,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=os.environ | more, preexec_fn=smaller)


def records(lines):
    return [record for record in map(parse_progress, lines) if record]


def test_a_scene_that_waits_for_a_library_is_refused(blend, tmp_path):
    library = tmp_path / "library.blend"
    bpy.data.libraries.write(str(library), {bpy.data.objects[0]})
    bpy.context.scene.collection.objects.link(link(library, "objects", [bpy.data.objects[0].name])[0])
    bpy.ops.wm.save_mainfile()
    library.unlink()
    os.mkfifo(library)
    write_json(tmp_path / "job.json", to_data(make_request(str(tmp_path / "out"), MINI, scene=str(blend))))
    program = ("from blender_addon.headless import main\nmain.MOST_WAITING = 2\n"
               f"raise SystemExit(main.main([{str(tmp_path / 'job.json')!r}]))")
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.returncode == EXIT_BAD_INPUT
    assert "waits for a file that does not answer" in records(done.stdout.splitlines())[-1]["message"]


def test_a_render_that_takes_the_memory_ends_in_a_sentence(blend, tmp_path):
    job = to_data(make_request(str(tmp_path / "out"), MINI, scene=str(blend), samples=400000))
    write_json(tmp_path / "job.json", job)
    program = ("from blender_addon.headless import main\nfrom lfsr_core.base import system\n"
               "emit = main.protocol.emit_told\n"
               "def told(what):\n    emit(what)\n    system.MOST_MEMORY = 0 if 'Sample' in str(what) else 9\n"
               "main.protocol.emit_told, system.MOST_MEMORY = told, 9\n"
               f"raise SystemExit(main.main([{str(tmp_path / 'job.json')!r}]))")
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=100)
    assert done.returncode == EXIT_BAD_INPUT
    assert "of this computer's memory: make the scene" in records(done.stdout.splitlines())[-1]["message"]
    assert not list((tmp_path / "out").iterdir())


def test_job_becomes_a_frame_folder(blend, tmp_path):
    child = start(tmp_path, scene=str(blend), layers=("albedo",), seed=3, device="auto")
    emitted = records(child.communicate()[0].splitlines())
    assert child.returncode == 0 and emitted[-1] == {"stage": "done", "folder": str(tmp_path / "out")}
    fractions = [record["fraction"] for record in emitted if record["stage"] == "render"]
    assert fractions and fractions[-1] == 1
    frame = read_frame(tmp_path / "out")
    assert (frame.samples, frame.seed, frame.scale, frame.scene) == (2, 3, 4, "scene.blend")
    assert frame.blender == bpy.app.version_string and set(frame.seconds) == {"open", "render"}
    assert frame.device in DEVICES and frame.layout == (
        "one-pass" if frame.device in ("CPU", "OPTIX") else "lens-card"), "the device decides the layout"
    layers = image_files.read_layers(tmp_path / "out" / "lr_eia.exr")
    assert layers["color"].shape == (24, 32, 4)
    assert layers["color"].reshape(-1, 4)[layers["color"][..., 3].argmax()] == pytest.approx((1, 0.5, 0.2, 1), rel=1e-3)


def test_one_blender_stays_open_for_renders_that_are_asked_for_later(blend, tmp_path):
    told, work = [], tmp_path / "work"
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"  # whatever engine the file was made for
    bpy.ops.wm.save_mainfile()
    with open_blender(find_blender(), work) as render:
        for scale, camera in ((4, None), (2, None), (1, "fit")):
            request = make_request(str(work / f"s{scale}"), MINI, str(blend), scale=scale, samples=1, light="city",
                                   camera=camera)
            render(request, told.append)
            assert read_frame(work / f"s{scale}").scale == scale
        progress = [message for message in told if isinstance(message, Progress)]
        assert [message.stage for message in progress].count("open") == 2, "the scene is kept for one camera"
        assert sum("Loading city" in message.detail for message in progress) == 2, "and so is what Cycles made of it"
        wrong = dataclasses.replace(request, subject="Nowhere", output=str(work / "none"))
        refuses("'Nowhere'", render, wrong, told.append)
    assert sorted(path.name for path in work.iterdir()) == ["s1", "s2", "s4"], "nothing else stays"


def test_what_the_user_must_know_is_said_before_the_render_and_kept_in_the_frame(scene, tmp_path):
    """Strips that are left out, and a wall that hides the subject."""
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5), emission((1, 0.5, 0.2)))
    wall = add_box(scene, (0, -2, 0), (3, 0.1, 3), emission((0.5, 0.5, 0.5)))
    wall.name, background = "Wall", bpy.data.collections.new("Background")
    wall.hide_viewport = True  # renders show it
    scene.collection.children.link(background)
    background.objects.link(wall)
    scene.sequence_editor_create().strips.new_effect("x", "COLOR", 1, frame_start=1, length=10)
    add_camera(scene, (0, -6, 0)).data.dof.use_dof = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "SCENE.BLEND"))
    emitted = records(start(tmp_path, scene=str(tmp_path / "SCENE.BLEND")).communicate()[0].splitlines())
    said = [number for number, record in enumerate(emitted) if "notice" in record]
    renders = [number for number, record in enumerate(emitted) if record["stage"] == "render" and record["fraction"]]
    assert said[-1] < renders[0]
    notes = [told_of(emitted[number]) for number in said]
    assert [note.code for note in notes] == ["focus-ignored", "sequencer-ignored", "array-blind"]
    assert notes[2].values == {"seen": ["Wall"], "place": "hidden"} and read_frame(tmp_path / "out").notes == (*notes,)


def test_bad_input_is_one_sentence_and_that_parts_cannot_be_used_said_before_the_scene_is_opened(blend, tmp_path):
    child = start(tmp_path, scene=str(blend), subject="Nothing")
    *_, last = records(child.communicate()[0].splitlines())
    assert child.returncode == 2
    assert last["stage"] == "error" and "no collection 'Nothing'" in last["message"] and "\n" not in last["message"]
    assert not list((tmp_path / "out").glob("**/*"))
    parts = tmp_path / "parts"
    parts.mkdir()
    (parts / "lr_eia-digest-000000-000002-100.exr").write_bytes(b"")
    write_json(parts / "inputs.json", {"scene file": "another"})
    emitted = records(start(tmp_path, scene=str(blend), parts=str(parts)).communicate()[0].splitlines())
    said = [number for number, record in enumerate(emitted) if record.get("notice") == "parts-removed"]
    assert len(said) == 1 and said[0] < [record["stage"] for record in emitted].index("open")
    assert emitted[said[0]]["values"] == {"input": "settings"} and not parts.exists()


def sampling(tmp_path, blend, **options):
    """A process in the middle of an endless render."""
    child = start(tmp_path, ends_with_input=True, scene=str(blend), samples=100_000, scale=1, **options)
    for line in child.stdout:
        if "Sample" in line:
            return child
    raise AssertionError(child.wait())


@pytest.mark.parametrize("layout", ["one-pass", "view-by-view"])
def test_the_end_of_its_input_stops_it_at_once_and_leaves_no_file(blend, tmp_path, layout):
    child = sampling(tmp_path, blend, layout=layout)
    rest, _ = child.communicate(timeout=20)
    assert child.returncode == 130 and records(rest.splitlines())[-1]["stage"] == "cancelled"
    assert list((tmp_path / "out").iterdir()) == []


def test_what_a_signal_leaves_goes_with_the_next_render(blend, tmp_path):
    child = sampling(tmp_path, blend)
    child.send_signal(signal.SIGTERM)
    assert child.wait(20) == -signal.SIGTERM and start(tmp_path, scene=str(blend)).wait(60) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["frame.json", "lr_eia.exr"]


@pytest.mark.parametrize("options", [{"kind": "reference", "scale": 1, "samples": 2}, {"scale": 1}])
def test_a_file_that_was_cut_short_is_not_published(blend, tmp_path, options):
    child = start(tmp_path, limit=24_576, scene=str(blend), layers=("albedo", "normal", "position"), **options)
    *_, last = records(child.communicate()[0].splitlines())
    assert child.returncode == 2
    assert last["stage"] == "error" and "was not written completely" in last["message"]
    assert not list((tmp_path / "out").glob("*"))


@pytest.fixture
def animated(scene, tmp_path):
    """A box that moves, turns and changes its colour, and a lamp that grows brighter; frame 7 is empty."""
    item = add_box(scene, (0, 0, 0), (0.5, 0.4, 0.3), bpy.data.materials.new("paint"))
    wall, lamp = add_box(scene, (0, 1, 0), (2, 0.1, 2)), add_lamp(scene)
    for frame, amount in ((1, 0.0), (7, 0.8), (9, 1.0)):
        item.location.x, item.rotation_euler.z, lamp.data.energy = amount - 0.5, amount, 100 + 200 * amount
        item.hide_render = wall.hide_render = frame == 7
        for owner, path in ((item, "location"), (item, "rotation_euler"), (lamp.data, "energy"), (item, "hide_render"),
                            (wall, "hide_render")):
            owner.keyframe_insert(path, frame=frame)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return tmp_path / "scene.blend"


@pytest.mark.parametrize("layout", [pytest.param("one-pass", marks=pytest.mark.long), "lens-card"])
def test_frames_of_one_blender_are_those_of_several(animated, tmp_path, layout):
    def job(name, frame):
        return make_request(str(tmp_path / name), MINI, str(animated), scale=2, samples=4, frame=frame, layout=layout,
                   layers=("albedo", "position"))
    rendered, jobs = [], [job(f"{frame:04d}", frame) for frame in (1, 5, 9)]
    render_all(jobs, find_blender(), rendered=rendered.append)
    assert rendered == jobs
    opened = [read_frame(done.output).seconds["open"] for done in jobs]
    assert opened[0] > 0 and opened[1:] == [0, 0]
    left_out, made = make(job('fi"lm', None), None, (7, 9))
    assert "would be rendered" in left_out.error and made.state == MADE
    alone, last = (read_layers(tmp_path / name / "lr_eia.exr") for name in ('fi"lm/0009', "0009"))
    for layer, pixels in alone.items():
        np.testing.assert_array_equal(last[layer], pixels, layer)
    assert np.abs(read_layers(tmp_path / "0001" / "lr_eia.exr")["color"] - last["color"]).mean() > 0.01
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0001", "0005", "0009", 'fi"lm', "scene.blend"]


@pytest.mark.skipif(sys.platform != "linux", reason="the stand-ins are of Linux")
def test_a_render_and_another_into_the_same_folder_as_on_windows(scene, tmp_path):
    folder = tmp_path / FOLDER
    folder.mkdir()
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5), emission((1, 0.5, 0.2)))
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    for seed in (1, 2):
        SYSTEMS[0].lfsr(["render", str(folder / "scene.blend"), "-o", str(folder / "frame"), "--display", "mini",
                         "--scale", "4", "--spp", "1", "--method", "bicubic", "--seed", str(seed)])
        assert read_frame(folder / "frame").seed == seed and read_png(folder / "frame" / "eia.png").any()
    assert sorted(path.name for path in folder.iterdir()) == ["frame", "scene.blend"]


def test_demo_scene_stands_the_right_way_round_and_moves_against_the_eye(tmp_path, monkeypatch):
    for name in ("demo_scene", "unseen_scenes", "textured_scenes", "real_scenes", "deep_scenes"):
        monkeypatch.setattr(sys, "argv", [name, "--no-such", str(tmp_path)])
        with pytest.raises(SystemExit, match="^2$"):
            runpy.run_path(str(ROOT / "scripts" / "lab" / "lfsr_lab" / "scenes" / f"{name}.py"), run_name="__main__")
    assert run_script("demo_scene.py", tmp_path / "demo.blend")[0] == 0
    said = run_lfsr("render", tmp_path / "demo.blend", "-o", tmp_path / "frame", "--display", "small", "--scale", 4,
                    "--spp", 4)
    assert re.search(r"^render +\d+%", said, re.M) and "write      100%" in said
    middle = (views := read_views(tmp_path / "frame").astype(int))[20, 20]
    bluest = (middle[..., 2] - middle[..., 0]).argmax()
    greenest = (2 * middle[..., 1] - middle[..., 0] - middle[..., 2]).argmax()
    rows, columns = np.unravel_index([bluest, greenest], middle.shape[:2])
    assert columns[0] < 8, "the blue cone is on the left"
    assert rows[1] > 8, "the green cube is low"
    assert middle[1:4, 12:19].sum() > 4 * middle[1:4, 3:10].sum(), "the text is at the upper right"

    def column_of_green(view: np.ndarray) -> float:
        green = np.maximum(2 * view[..., 1] - view[..., 0] - view[..., 2] - 40, 0).sum(0)
        return green @ np.arange(len(green)) / green.sum()

    assert column_of_green(views[20, 35]) < column_of_green(views[20, 4]) - 0.5, "near things move left"
