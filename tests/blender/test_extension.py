"""The extension as an artist gets it: built, validated, installed, used, removed, with nothing but Blender around."""

import ast
import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path, PurePosixPath

import numpy as np
import pytest

from lfsr_core import __version__
from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.image_files import read_mask, read_png
from tests.support.told import refuses

ROOT = Path(__file__).resolve().parents[2]
STEPS = ROOT / "tests" / "support" / "extension_steps.py"
# What Blender's own Python has: everything else is hidden from the Blender under test.
BLENDER_BRINGS = ("bpy", "numpy", "numpy.libs", "requests", "urllib3", "certifi", "idna", "charset_normalizer",
                  "zstandard", "cattr", "cattrs", "attr", "attrs", "typing_extensions.py")
ON = {"listed": True, "operators": True, "settings": True}
OFF = dict.fromkeys(ON, False)


spec = importlib.util.spec_from_file_location("build_extension", ROOT / "scripts" / "build_extension.py")
builder = sys.modules["build_extension"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(builder)
reviewer = sys.modules["review_extension"]


def another(version: str) -> object:
    """A Blender other than the one that runs the tests, if its Python is named by the environment."""
    variable = f"LFSR_BPY{version.replace('.', '')}_PYTHON"
    python = os.environ.get(variable)
    missing = pytest.mark.skipif(not python, reason=f"no bpy {version}: set {variable} to a Python that has it")
    return pytest.param(python, id=version, marks=missing)


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """The one zip, for every platform and Python."""
    return builder.build(tmp_path_factory.mktemp("built"))


@pytest.fixture(scope="module")
def files(archive):
    """Content of every file of the zip, by path."""
    with zipfile.ZipFile(archive) as content:
        return {name: content.read(name) for name in content.namelist()}


@pytest.fixture(scope="module", params=[pytest.param(sys.executable, id="own"), another("4.5"), another("5.1"),
                                        another("5.2")])
def blender(request, tmp_path_factory):
    """Runs a step in a Blender with resources of its own and no other packages: blender(step, *arguments)."""
    folder = tmp_path_factory.mktemp("blender")
    # Of its packages it has only those that every Blender has.
    subprocess.run([request.param, "-m", "venv", "--without-pip", folder / "python"], check=True)
    python = folder / "python" / "bin" / "python"
    source, visible = map(packages_of, (request.param, python))
    for name in BLENDER_BRINGS:
        if (source / name).exists():
            (visible / name).symlink_to(source / name)

    def run(step, *arguments):
        done = subprocess.run([python, STEPS, step, folder, *arguments], capture_output=True, text=True, timeout=300,
                              check=False, cwd=folder, env={
                                  "BLENDER_USER_RESOURCES": str(folder / "resources"), "HOME": str(folder),
                                  "PATH": os.defpath, "TMPDIR": str(folder)})
        assert done.returncode == 0, done.stdout + done.stderr
        return json.loads((folder / "result.json").read_text())

    run.folder, run.python = folder, python
    return run


def packages_of(python):
    ask = [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    return Path(subprocess.run(ask, check=True, capture_output=True, text=True).stdout.strip())


def test_zip_is_complete_with_every_module_that_reads_its_own_folder(files):
    manifest = tomllib.loads(files["blender_manifest.toml"].decode())
    assert manifest["version"] == __version__ and "platforms" not in manifest and "wheels" not in manifest
    assert {"__init__.py", "render/ray_layout.osl", "headless/entry.py", "LICENSE"} <= files.keys()
    for pattern in ("optics/displays/*.toml", "reconstruct/weights/*", "pipeline/templates/*",
                    "exports/viewer/*", "exports/*.html"):
        data = {f"packages/{path.relative_to(ROOT).as_posix()}" for path in (ROOT / "lfsr_core").glob(pattern)}
        assert data and data <= files.keys(), pattern
    assert files.keys() >= reviewer.READS_ITS_FOLDER


def test_zip_has_the_repositorys_files(files):
    """Only imports differ, so that what is tested is what is installed."""
    for name, content in files.items():
        folder = ROOT if name.startswith("packages/lfsr_core/") else ROOT / "blender_addon"
        source = folder / name.removeprefix("packages/")
        if name in ("LICENSE", "blender_manifest.toml", "packages/__init__.py"):
            continue
        ours, theirs = content.decode(errors="replace"), source.read_bytes().decode(errors="replace")
        differ = [pair for pair in zip(ours.splitlines(), theirs.splitlines(), strict=True) if pair[0] != pair[1]]
        assert all("from ." in new and "from lfsr_core" in old for new, old in differ), name
        for node in ast.walk(ast.parse(content)) if name.endswith(".py") else ():
            if isinstance(node, ast.ImportFrom) and node.level:
                place = PurePosixPath(name).parents[node.level - 1] / (node.module or "").replace(".", "/")
                inside = place.is_relative_to("packages")
                module = ROOT / place.relative_to("packages") if inside else ROOT / "blender_addon" / place
                assert module.is_dir() or module.with_suffix(".py").is_file(), f"{name} imports {place}"


def test_two_builds_are_the_same_bytes_and_a_release_needs_a_publisher_in_its_manifest(archive, tmp_path):
    """From another folder, with other dates and another umask."""
    copied = tmp_path / "elsewhere"
    for name in ("blender_addon", "lfsr_core", "scripts", "docs"):
        shutil.copytree(ROOT / name, copied / name, copy_function=shutil.copyfile)
    for name in ("LICENSE", "blender_manifest.toml", "pyproject.toml"):
        shutil.copyfile(ROOT / name, copied / name)
    (copied / "blender_addon" / "__pycache__").mkdir(exist_ok=True)
    (copied / "blender_addon" / "__pycache__" / "junk.pyc").touch()
    subprocess.run([sys.executable, copied / "scripts" / "build_extension.py", "--output", tmp_path], check=True,
                   umask=0o077, env=os.environ | {"TZ": "Asia/Tokyo", "PYTHONHASHSEED": "7"})
    assert (tmp_path / archive.name).read_bytes() == archive.read_bytes()
    assert len(reviewer.review(archive, is_release=True)) == 2, "nothing else breaks a rule"


def test_imports_are_rewritten_and_nothing_else():
    source = ('"""from lfsr_core.base.messages import LfsrError"""\n'
              "from lfsr_core.base.messages import (\n    LfsrError)\n"
              "def f():\n    from lfsr_core.base.system import read_json  # from lfsr_core.base.system\n")
    assert builder.with_relative_imports(source, PurePosixPath("ui/panels.py")) == source.replace(
        "\nfrom lfsr_core", "\nfrom ..packages.lfsr_core").replace(
        "    from lfsr_core", "    from ..packages.lfsr_core")
    with pytest.raises(LfsrError, match=r"ui/panels\.py, line 1 imports lfsr_core itself"):
        builder.with_relative_imports("import lfsr_core.base.messages", PurePosixPath("ui/panels.py"))


def test_blender_of_each_version_finds_the_zip_valid(archive, blender):
    tool = next((packages_of(blender.python) / "bpy").glob(builder.EXTENSION_TOOL))
    done = subprocess.run([blender.python, tool, "validate", archive], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_from_installation_to_removal(archive, blender, tmp_path):
    """Beside another extension, whose wheel of a package that the core can use is of another version."""
    result = blender("install", str(archive))
    assert result["foreign"] == [], "the test's Blender must not see packages of the tests"
    assert result["install"] == ["FINISHED"]
    assert (result["warnings"], result["added_paths"], result["added_modules"]) == ([], [], ["bl_ext"])
    assert [result[when] for when in ("enabled", "disabled", "enabled_again")] == [ON, OFF, ON]
    resources = blender.folder / "resources"
    assert Path(result["core"]).is_relative_to(resources) and result["second_stage"] == f"LFSR {__version__}"

    exports = {name: ["FINISHED"] for name in ("quilt", "views", "sway")}
    assert blender("press") == {"enabled": ON, "render": ["FINISHED"], "reference": ["FINISHED"],
                                "viewer": ["FINISHED"], "exports": exports}
    frame = next((blender.folder / "images").rglob("eia.png")).parent
    # It shows the cube where the mask says so, and the grey world elsewhere.
    display, image, mask = read_frame(frame).display, read_png(frame / "eia.png"), read_mask(frame / "mask.png")
    assert image.shape[:2] == display.panel_pixels[::-1] and 0.02 < mask.mean() < 1
    (sx, sy), report = display.lenses, json.loads((frame / "report.json").read_text())
    brightest = image.max(-1).reshape(sy, image.shape[0] // sy, sx, -1).max((1, 3))
    world = np.median(brightest[~mask])
    assert np.mean(np.abs(brightest[~mask] - world) < 8) > 0.8 and brightest[mask].max() > world + 50
    assert (frame / "view.html").is_file() and list((frame / "export" / "sway").glob("*.mp4"))
    metrics = report["metrics"]
    assert metrics["flip"] is None and metrics["notes"][0]["code"] == "flip-missing"
    assert 0 < metrics["ssim_lens_fg"] <= 1 and report["method"] == "denoise+bilinear"

    other = blender("install_other", str(other_extension(tmp_path, "0.0.1")))
    assert (other["install"], other["other"], other["ours"]) == (["FINISHED"], "0.0.1", result["second_stage"])
    other = {"other": "0.0.1", "ours": other["ours"]}
    assert blender("uninstall") == other | {"enabled": ON, "uninstall": ["FINISHED"], "after": OFF}
    left = [path for path in resources.rglob("*") if path.is_file() and "lfsr" in str(path.relative_to(resources))]
    assert left == [] and blender("both") == {"other": "0.0.1", "ours": ""}


def test_the_panel_starts_without_openimageio():
    """Blender's Python need not find it; the second stage does."""
    code = "import os, sys, bpy; sys.modules['OpenImageIO']=None; import blender_addon as a; a.register(); os._exit(0)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def other_extension(folder, version):
    """An extension with a wheel of threadpoolctl in a version that would break the second stage."""
    wheel, info = f"threadpoolctl-{version}-py3-none-any.whl", f"threadpoolctl-{version}.dist-info"
    with zipfile.ZipFile(folder / wheel, "w") as content:
        content.writestr("threadpoolctl.py", f"__version__ = {version!r}\nthreadpool_limits = None\n")
        content.writestr(f"{info}/METADATA", f"Metadata-Version: 2.1\nName: threadpoolctl\nVersion: {version}\n")
        content.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        content.writestr(f"{info}/RECORD", "")
    manifest = {"schema_version": "1.0.0", "id": "other", "version": "1.0.0", "name": "Other", "tagline": "Another",
                "maintainer": "Another", "type": "add-on", "blender_version_min": "4.5.0",
                "license": ["SPDX:GPL-3.0-or-later"], "wheels": [f"./wheels/{wheel}"]}
    with zipfile.ZipFile(folder / "other.zip", "w") as content:
        lines = (f"{name} = {json.dumps(value)}\n" for name, value in manifest.items())
        content.writestr("blender_manifest.toml", "".join(lines))
        content.writestr("__init__.py", "import threadpoolctl\nVERSION = threadpoolctl.__version__\n"
                                        "def register(): pass\ndef unregister(): pass\n")
        content.write(folder / wheel, f"wheels/{wheel}")
    return folder / "other.zip"


def test_a_zip_that_blender_refuses_is_not_written_and_a_version_that_differs_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(builder, "__version__", "9.9.9")
    refuses(r"9\.9\.9: make them equal", builder.write_manifest, tmp_path / "blender_manifest.toml", None)
    monkeypatch.setattr(builder, "write_manifest", lambda path, _: path.write_text(
        (ROOT / "blender_manifest.toml").read_text().replace('id = "lfsr"', 'id = "no id"')))
    refuses("extension tool failed", builder.build, tmp_path / "out")
    assert not list(tmp_path.rglob("*.zip"))


@pytest.fixture
def project(tmp_path):
    """Write a pyproject.toml and a changelog; project(website, name, email, sections) -> arguments of a release."""
    def make(website="https://example.org/lfsr", name='Zoë "Z" Q', email="z@example.org", sections=(__version__,),
             line=""):
        who = f"maintainers = [{{ name = {json.dumps(name)}, email = {json.dumps(email)} }}]"
        urls = f"[project.urls]\nDocumentation = {json.dumps(website)}" if website else ""
        (tmp_path / "pyproject.toml").write_text(f'[project]\nname = "x"\n{who}\n{urls}\n', encoding="utf-8")
        text = "# Changelog\n\n" + "".join(f"## {section}\n\n- New: [page](a/b.md#c), [web](https://a.org/b).\n{line}\n\n"
                                          for section in (*sections, "0.0.1"))
        (tmp_path / "changes.md").write_text(text, encoding="utf-8")
        return {"project": tmp_path / "pyproject.toml", "changelog": tmp_path / "changes.md"}
    return make


def test_a_release_is_a_zip_with_checksum_and_notes(tmp_path, project, monkeypatch):
    archive, checksum, notes = paths = builder.release(tmp_path / "dist", **project())
    digest = hashlib.sha256(archive.read_bytes()).hexdigest()
    assert checksum.read_text().split() == [digest, archive.name]
    text = notes.read_text(encoding="utf-8")
    assert f"LFSR {__version__}" in text and "https://example.org/lfsr" in text and digest in text
    assert "- New: page, [web](https://a.org/b)." in text and "0.0.1" not in text
    with zipfile.ZipFile(archive) as content:
        manifest = tomllib.loads(content.read("blender_manifest.toml").decode())
    assert (manifest["website"], manifest["maintainer"]) == ("https://example.org/lfsr", 'Zoë "Z" Q <z@example.org>')
    contents = [path.read_bytes() for path in paths]
    monkeypatch.setattr(builder, "review", lambda *_, **__: [])  # it was reviewed once, which takes long
    assert [path.read_bytes() for path in builder.release(tmp_path / "dist", **project())] == contents
    # What was published under a version is known by its checksum, beside it or in the changelog.
    for other in (project(line=f"SHA-256: {'0' * 64}"), project(email="y@example.org")):
        refuses(f"another zip was published as {__version__}", builder.release, tmp_path / "dist", **other)
    assert [path.read_bytes() for path in paths] == contents


@pytest.mark.parametrize(("values", "said"), [
    ({"website": ""}, "address in pyproject.toml is ''"), ({"website": "http://b.org"}, "'http://b.org'"),
    ({"name": " "}, "maintainer"), ({"email": ""}, "maintainer"), ({"email": "z example.org"}, "maintainer"),
    ({"sections": ()}, "has 0 sections"), ({"sections": (__version__, __version__)}, "has 2 sections"),
    ({"sections": (f"{__version__}0",)}, "has 0 sections")])
def test_a_release_that_is_not_ready_is_refused(tmp_path, project, values, said):
    refuses(said, builder.release, tmp_path / "dist", **project(**values))
    assert not (tmp_path / "dist").exists()


# What breaks each rule: the check, a file of the zip, and what is put into it.
BROKEN = [
    ("check_manifest", "blender_manifest.toml", lambda text: text.replace("clipboard = ", "network = ")),
    ("check_manifest", "blender_manifest.toml", lambda text: text.replace("copyright = ", "x = ")),
    ("check_manifest", "blender_manifest.toml", lambda text: text.replace("GPL-3.0-or-later", "MIT")),
    ("check_manifest", "blender_manifest.toml", lambda text: text.replace(', "SPDX:Apache-2.0"', "")),
    ("check_manifest", "packages/lfsr_core/reconstruct/weights/LICENSE-Apache-2.0.txt", lambda _: ""),
    ("check_manifest", "blender_manifest.toml", lambda text: text.replace("LFSR Light", "Blender Light")),
    ("check_search_path", "__init__.py", "import sys\nsys.path.append('x')"),
    ("check_search_path", "__init__.py", "import sys\ndef f():\n    sys.modules['x'] = None"),
    ("check_search_path", "__init__.py", "from sys import path"),
    ("check_search_path", "__init__.py", "import site\nsite.addsitedir('x')"),
    ("check_imports", "__init__.py", "import lfsr_core"),
    ("check_imports", "__init__.py", "from blender_addon import compat"),
    ("check_imports", "__init__.py", "def f():\n    import torch.nn"),
    ("check_imports", "__init__.py", "import importlib\nimportlib.import_module('lfsr_lab')"),
    ("check_imports", "packages/lfsr_core/reconstruct/blas.py", "import threadpoolctl"),
    ("check_wheels", "blender_manifest.toml", lambda text: 'wheels = ["./wheels/a.whl"]\n' + text),
    ("check_wheels", "wheels/a-1-py3-none-any.whl", "x"), ("check_contents", "render/ray_layout.oso", "x"),
    ("check_contents", "packages/lfsr_core/commands/render.py", "x = 1"), ("check_contents", "test_all.py", "x = 1"),
    ("check_contents", "compat.py", "x = '" + 300 * "x" + "'"), ("check_hidden_code", "compat.py", "exec('x = 1')"),
    ("check_hidden_code", "compat.py", "import base64\nbase64.b64decode(b'')"),
    ("check_network", "compat.py", "import urllib.request"),
    ("check_network", "compat.py", "def f():\n    from http import client"),
    ("check_network", "packages/lfsr_core/exports/loopback.py", 'ADDRESSES = ("127.0.0.1", "192.0.2.1")'),
    ("check_self_contained", "compat.py", "import bpy\nbpy.ops.preferences.addon_enable(module='x')"),
    ("check_self_contained", "compat.py", "import subprocess\nsubprocess.run(['python', '-m', 'pip'])"),
    ("check_own_folder", "compat.py", "open(__file__, 'a')")]


@pytest.mark.parametrize(("check", "name", "change"), BROKEN)
def test_review_sees_what_breaks_a_rule(files, check, name, change):
    text, manifest = files.get(name, b"").decode(), "blender_manifest.toml"
    licences = {path: files[path] for path, _ in reviewer.LICENCES.values()}
    new = change(text) if callable(change) else f"{text}\n{change}\n"
    changed = licences | {manifest: files[manifest], name: new.encode()}
    assert check in {function.__name__ for function in reviewer.CHECKS if list(function(changed))}


def test_the_changelog_and_the_guide_have_this_version_and_every_check_which_can_fail():
    assert {check for check, *_ in BROKEN} == {function.__name__ for function in reviewer.CHECKS}
    guide = (ROOT / "docs" / "guide" / "extension.md").read_text(encoding="utf-8")
    for function in (*reviewer.CHECKS, reviewer.check_publisher):
        assert f"`{function.__name__.removeprefix('check_')}`" in guide, function.__name__
    assert "- " in builder._section((ROOT / "docs" / "CHANGELOG.md").read_text(encoding="utf-8"))
    laboratory = tomllib.loads((ROOT / "scripts" / "lab" / "pyproject.toml").read_text(encoding="utf-8"))
    assert laboratory["project"]["version"] == __version__
