"""The C library: the same image as through the package pyoidn, on the device that rendered, else on the CPU."""

import os
import subprocess
import sys

import numpy as np
import pytest

from lfsr_core.reconstruct.methods import denoise
from lfsr_core.reconstruct.methods.denoise import CPU, DEVICE_TYPES, Wanted

RANDOM = np.random.default_rng(0)
COLOR = RANDOM.gamma(1, 1, (40, 50, 3)).astype(np.float32)
ALBEDO = RANDOM.random(COLOR.shape, np.float32)
REFUSED = Wanted("HIP" if sys.platform == "darwin" else "METAL")  # no driver makes these exist here
NORMAL = np.zeros_like(COLOR) + np.float32([0, 0, 1])


@pytest.mark.parametrize("quality", denoise.QUALITIES)
@pytest.mark.parametrize("guides", [(), (ALBEDO,), (ALBEDO, NORMAL)])
def test_image_is_that_of_the_package(quality, guides):
    pyoidn, settings = pytest.importorskip("pyoidn"), {"clean_aux": bool(guides), "quality": quality}
    np.testing.assert_array_equal(denoise.denoise_image(COLOR, *guides, **settings),
                                  pyoidn.denoise(COLOR, *guides, hdr=True, **settings))


def test_library_of_pyoidn_comes_first(monkeypatch, tmp_path):
    pytest.importorskip("pyoidn")
    assert "pyoidn" in str(next(denoise.find_libraries()))
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    assert not any("pyoidn" in str(path) for path in denoise.find_libraries())
    works = next(denoise.find_libraries())
    monkeypatch.setenv(denoise.LIBRARY_VARIABLE, str(works))
    assert list(denoise.find_libraries()) == [works] and denoise.why_missing() == ""
    monkeypatch.setenv(denoise.LIBRARY_VARIABLE, str(tmp_path / "gone.so"))
    assert denoise.why_missing().startswith(f"{tmp_path / 'gone.so'} cannot be loaded: ")


def test_a_library_that_does_not_load_gives_way_to_the_next(tmp_path, monkeypatch):
    works = next(denoise.find_libraries())
    broken = tmp_path / works.name
    broken.write_bytes(b"no library")
    monkeypatch.setattr(denoise, "find_libraries", lambda: iter((broken, works)))
    assert np.isfinite(denoise.denoise_image(COLOR)).all()
    monkeypatch.setattr(denoise, "find_libraries", lambda: iter((broken,)))
    with pytest.raises(ImportError, match="cannot be loaded"):
        denoise.denoise_image(COLOR)


@pytest.mark.skipif(sys.platform != "linux", reason="the loader's search is that of Linux")
def test_the_systems_library_is_found_by_its_name(tmp_path):
    library = next(path for path in denoise.find_libraries() if "pyoidn" not in str(path))
    (tmp_path / "system").symlink_to(library.parent)
    program = ("from lfsr_core.reconstruct.methods import denoise; import sys; denoise.PLACES = ()\n"
               "import numpy as np\n"
               "sys.stdout.write(denoise.why_missing() or str(denoise.denoise_image(np.ones((9, 9, 3))).max()))")

    def said(**environment):
        return subprocess.run([sys.executable, "-c", program], env=os.environ | environment, text=True, check=True,
                              capture_output=True).stdout

    assert said().startswith("neither pyoidn nor a libOpenImageDenoise of Blender or the system was found")
    assert float(said(LD_LIBRARY_PATH=str(tmp_path / "system"))) == pytest.approx(1, abs=0.1)


def test_a_device_is_made_once_and_input_scale_multiplies_what_the_network_sees():
    library = denoise._load_library(tuple(denoise.find_libraries()))
    assert denoise.kept(library, CPU) == denoise.kept(library, Wanted()) != 0
    np.testing.assert_array_equal(denoise.denoise_image(COLOR), denoise.denoise_image(COLOR))
    larger = denoise.denoise_image(np.tile(COLOR, (3, 2, 1)))
    assert larger.shape == (120, 100, 3) and np.isfinite(larger).all()
    said = []
    denoised = denoise.denoise_image(COLOR, device=REFUSED, note=said.append)
    np.testing.assert_array_equal(denoised, denoise.denoise_image(COLOR))
    (notice,) = said
    assert (notice.code, notice.values["device"]) == ("denoised-on-cpu", REFUSED.kind)
    scaled = denoise.denoise_image(COLOR / 8, input_scale=8.0)
    np.testing.assert_allclose(scaled * 8, denoise.denoise_image(COLOR, input_scale=1.0), rtol=1e-4, atol=1e-4)
    with pytest.raises(RuntimeError, match="error"):
        denoise.denoise_image(COLOR, weights=bytes(100))
    with pytest.raises(RuntimeError, match="error"):
        denoise.denoise_image(COLOR, weights=bytes(100), device=REFUSED, note=said.append)


def test_a_device_that_fails_while_it_works_gives_way_too(monkeypatch):
    real, said = denoise._run, []

    def out_of_memory(*_, **__):
        monkeypatch.setattr(denoise, "_run", real)
        raise RuntimeError("error 4: out of memory")

    # The CPU plays a GPU that is found, and the filter fails.
    monkeypatch.setitem(DEVICE_TYPES, "CUDA", DEVICE_TYPES["CPU"])
    monkeypatch.setattr(denoise, "_run", out_of_memory)
    denoised = denoise.denoise_image(COLOR, device=Wanted("CUDA"), note=said.append)
    np.testing.assert_array_equal(denoised, denoise.denoise_image(COLOR))
    assert len(said) == 1 and "out of memory" in said[0].values["error"]


@pytest.mark.parametrize("guides", [(), (COLOR / 20,)])
def test_images_are_copied_to_a_gpu_and_back(monkeypatch, guides):
    """The CPU plays one, with memory of its own: the same image, and nothing is said."""
    expected = denoise.denoise_image(COLOR, *guides)
    monkeypatch.setitem(DEVICE_TYPES, "CUDA", DEVICE_TYPES["CPU"])
    copied: list[str] = []
    library = denoise._load_library(tuple(denoise.find_libraries()))
    for name in ("oidnWriteBuffer", "oidnReadBuffer"):
        real = getattr(library, name)
        monkeypatch.setattr(library, name, lambda *words, name=name, real=real: (copied.append(name), real(*words)))
    said = []
    denoised = denoise.denoise_image(COLOR, *guides, device=Wanted("CUDA"), note=said.append)
    np.testing.assert_array_equal(denoised, expected)
    assert (said, copied) == ([], ["oidnWriteBuffer"] * (1 + len(guides)) + ["oidnReadBuffer"])


class Played:
    """Physical devices as the library lists them: type and PCI address, None where it knows none."""

    DEVICES = ((1, None), (3, (0, 0x1, 0)), (3, (0, 0x65, 0)), (4, (0, 0x65, 0)), (2, (1, 0x3, 2)))

    def oidnGetNumPhysicalDevices(self):
        return len(self.DEVICES)

    def oidnGetPhysicalDeviceBool(self, number, name):
        assert name == b"pciAddressSupported"
        return self.DEVICES[number][1] is not None

    def oidnGetPhysicalDeviceInt(self, number, name):
        kind, address = self.DEVICES[number]
        return kind if name == b"type" else address[(b"pciDomain", b"pciBus", b"pciDevice").index(name)]


def test_every_device_of_this_machine_can_be_asked():
    """Through the real library: its numbers and names are understood."""
    library = denoise._load_library(tuple(denoise.find_libraries()))
    kinds = [library.oidnGetPhysicalDeviceInt(number, b"type") for number in range(library.oidnGetNumPhysicalDevices())]
    assert DEVICE_TYPES["CPU"] in kinds and set(kinds) <= set(DEVICE_TYPES.values())
    assert denoise._physical(library, Wanted("CUDA", ("ffff:ff:1f",))) is None
    for device, wanted in [("CPU", CPU), ("OPTIX", Wanted("OPTIX", ("a",))), ("CPU+HIP", Wanted("HIP", ("a",))),
                           ("CUDA+OPTIX", Wanted("CUDA", ("a",))), ("", CPU), ("a toaster", CPU)]:
        assert Wanted.of(device, ("a",)) == wanted
    for wanted, number in [
        (Wanted("OPTIX", ("0000:65:00",)), 2), (Wanted("HIP", ("0000:65:00",)), 3),
        (Wanted("CUDA", ("0000:01:00",)), 1), (Wanted("ONEAPI", ("0001:03:02",)), 4),
        (Wanted("CUDA", ("0000:99:00",)), None), (Wanted("CUDA"), None)]:
        assert denoise._physical(Played(), wanted) == number
