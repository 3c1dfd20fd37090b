"""The extension as an artist gets it: built, validated, installed, used, removed, with nothing but Blender around."""

from __future__ import annotations

import ast
import importlib.util
import io
import json
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest

from lfsr_core import __version__
from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.png import read_mask, read_png

ROOT = Path(__file__).resolve().parents[2]
STEPS = ROOT / "tests" / "support" / "extension_steps.py"
# What Blender's own Python has: everything else is hidden from the Blender under test.
BLENDER_BRINGS = ("bpy", "numpy", "numpy.libs", "requests", "urllib3", "certifi", "idna", "charset_normalizer",
                  "zstandard")
ON = {"listed": True, "operators": True, "settings": True}
OFF = dict.fromkeys(ON, False)
DYNAMIC = {"import_module", "find_spec", "__import__"}
# What the product must not need, by name of a package or a folder.
FOREIGN = {"lfsr_lab", "lab", "tests", "scripts", "torch", "torchvision", "matplotlib", "jinja2"}


def load_script():
    spec = importlib.util.spec_from_file_location("build_extension", ROOT / "scripts" / "build_extension.py")
    module = sys.modules["build_extension"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


builder = load_script()


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
    """Content of every file of the zip and of lfsr_core's wheel in it, by path."""
    with zipfile.ZipFile(archive) as content:
        found = {name: content.read(name) for name in content.namelist()}
    core = next(name for name in found if name.startswith("wheels/lfsr-"))
    with zipfile.ZipFile(io.BytesIO(found[core])) as wheel:
        return found | {f"{core}/{name}": wheel.read(name) for name in wheel.namelist()}


@pytest.fixture(scope="module", params=[pytest.param(sys.executable, id="own"), another("4.5"), another("5.2")])
def blender(request, tmp_path_factory):
    """Runs a step in a Blender with resources of its own and no other packages: blender(step, *arguments)."""
    folder = tmp_path_factory.mktemp("blender")
    python = only_blender(request.param, folder / "python")

    def run(step, *arguments):
        done = subprocess.run([python, STEPS, step, folder, *arguments], capture_output=True, text=True, timeout=300,
                              check=False, cwd=folder, env={
                                  "BLENDER_USER_RESOURCES": str(folder / "resources"), "HOME": str(folder),
                                  "PATH": os.defpath, "TMPDIR": str(folder)})
        assert done.returncode == 0, done.stdout + done.stderr
        return json.loads((folder / "found.json").read_text())

    run.folder, run.python = folder, python
    return run


def only_blender(python, folder):
    """A new environment that has of ``python``'s packages only those that every Blender has; its Python."""
    subprocess.run([python, "-m", "venv", "--without-pip", folder], check=True)
    target = folder / "bin" / "python"
    source, visible = (packages_of(one) for one in (python, target))
    for name in BLENDER_BRINGS:
        if (source / name).exists():
            (visible / name).symlink_to(source / name)
    return target


def packages_of(python):
    ask = [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    return Path(subprocess.run(ask, check=True, capture_output=True, text=True).stdout.strip())


def test_zip_is_complete(files):
    manifest = tomllib.loads(files["blender_manifest.toml"].decode())
    inside = {name.split(".whl/")[1] for name in files if ".whl/" in name}
    names = [name for name in files if ".whl/" not in name]
    wheels = [name for name in names if name.endswith(".whl")]
    assert {f"./{name}" for name in wheels} == set(manifest["wheels"])
    assert all(name.endswith("-py3-none-any.whl") for name in wheels), "bound to a platform or a Python"
    assert set(builder.RUNTIME_WHEELS) < {name.split("/")[1].split("-")[0] for name in wheels}
    assert manifest["version"] == __version__ and "platforms" not in manifest
    assert manifest["permissions"].keys() == {"files"}
    assert {"__init__.py", "render/ray_layout.osl", "background/launch.py", "headless/entry.py",
            "LICENSE"} <= set(names)
    assert not [name for name in names if "__pycache__" in name or name.startswith(".")]
    for pattern in ("optics/displays/*.toml", "reconstruct/networks/weights/*", "sequence/templates/*",
                    "exports/viewer/*"):
        data = {str(path.relative_to(ROOT)) for path in (ROOT / "lfsr_core").glob(pattern)}
        assert data and data <= inside, pattern
    assert not [name for name in inside if name.startswith("blender_addon")]


def test_zip_has_nothing_of_the_laboratory_or_the_tests(files):
    assert [name for name in files if FOREIGN & {*Path(name).parts}] == []
    modules = {name: text.decode() for name, text in files.items() if name.endswith(".py")}
    assert len(modules) > 150 and any("lfsr_core" in name for name in modules)
    assert {name: found for name, text in modules.items() if (found := imported(text) & FOREIGN)} == {}


def imported(source: str) -> set[str]:
    """Top-level packages that a module imports anywhere, also by ``import_module("name")``."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add(node.module)
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in DYNAMIC:
            names |= {argument.value for argument in node.args[:1] if isinstance(argument, ast.Constant)}
    return {name.split(".")[0] for name in names}


@pytest.mark.parametrize("line", ["import torch.nn", "from lfsr_lab.train import fit", "import_module('torch')",
                                  "importlib.util.find_spec('lfsr_lab')", "def f():\n    import matplotlib"])
def test_every_kind_of_import_is_seen(line):
    assert imported(line) & FOREIGN


def test_blender_of_each_version_finds_the_zip_valid(archive, blender):
    tool = next((packages_of(blender.python) / "bpy").glob(builder.EXTENSION_TOOL))
    done = subprocess.run([blender.python, tool, "validate", archive], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_from_installation_to_removal(archive, blender):
    found = blender("install", str(archive))
    assert found["foreign"] == [], "the test's Blender must not see packages of the tests"
    assert found["install"] == ["FINISHED"]
    assert [found[when] for when in ("enabled", "disabled", "enabled_again")] == [ON, OFF, ON]
    resources = blender.folder / "resources"
    assert Path(found["core"]).is_relative_to(resources)
    assert found["test_button"] == ["FINISHED"]
    assert "Open Image Denoise" in found["second_stage"]

    assert blender("render") == {"enabled": ON}
    check_cube(blender.folder / "frame")
    exports = {name: ["FINISHED"] for name in ("quilt", "views", "sway")}
    assert blender("press") == {"enabled": ON, "render": ["FINISHED"], "reference": ["FINISHED"],
                                "viewer": ["FINISHED"], "exports": exports}
    frame = next((blender.folder / "images").rglob("eia.png")).parent
    check_cube(frame)
    assert (frame / "view.html").is_file() and list((frame / "export" / "sway").glob("*.mp4"))
    metrics = json.loads((frame / "report.json").read_text())["metrics"]
    assert metrics["flip"] is None and "flip-evaluator" in metrics["notes"][0] and 0 < metrics["ssim_lens_fg"] <= 1

    found = blender("uninstall")
    assert found == {"enabled": ON, "uninstall": ["FINISHED"], "after": OFF}
    left = [path for path in resources.rglob("*") if path.is_file() and "lfsr" in str(path.relative_to(resources))]
    assert left == []


def check_cube(folder):
    """The image shows the cube where the mask says so, and the grey world elsewhere."""
    frame, image, mask = read_frame(folder), read_png(folder / "eia.png"), read_mask(folder / "mask.png")
    assert image.shape[:2] == frame.display.panel_pixels[::-1]
    assert 0.02 < mask.mean() < 1
    sx, sy = frame.display.lenses
    brightest = image.max(-1).reshape(sy, image.shape[0] // sy, sx, -1).max((1, 3))
    world = np.median(brightest[~mask])
    assert np.mean(np.abs(brightest[~mask] - world) < 8) > 0.8
    assert brightest[mask].max() > world + 50
    report = json.loads((folder / "report.json").read_text())
    assert report["method"] == "denoise+bilinear"


def test_the_panel_starts_without_openimageio():
    """Blender's Python need not find it; the second stage does."""
    code = "import sys; sys.modules['OpenImageIO'] = None; import bpy, blender_addon; blender_addon.register()"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_tool_that_fails_leaves_no_zip(tmp_path, monkeypatch):
    def broken(folder):
        (folder / "lfsr-0-py3-none-any.whl").write_bytes(b"no wheel")
        (folder.parent / "__init__.py").unlink()

    monkeypatch.setattr(builder, "build_core", broken)
    monkeypatch.setattr(builder, "download", lambda *_: None)
    with pytest.raises(LfsrError, match="extension tool failed"):
        builder.build(tmp_path / "out")
    assert not list(tmp_path.rglob("*.zip"))


def test_missing_wheel_is_one_clear_sentence(tmp_path):
    with pytest.raises(LfsrError, match=r"pip failed with .*threadpoolctl"):
        builder.download(tmp_path, ["threadpoolctl==0.0.0.1"])


def test_wheel_bound_to_a_python_is_refused(tmp_path):
    with pytest.raises(LfsrError, match=r"pip failed with .*flip-evaluator"):
        builder.download(tmp_path, ["flip-evaluator"])


def test_version_that_differs_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(builder, "__version__", "9.9.9")
    with pytest.raises(LfsrError, match=r"9\.9\.9: make them equal"):
        builder.write_manifest(tmp_path / "blender_manifest.toml", [])


def test_addon_does_not_import_itself_by_name():
    """As an extension the package is called bl_ext.….lfsr, so an import of blender_addon would fail."""
    modules = {path: imported(path.read_text(encoding="utf-8")) for path in (ROOT / "blender_addon").rglob("*.py")}
    # The entry point of a headless Blender loads the package under that name first.
    assert [path.name for path, names in modules.items() if "blender_addon" in names] == ["entry.py"]
