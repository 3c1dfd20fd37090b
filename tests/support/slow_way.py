"""The second stage done the slow and plain way."""

import numpy as np

from lfsr_core.frames.frame import LOW_RES_FILE, read_frame
from lfsr_core.images.image_files import read_layers
from lfsr_core.optics.rays import from_elemental_images
from lfsr_core.reconstruct.methods import load_method
from lfsr_core.reconstruct.upscaler import low_resolution
from tests.support.synthetic import MINI


def expected_linear(folder, name):
    """The finished EIA the slow way: every lens through the method, then the background put in by hand."""
    frame, layers = read_frame(folder), read_layers(folder / LOW_RES_FILE)
    low = low_resolution(layers, frame)
    sx, sy = MINI.lenses
    lenses = np.argwhere(np.ones((sy, sx), bool))
    images = load_method(name).upscaler(low, lenses).reshape(sy, sx, 8, 8, 3)
    images[~low.alpha.any((2, 3, 4))] = MINI.background
    return from_elemental_images(images)
