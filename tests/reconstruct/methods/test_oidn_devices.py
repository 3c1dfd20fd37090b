"""The device that rendered denoises, else the CPU; without a GPU the CPU stands for one."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from lfsr_core.reconstruct.methods import oidn
from lfsr_core.reconstruct.methods.oidn import CPU, TYPES, Wanted

COLOR = np.random.default_rng(0).gamma(1, 1, (40, 50, 3)).astype(np.float32)
REFUSED = Wanted("HIP" if sys.platform == "darwin" else "METAL")  # no driver makes these exist here


@pytest.mark.parametrize(("device", "wanted"), [
    ("CPU", CPU), ("OPTIX", Wanted("OPTIX", ("a",))), ("CPU+HIP", Wanted("HIP", ("a",))),
    ("CUDA+OPTIX", Wanted("CUDA", ("a",))), ("", CPU), ("a toaster", CPU)])
def test_device_of_a_frame(device, wanted):
    assert Wanted.of(device, ("a",)) == wanted


def test_a_device_is_made_once():
    library = oidn._load(tuple(oidn.find_libraries()))
    assert oidn.kept(library, CPU) == oidn.kept(library, Wanted()) != 0
    first = oidn.denoise(COLOR, hdr=True)
    np.testing.assert_array_equal(oidn.denoise(COLOR, hdr=True), first)
    larger = oidn.denoise(np.tile(COLOR, (3, 2, 1)), hdr=True)
    assert larger.shape == (120, 100, 3) and np.isfinite(larger).all()


def test_a_device_that_refuses_gives_way_to_the_cpu_with_one_notice():
    said = []
    denoised = oidn.denoise(COLOR, hdr=True, device=REFUSED, note=said.append)
    np.testing.assert_array_equal(denoised, oidn.denoise(COLOR, hdr=True))
    (notice,) = said
    assert (notice.code, notice.values["device"]) == ("denoised-on-cpu", REFUSED.kind)


def test_a_device_that_fails_while_it_works_gives_way_too(monkeypatch):
    real, said = oidn._run, []

    def out_of_memory(*_, **__):
        monkeypatch.setattr(oidn, "_run", real)
        raise RuntimeError("error 4: out of memory")

    # The CPU plays a GPU that is found, and the filter fails.
    monkeypatch.setitem(TYPES, "CUDA", TYPES["CPU"])
    monkeypatch.setattr(oidn, "_run", out_of_memory)
    denoised = oidn.denoise(COLOR, hdr=True, device=Wanted("CUDA"), note=said.append)
    np.testing.assert_array_equal(denoised, oidn.denoise(COLOR, hdr=True))
    assert len(said) == 1 and "out of memory" in said[0].values["error"]


@pytest.mark.parametrize("guides", [(), (COLOR / 20,)])
def test_images_are_copied_to_a_gpu_and_back(monkeypatch, guides):
    """The CPU plays one, with memory of its own: the same image, and nothing is said."""
    expected = oidn.denoise(COLOR, *guides, hdr=True)
    monkeypatch.setitem(TYPES, "CUDA", TYPES["CPU"])
    copied: list[str] = []
    library = oidn._load(tuple(oidn.find_libraries()))
    for name in ("oidnWriteBuffer", "oidnReadBuffer"):
        real = getattr(library, name)
        monkeypatch.setattr(library, name, lambda *words, name=name, real=real: (copied.append(name), real(*words)))
    said = []
    denoised = oidn.denoise(COLOR, *guides, hdr=True, device=Wanted("CUDA"), note=said.append)
    np.testing.assert_array_equal(denoised, expected)
    assert (said, copied) == ([], ["oidnWriteBuffer"] * (1 + len(guides)) + ["oidnReadBuffer"])


def test_the_cpu_has_nothing_to_give_way_to():
    said = []
    with pytest.raises(RuntimeError, match="error"):
        oidn.denoise(COLOR, hdr=True, weights=bytes(100), device=REFUSED, note=said.append)


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


@pytest.mark.parametrize(("wanted", "number"), [
    (Wanted("OPTIX", ("0000:65:00",)), 2), (Wanted("HIP", ("0000:65:00",)), 3), (Wanted("CUDA", ("0000:01:00",)), 1),
    (Wanted("ONEAPI", ("0001:03:02",)), 4), (Wanted("CUDA", ("0000:99:00",)), None), (Wanted("CUDA"), None)])
def test_the_gpu_at_the_address_of_the_render(wanted, number):
    assert oidn._physical(Played(), wanted) == number


def test_every_device_of_this_machine_can_be_asked():
    """Through the real library: its numbers and names are understood."""
    library = oidn._load(tuple(oidn.find_libraries()))
    kinds = [library.oidnGetPhysicalDeviceInt(number, b"type") for number in range(library.oidnGetNumPhysicalDevices())]
    assert TYPES["CPU"] in kinds and set(kinds) <= set(TYPES.values())
    assert oidn._physical(library, Wanted("CUDA", ("ffff:ff:1f",))) is None
