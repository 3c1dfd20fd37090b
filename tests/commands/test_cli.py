"""Every verb from its arguments to its files, with Blender played by a script that copies a folder."""

import errno
import importlib.metadata
import io
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lfsr_core.cli import BOLD, GROUPS, LABORATORY, VERBS, build_parser, main, styled
from lfsr_core.exports.light_field import read_light_field
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.image_files import read_png
from lfsr_core.optics.display import builtin_names
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from tests.support.finished import finished
from tests.support.noisy_renders import UNSEEN
from tests.support.played_blender import ROOT
from tests.support.synthetic import fails, light_field, write_render


def jobs(blender: str) -> list[dict]:
    return [json.loads(line) for line in Path(blender + ".jobs").read_text().splitlines()]


def test_every_verb_has_help_that_loads_no_numpy(capsys):
    for name, (_, text) in VERBS.items():
        with pytest.raises(SystemExit) as caught:
            main([name, "--help"])
        assert caught.value.code == 0 and text.split()[0] in capsys.readouterr().out
    told = subprocess.run([LFSR[0], "-X", "importtime", *LFSR[1:], "--help"], capture_output=True, text=True, cwd=ROOT,
                          check=True).stderr
    assert "argparse" in told and "numpy" not in told


def test_lfsr_alone_and_displays_show_what_there_is(capsys):
    assert main([]) == 0
    shown = capsys.readouterr().out
    assert "\x1b" not in shown, "no terminal, no colour"
    for title, example, verbs in GROUPS:
        build_parser().parse_args(example.split()[1:])
        assert f"{title}:  {example}\n" + "".join(f"  {name:10} {text}\n" for name, (_, text) in verbs.items()) in shown
    assert main(["displays"]) == 0
    listed = capsys.readouterr().out
    assert [line.split()[0] for line in listed.splitlines()] == builtin_names()
    assert "7680×4320 px, 96×54 lenses of 80×80 views" in listed and main(["displays", "bupt-32in-8k"]) == 0
    shown = capsys.readouterr().out
    for number in ("96×54 = 5184", "7.379 × 7.379 mm", "9.099 mm", "0.521°", "2, 4, 5, 8, 10",
                   "168.6 mm in front, 254.3 mm behind"):
        assert number in shown


@pytest.mark.parametrize(("variables", "is_styled"), [({}, True), ({"NO_COLOR": "1"}, False),
                                                      ({"TERM": "dumb"}, False)])
def test_terminals_show_colours_unless_they_shall_not(monkeypatch, variables, is_styled):
    for name, value in {"NO_COLOR": "", "TERM": "xterm", **variables}.items():
        monkeypatch.setenv(name, value)
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True, raising=False)
    assert styled("lfsr", BOLD, terminal) == ("\x1b[1mlfsr\x1b[0m" if is_styled else "lfsr")
    assert styled("lfsr", BOLD, io.StringIO()) == "lfsr"


def test_json_is_one_object_and_quiet_prints_nothing(scene, blender, tmp_path, capsys):
    def said(*words, code=0):
        assert main([str(word) for word in words]) == code
        return capsys.readouterr()

    frame, display = tmp_path / "frame", ("--display", "mini", "--blender", blender)
    rendered = said("render", scene, "-o", frame, *display, "--scale", 2, "--method", "bicubic", "--json")
    data = json.loads(rendered.out)
    assert data["made"][0]["folder"] == str(frame) and data["report"]["method"] == "bicubic"
    assert "eia.png" in rendered.err
    assert json.loads(said("upscale", frame, "--method", "nearest", "--json").out)["image"] == str(frame / "eia.png")
    assert [Path(name).is_file() for name in json.loads(said("views", frame, "--json").out)["files"]] != []
    assert Path(json.loads(said("view", frame, "--json").out)["path"]).is_file()
    assert json.loads(said("export", frame, "--format", "stereo", "--json").out)["files"]
    assert {one["name"] for one in json.loads(said("displays", "--json").out)["displays"]} == {*builtin_names()}
    assert f"openjd run '{tmp_path}/a job.yaml'" in said("farm", "openjd", "-o", tmp_path / "a job.yaml", "--json").err
    for words in (("view", frame, "-o", frame / "eia.png"), ("farm", "openjd", "-o", scene)):
        assert "was given: give" in json.loads(said(*words, "--json", code=2).out)["error"]
    refused = said("displays", "minni", "--json", code=2)
    assert "did you mean 'mini'" in json.loads(refused.out)["error"] and "did you mean 'mini'" in refused.err
    for words in (("views", frame), ("displays", "mini"),
                  ("render", scene, "-o", frame, *display, "--scale", 2, "--method", "bicubic")):
        assert said(*words, "--quiet") == ("", "") and json.loads(said(*words, "--quiet", "--json").out)


def test_a_check_renders_a_reference_and_puts_ssim_with_its_interval_into_the_report(scene, blender, tmp_path, capsys):
    frame = tmp_path / "frame"
    command = ["render", scene, "-o", str(frame), "--display", "mini", "--scale", "2", "--method", "bicubic",
               "--blender", blender, "--check"]
    assert main([*command, "12"]) == 0 and "ssim_lens_fg" in capsys.readouterr().out
    metrics = json.loads((frame / "report.json").read_text())["metrics"]
    assert metrics["lenses"] == 12 and metrics["ci95"]["ssim_lens"] > 0
    reference = jobs(blender)[-1]
    assert (reference["kind"], reference["sampling"]["samples"], len(reference["lens_list"])) == ("reference", 1024, 12)
    assert (tmp_path / "frame_reference" / "frame.json").is_file()
    for extra, said in ((["0"], "from 1 to"), (["6", "--rows", "1-2"], "leave out one"), (["6", "--frames", "1,2"],
                                                                                        "leave out one")):
        assert said in fails([*command, *extra], capsys)


def test_shells_complete_verbs_and_options(tmp_path):
    """argcomplete's own protocol: what a shell sends, and the words it gets on file descriptor 8."""
    line = "lfsr render --dis"
    code = ("import os, sys; os.dup2(os.open(sys.argv.pop(), os.O_WRONLY | os.O_CREAT), 8); "
            "from lfsr_core.cli import main; main(['render', '--dis'])")
    variables = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "COMP_LINE": line, "COMP_POINT": str(len(line)),
                 "_ARGCOMPLETE_SUPPRESS_SPACE": "1"}
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "words")], cwd=ROOT, env=os.environ | variables,
                   check=False)
    assert (tmp_path / "words").read_text().split() == ["--display"]


@pytest.mark.parametrize("words", [
    "rendr x.blend", "views", "views x --eye 1,2", "render x.glb -o x --scale some", "plan x.glb --scales two",
    "export x", "export x --format quitl", "export x --format quilt --grid 8by6", "plan x --json x.json", "study x"])
def test_a_wrong_command_line_is_one_sentence_also_as_json(words, capsys):
    said = fails(words.replace(" --json", "").split(), capsys)
    assert said and ("'rendr': did you mean 'render'?" in said) == ("rendr " in words)
    assert main([*words.split(), "--json"]) == 2 and json.loads(capsys.readouterr().out)["error"] in said


def test_render_goes_all_the_way(scene, blender, tmp_path, capsys):
    folder = tmp_path / "frame"
    assert main(["render", scene, "-o", str(folder), "--display", "mini", "--scale", "2", "--spp", "3", "--method",
                 "bicubic", "--seed", "7", "--layers", "position,index", "--subject", "Things", "--frame", "4",
                 "--layout", "lens-card", "--view-aperture", "0.5", "--light", "night",
                 "--no-world-visible", "--linear-exr", "--blender", blender]) == 0
    assert sorted(path.name for path in folder.iterdir()) == [
        "eia.exr", "eia.png", "frame.json", "lr_eia.exr", "mask.png", "report.json"]
    assert str(folder / "eia.png") in capsys.readouterr().out
    (job,) = jobs(blender)
    expected = {"scene": scene, "kind": "render", "seed": 7, "layers": ["position", "index"], "subject": "Things",
                "frame": 4, "layout": "lens-card", "convention": "centred", "view_aperture": 0.5,
                "world_visible": False, "light": "night", "lens_list": None, "clamp_indirect": None}
    assert {key: job[key] for key in expected} == expected
    assert (job["sampling"]["scale"], job["sampling"]["samples"]) == (2, 3)
    assert read_png(folder / "eia.png").shape == (96, 128, 3)


def test_an_image_without_foreground_is_no_success(scene, blender, tmp_path, capsys):
    command = ["render", scene, "-o", str(tmp_path / "frame"), "--display", "mini", "--scale", "2", "--method",
               "bicubic", "--subject", UNSEEN, "--blender", blender]
    assert main(command) == 2
    assert re.search("render: no lens sees the subject: no object is in sight.*--allow-empty", capsys.readouterr().err)
    assert (tmp_path / "frame" / "eia.png").is_file(), "it may be what was wanted"
    assert main([*command, "--allow-empty"]) == 0 and "no lens sees the subject" in capsys.readouterr().err


def test_render_defaults_and_frames_whose_depth_decides(scene, blender, tmp_path):
    assert main(["render", scene, "-o", str(tmp_path / "frame"), "--display", "mini", "--blender", blender]) == 0
    (job,) = jobs(blender)
    assert (job["layers"], job["frame"]) == ([], None)
    assert job["sampling"] == {"scale": 2, "samples": 4, "scales": [2, 1], "rays": 1, "frames": [], "reason": None}
    assert json.loads((tmp_path / "frame" / "report.json").read_text())["method"] == DEFAULT_METHOD
    assert main(["render", scene, "-o", str(tmp_path / "seventh"), "--display", "mini", "--blender", blender,
                 "--frame", "7", "--scale-frames", "1-9:2", "--layers", "none"]) == 0
    assert (jobs(blender)[1]["sampling"]["frames"], jobs(blender)[1]["layers"]) == ([1, 3, 5, 7, 9], [])


@pytest.mark.parametrize(("arguments", "expected"), [
    (["--scale", "4"], (4, 16, [], None)), (["--scale", "4", "--rays", "0.25"], (4, 4, [], None)),
    (["--scale", "1", "--rays", "3.4"], (1, 3, [], None)), (["--scale", "2", "--spp", "7"], (2, 7, [], None)),
    (["--rays", "4"], (2, 16, [2, 1], 4)), (["--spp", "64"], (2, 64, [2, 1], None))])
def test_rays_are_per_finished_pixel_and_samples_per_rendered_pixel(scene, blender, tmp_path, arguments, expected):
    assert main(["render", scene, "-o", str(tmp_path / "frame"), "--display", "mini", "--method", "bilinear",
                 "--blender", blender, *arguments]) == 0
    (job,) = jobs(blender)
    sampling = job["sampling"]
    assert (sampling["scale"], sampling["samples"], sampling["scales"], sampling["rays"]) == expected
    assert job["layers"] == [], "the method looks at none"


@pytest.mark.parametrize(("options", "message"), [(["--method", "bicubik"], "'bicubic'"),
    (["--scale", "3"], "scale is 3"), (["--spp", "4", "--rays", "2"], "--rays 2 and --spp 4 were both given"),
    (["--rays", "0"], "rays per finished pixel are 0"), (["--spp", "0"], "samples per pixel is 0"),
    (["--scale-frames", "9-1"], "frames are 9-1"), (["--frames", "1-2", "--scale-frames", ""], "frames are ''"),
    (["--frames", "1-2", "--cluster", ""], "scheduler is empty"), (["--layers", "albdo"], "'albedo'"),
    (["--light", "gone.exr"], "gone.exr does not exist"), (["--display", "mimi"], "'mini'"),
    (["--dilate", str(2**32)], "dilation of the foreground mask is 4294967296"),
    (["--seed", str(10**400)], "seed is 1000"), (["--blender", "/no/blender"], "'/no/blender' was not found")])
def test_bad_option_is_refused_before_blender_starts(scene, blender, tmp_path, capsys, options, message):
    arguments = ["render", scene, "-o", str(tmp_path / "frame"), "--display", "mini", "--blender", blender, *options]
    assert message in fails(arguments, capsys)
    for verb in ("render", "reference"):
        arguments = [verb, str(tmp_path / "no.blend"), "-o", str(tmp_path / "frame"), "--blender", blender]
        assert "no.blend does not exist: check the path" in fails(arguments, capsys)
    assert not (tmp_path / "frame").exists() and not Path(blender + ".jobs").exists()


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_an_output_that_lacks_letters_is_no_error(encoding):
    code = ("from lfsr_core.cli import main\nfor words in (['displays'], ['displays', 'bupt-32in-8k']):\n"
            "    assert main(words) == 0\nmain(['render', '--help'])")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, cwd=ROOT,
                          env=os.environ | {"PYTHONIOENCODING": encoding})
    assert done.returncode == 0 and "bupt-32in-8k" in (said := done.stdout.decode(encoding)) and "--spp" in said, done


def test_who_reads_a_part_of_the_output_has_enough(monkeypatch, capsys):
    class Closed(io.StringIO):
        def write(self, _text):
            raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    monkeypatch.setattr(sys, "stdout", Closed())
    assert main(["displays"]) == 141 and capsys.readouterr().err == ""


@pytest.mark.parametrize("inside", [
    "Late()\n    time.sleep(20)",  # in a finalizer, where Python swallows it
    "try:\n        signal.raise_signal(signal.SIGINT)\n    except KeyboardInterrupt:\n"
    "        raise ImportError('initialization failed')"])  # in a module of C++ that is loaded
def test_an_interrupt_is_not_lost(inside):
    code = ("import gc, signal, sys, time\nfrom lfsr_core import cli\n"
            "class Late:\n    def __del__(self):\n        signal.raise_signal(signal.SIGTERM)\n        time.sleep(0)\n"
            f"def run(arguments):\n    {inside}\nparser = cli.build_parser\n"
            "def build(given):\n    made = parser(given)\n    old = made.parse_args\n"
            "    def parse(words):\n        parsed = old(words)\n        parsed.run = run\n        return parsed\n"
            "    made.parse_args = parse\n    return made\n"
            "cli.build_parser = build\nsys.exit(cli.main(['displays']))\n")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=15)
    assert done.returncode == 130 and "interrupted" in done.stderr, done.stderr


def test_reference_of_all_lenses_and_of_too_many(scene, blender, tmp_path, capsys):
    folder = tmp_path / "reference"
    assert main(["reference", scene, "-o", str(folder), "--display", "mini", "--blender", blender]) == 0
    (job,) = jobs(blender)
    assert (job["kind"], job["clamp_indirect"]) == ("reference", 0)
    assert (job["sampling"]["scale"], job["sampling"]["samples"]) == (1, 1024)
    assert "192 lenses, two halves of 512 samples" in capsys.readouterr().out
    assert sorted(path.name for path in folder.iterdir()) == ["frame.json", "reference_a.exr", "reference_b.exr"]
    main(["reference", scene, "-o", str(tmp_path / "third"), "--display", "mini", "--spp", "3", "--blender", blender])
    assert "two halves of 1 and 2 samples" in capsys.readouterr().out
    assert main(["reference", scene, "-o", str(tmp_path / "another"), "--display", "mini", "--lenses", "193",
                 "--blender", blender]) == 2
    assert "number of lenses is 193, but it must be from 1 to the display's 192" in capsys.readouterr().err
    assert len(jobs(blender)) == 2 and not (tmp_path / "another").exists()


def test_reference_of_sampled_lenses_takes_them_from_the_foreground(scene, blender, tmp_path):
    folder = tmp_path / "reference"
    assert main(["reference", scene, "-o", str(folder), "--display", "mini", "--spp", "64", "--lenses", "16",
                 "--seed", "3", "--blender", blender]) == 0
    quick, job = jobs(blender)
    assert (quick["kind"], quick["sampling"]["scale"], quick["lens_list"]) == ("render", 4, None)
    assert quick["sampling"]["samples"] <= 4
    lenses = read_frame(folder).lens_list
    assert [list(lens) for lens in lenses] == job["lens_list"]
    alpha = light_field()[..., 3].reshape(12, 8, 16, 8).any(axis=(1, 3))
    assert sum(alpha[lens] for lens in lenses) == 14, "7 of 8 are foreground"


def test_views_writes_its_images_once_finished_and_a_truncated_render_keeps_the_old_image(tmp_path, capsys):
    folder = write_render(tmp_path / "frame")
    assert "eia.png does not exist" in fails(["views", str(folder)], capsys)
    main(["upscale", str(folder), "--method", "bicubic"])
    capsys.readouterr()
    assert main(["views", str(folder)]) == 0
    assert capsys.readouterr().out.split() == [str(folder / name) for name in ("epi_x.png", "epi_y.png", "views.png")]
    assert main(["views", str(folder), "--eye=-20,10,180"]) == 0 and (folder / "eye.png").exists()
    main(["upscale", str(folder), "--method", "nearest"])
    capsys.readouterr()
    picture, whole = (folder / "eia.png").read_bytes(), (folder / "lr_eia.exr").read_bytes()
    (folder / "lr_eia.exr").write_bytes(whole[:len(whole) // 2])
    assert main(["upscale", str(folder), "--method", "bicubic"]) == 2
    assert "lr_eia.exr cannot be read" in capsys.readouterr().err and (folder / "eia.png").read_bytes() == picture
    assert "frame.json does not exist" in fails(["upscale", str(tmp_path)], capsys)


def test_without_the_laboratory_the_help_and_its_verbs_say_so(monkeypatch, capsys):
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: ())
    with pytest.raises(SystemExit) as caught:
        main(["--help"])
    shown = capsys.readouterr().out
    assert caught.value.code == 0 and "render" in shown
    assert not any(name in shown.split() for name in LABORATORY)
    for words in [["study"], ["study", "chart", "a.blend", "-o", "out"],
                                       ["train", "--help"], ["train", "paper", "--set", "seed=1"]]:
        told = fails(words, capsys)
        assert told.startswith(f"lfsr {words[0]}: the verb {words[0]!r} belongs to the laboratory")
        assert "pip install ./scripts/lab" in told


LFSR = [sys.executable, "-m", "lfsr_core"]


def test_ctrl_c_while_modules_load_and_a_closed_standard_error_show_no_traceback(tmp_path):
    with subprocess.Popen([LFSR[0], "-X", "importtime", *LFSR[1:], "displays"], stdout=subprocess.DEVNULL,
                          stderr=subprocess.PIPE, text=True, cwd=ROOT) as program:
        said = [next(line for line in program.stderr if "lfsr_core.base.messages" in line)]
        program.send_signal(signal.SIGINT)
        said += program.stderr
    assert program.returncode in (-signal.SIGINT, 130) and not any("Traceback" in line for line in said)
    done = subprocess.run(["sh", "-c", 'exec "$@" 2>&-', "sh", *LFSR, "displays"], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0 and "mini" in done.stdout


@pytest.mark.parametrize(("name", "message"), [("link", "is a link to .*nowhere, which does not exist"),
    ("link/frame", "link is a link to"), ("x" * 256, "too long"), ("ä" * 128, "too long"),
    (os.fsdecode(b"r\xff"), "not UTF-8"), ("/".join(["y" * 99] * 41), "too long")])
@pytest.mark.parametrize("verb", ["render", "reference", "plan"])
def test_output_that_cannot_be(tmp_path, capsys, verb, name, message):
    scene = tmp_path / "scene.glb"
    scene.touch()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    option = "--work" if verb == "plan" else "-o"
    sentence = fails([verb, str(scene), option, str(tmp_path / name), "--blender", "/must/not/run"], capsys)
    assert re.search(message, sentence)
    assert len(sentence) < 330 and sorted(path.name for path in tmp_path.iterdir()) == ["link", "scene.glb"]


@pytest.mark.parametrize("length", [246, 255])
def test_name_with_no_room_for_a_hidden_one_beside_it(tmp_path, capsys, length):
    scene = tmp_path / "scene.glb"
    scene.touch()
    sentence = fails(["render", str(scene), "-o", str(tmp_path / ("x" * length)), "--display", "mini"], capsys)
    assert "cannot be written (File name too long)" in sentence


@pytest.mark.parametrize("verb", [["displays"], ["render", "scene.glb", "-o", "out", "--blender", "/must/not/run"]])
@pytest.mark.parametrize("output", ["closed", "full", "unread"])
def test_standard_output_that_cannot_be_written(tmp_path, verb, output):
    (tmp_path / "scene.glb").touch()
    redirect = {"closed": ">&-", "full": "> /dev/full", "unread": ""}[output]
    options = {"cwd": tmp_path, "capture_output": True, "text": True, "env": os.environ | {"PYTHONPATH": os.getcwd()}}
    if output == "unread":
        reader, writer = os.pipe()
        os.close(reader)
        options |= {"capture_output": False, "stdout": writer, "stderr": subprocess.PIPE}
    done = subprocess.run(["sh", "-c", f'exec "$@" {redirect}', "sh", *LFSR, *verb], check=False, **options)
    assert done.returncode == 2, done
    assert done.stderr.count("\n") == 1, done.stderr
    assert "output" in done.stderr and "must/not/run" not in done.stderr
    assert output != "full" or "free some space" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.fixture
def folder(tmp_path):
    return finished(tmp_path / "frame")


@pytest.mark.parametrize(("options", "names"), [(["quilt"], ["two_depths_qs2x4a1.333.png"]),
    (["quilt", "--views", "6", "--grid", "6x1"], ["two_depths_qs6x1a1.333.png"]),
    (["views", "--views", "2"], ["view_000_000.png", "view_000_001.png", "view_001_000.png", "view_001_001.png"]),
    (["stereo", "--eyes-mm", "30", "--width", "64"], ["two_depths_stereo_30mm.png"])])
def test_export(folder, capsys, options, names):
    assert main(["export", str(folder), "--format", *options]) == 0
    target = folder / "export" / options[0]
    assert str(target) in capsys.readouterr().out and sorted(path.name for path in target.iterdir()) == names


def test_there_and_back(folder, tmp_path, capsys):
    views, back = str(tmp_path / "views"), tmp_path / "b ck"
    assert main(["export", str(folder), "--format", "hci", "--views", "4", "-o", views]) == 0
    assert main(["import", views, "-o", str(back)]) == 0 and f"next: lfsr view '{back}'" in capsys.readouterr().out
    assert (read_light_field(back).views == read_light_field(folder).resampled((4, 4))).all()
    assert main(["import", views, "-o", str(tmp_path / "low"), "--scale", "2", "--angle-deg", "20"]) == 0
    assert "next: lfsr upscale" in capsys.readouterr().out
    assert main(["upscale", str(tmp_path / "low"), "--method", "bilinear"]) == 0
    assert main(["view", str(tmp_path / "low")]) == 0
