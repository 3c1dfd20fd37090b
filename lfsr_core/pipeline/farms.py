"""Jobs for render farms: the templates, and folders with a job that is ready to be submitted."""

import itertools
import platform
import shlex
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import atomic_path, write_json
from lfsr_core.frames.frame import Finish, Request

OPENJD, FLAMENCO = "openjd", "flamenco"
# Flamenco knows a job type by its file's name.
TEMPLATES = {OPENJD: "lfsr-openjd.yaml", FLAMENCO: "lfsr-light-field.js"}
# What to do with the file of a template.
NEXT = {OPENJD: "submit it to the farm, or try it with: openjd run FILE -p Scene=SCENE -p Output=FILM",
        FLAMENCO: "put it into the folder scripts beside flamenco-manager, and restart that"}
MOST_PARTS = 1000
FLAMENCO_PLATFORMS = {"Linux": "linux", "Darwin": "darwin", "Windows": "windows"}


def write_template(farm: str, output: Path) -> None:
    """Write the template of a farm in TEMPLATES."""
    with atomic_path(output) as temporary:
        temporary.write_bytes((Path(__file__).with_name("templates") / TEMPLATES[farm]).read_bytes())


def write_job(farm: str, folder: Path, request: Request, finish: Finish, frames: Sequence[int], parts: int = 1,
              display: str = "") -> tuple[str, str]:
    """Write an animation's job into ``folder``; return the command that starts it, and one sentence of advice.

    OpenJD gets a job bundle: AWS Deadline Cloud reads ``parameter_values``, openjd-cli the plain parameters. Flamenco
    gets a job type for the manager, and a new job for its HTTP interface. ``request``: its output is the folder of the
    frames' folders, its scene a file that every worker sees; ``parts``: number of parts of each frame, by rows of
    lenses; ``display``: file of the display's profile, empty for the built-in one of its name. LfsrError for a wrong
    number of parts, or where a file cannot be written.
    """
    most = min(MOST_PARTS, request.display.lenses[1])
    if not 1 <= parts <= most:
        raise LfsrError(f"parts are {parts}, but they must be 1 to {most} on display {request.display.name}")
    scene, sampling = request.scene, request.sampling
    # By their names in the templates; Flamenco's are in lower case.
    values = {"Output": request.output, "Parts": parts, "Display": display or request.display.name,
              "Scale": str(sampling.scale), "Rays": sampling.samples / request.display.finished_pixels(sampling.scale),
              "Seed": request.seed, "Light": request.light, "Device": request.device, "Method": finish.method,
              "Linear": "--linear-exr" if finish.linear_exr else "--no-linear-exr",
              "TemporalAveraging": finish.temporal_averaging}
    # As OpenJD writes them: 1-48, 1-48:2 if all steps are equal, else a list.
    listed, steps = ",".join(map(str, frames)), {second - first for first, second in itertools.pairwise(frames)}
    step = min(steps, default=0)
    ranges = f"{frames[0]}-{frames[-1]}{f':{step}' if step > 1 else ''}" if len(steps) == 1 and step > 0 else listed
    if farm == OPENJD:
        values = {"Scene": scene, "Frames": ranges} | values
        template, plain = folder / "template.yaml", folder / "parameters.json"
        write_template(OPENJD, template)
        write_json(plain, values)
        write_json(folder / "parameter_values.json",
                   {"parameterValues": [{"name": name, "value": value} for name, value in values.items()]})
        words = ["openjd", "run", str(template), "-p", f"file://{plain}", "--step", "Finish", "--run-dependencies"]
        return (shlex.join(words),
                "That runs it on this machine; for AWS Deadline Cloud: deadline bundle gui-submit "
                f"{shlex.quote(str(folder))}")
    script, data = folder / TEMPLATES[FLAMENCO], folder / "flamenco-job.json"
    write_template(FLAMENCO, script)
    write_json(data, {
        "name": f"{Path(scene).stem} {ranges}", "type": script.stem, "priority": 50,
        "submitter_platform": FLAMENCO_PLATFORMS.get(platform.system(), "linux"),
        "settings": {"blendfile": scene, "frames": listed, "lfsr": "lfsr"}
        | {name.lower(): value for name, value in values.items()}})
    words = ["curl", "-H", "Content-Type: application/json", "--data", f"@{data}", "http://MANAGER:8080/api/v3/jobs"]
    return (shlex.join(words), f"Put your manager in place of MANAGER, once {script.name} is in its folder scripts")
