"""Networks that another distribution offers as upscalers, such as the laboratory's comparators."""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.reconstruct.contract import Network, Upscaler

GROUP = "lfsr.networks"  # of entry points, each a dict of networks by name; importing one imports no PyTorch


NETWORKS: dict[str, Network] = {name: network for point in importlib.metadata.entry_points(group=GROUP)
                                for name, network in point.load().items()}
NAMES = {name: network.description for name, network in NETWORKS.items()}


def upscaler(name: str, **settings: Any) -> Upscaler:
    """Make the upscaler of a network in NETWORKS; its weights load at the first call, when the scale is known.

    ``settings``: for its class (``weights``, ``device``). LfsrError for a missing package.
    """
    module, attribute = NETWORKS[name].upscaler.split(":")
    try:
        kind: Callable[..., Upscaler] = getattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("lfsr_"):
            raise
        raise LfsrError(f"networks need the Python package {error.name!r}, which is not installed: "
                        f"install lfsr-lab[training] or choose a method without a network") from None
    return kind(name, **settings)
