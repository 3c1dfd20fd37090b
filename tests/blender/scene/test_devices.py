"""GPUs that Cycles finds; this machine has none, so their ids are played."""

from types import SimpleNamespace

import pytest

from blender_addon.scene import devices
from lfsr_core.base.errors import LfsrError


@pytest.mark.parametrize(("ids", "addresses"), [
    (["CUDA_NVIDIA H100_0000:65:00"], ("0000:65:00",)),
    (["CUDA_NVIDIA RTX_0000:01:00_OptiX", "CUDA_NVIDIA RTX_0000:02:00_OptiX"], ("0000:01:00", "0000:02:00")),
    (["HIP_AMD Radeon RX 7900 XTX_0000:0c:00"], ("0000:0c:00",)),
    (["ONEAPI_Intel Arc A770_0000:03:00.0"], ("0000:03:00",)),
    (["METAL_Apple M4"], ()), ([], ())])
def test_addresses_are_in_the_ids_of_cycles_devices(monkeypatch, ids, addresses):
    preferences = SimpleNamespace(get_device_types=lambda context: [("OPTIX", "OptiX", "", 3)],
                                  get_devices_for_type=lambda kind: [SimpleNamespace(id=each) for each in ids])
    monkeypatch.setattr(devices, "cycles_preferences", lambda: preferences)
    assert devices.gpu_addresses("OPTIX") == addresses
    assert devices.gpu_addresses("CPU") == devices.gpu_addresses("VULKAN") == ()


def test_what_blender_does_not_know_and_this_machine_does_not_have_is_refused():
    with pytest.raises(LfsrError, match="device is 'VULKAN', but this Blender knows"), devices.enabled("VULKAN"):
        pass
    absent = [kind for kind in ("CUDA", "HIP") if devices.resolved("auto") != kind]
    with pytest.raises(LfsrError, match="device is '.*', but this machine has none"), devices.enabled(absent[0]):
        pass
