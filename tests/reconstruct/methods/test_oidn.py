"""The C library: the same image as through the package pyoidn."""

import os
import subprocess
import sys

import numpy as np
import pytest

from lfsr_core.reconstruct.methods import oidn

RANDOM = np.random.default_rng(0)
COLOR = RANDOM.gamma(1, 1, (40, 50, 3)).astype(np.float32)
ALBEDO = RANDOM.random(COLOR.shape, np.float32)
NORMAL = np.zeros_like(COLOR) + np.float32([0, 0, 1])


@pytest.mark.parametrize("quality", oidn.QUALITIES)
@pytest.mark.parametrize("guides", [(), (ALBEDO,), (ALBEDO, NORMAL)])
@pytest.mark.parametrize("hdr", [False, True])
def test_image_is_that_of_the_package(quality, guides, hdr):
    pyoidn = pytest.importorskip("pyoidn")
    settings = {"hdr": hdr, "clean_aux": bool(guides), "quality": quality}
    np.testing.assert_array_equal(oidn.denoise(COLOR, *guides, **settings), pyoidn.denoise(COLOR, *guides, **settings))


def test_library_of_pyoidn_comes_first(monkeypatch):
    pytest.importorskip("pyoidn")
    assert "pyoidn" in str(next(oidn.find_libraries()))
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    assert not any("pyoidn" in str(path) for path in oidn.find_libraries())


def test_a_library_that_does_not_load_gives_way_to_the_next(tmp_path, monkeypatch):
    works = next(oidn.find_libraries())
    broken = tmp_path / works.name
    broken.write_bytes(b"no library")
    monkeypatch.setattr(oidn, "find_libraries", lambda: iter((broken, works)))
    assert np.isfinite(oidn.denoise(COLOR, hdr=True)).all()
    monkeypatch.setattr(oidn, "find_libraries", lambda: iter((broken,)))
    with pytest.raises(ImportError, match="cannot be loaded"):
        oidn.denoise(COLOR, hdr=True)


def test_the_library_that_the_user_names_is_the_only_one(tmp_path, monkeypatch):
    works = next(oidn.find_libraries())
    monkeypatch.setenv(oidn.LIBRARY_VARIABLE, str(works))
    assert list(oidn.find_libraries()) == [works] and oidn.why_missing() == ""
    monkeypatch.setenv(oidn.LIBRARY_VARIABLE, str(tmp_path / "gone.so"))
    assert oidn.why_missing().startswith(f"{tmp_path / 'gone.so'} cannot be loaded: ")


@pytest.mark.skipif(sys.platform != "linux", reason="the loader's search is that of Linux")
def test_the_systems_library_is_found_by_its_name(tmp_path):
    library = next(path for path in oidn.find_libraries() if "pyoidn" not in str(path))
    (tmp_path / "system").symlink_to(library.parent)
    program = ("from lfsr_core.reconstruct.methods import oidn; import sys; oidn._folders = lambda: iter(())\n"
               "import numpy as np\n"
               "sys.stdout.write(oidn.why_missing() or str(oidn.denoise(np.ones((9, 9, 3))).max()))")

    def said(**environment):
        return subprocess.run([sys.executable, "-c", program], env=os.environ | environment, text=True, check=True,
                              capture_output=True).stdout

    assert said().startswith("neither pyoidn nor a libOpenImageDenoise of Blender or the system was found")
    assert float(said(LD_LIBRARY_PATH=str(tmp_path / "system"))) == pytest.approx(1, abs=0.1)


def test_input_scale_multiplies_what_the_network_sees():
    scaled = oidn.denoise(COLOR / 8, hdr=True, input_scale=8.0)
    np.testing.assert_allclose(scaled * 8, oidn.denoise(COLOR, hdr=True, input_scale=1.0), rtol=1e-4, atol=1e-4)


def test_weights_that_are_none_are_an_error_of_the_library():
    with pytest.raises(RuntimeError, match="error"):
        oidn.denoise(COLOR, hdr=True, weights=bytes(100))
