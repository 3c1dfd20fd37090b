"""Weights made by hand, stored as the authors store theirs, so that the result of a network is known."""

import numpy as np
from scipy.io import savemat


def cells(path, layers):
    """Write (weights, biases) as two cell arrays of MATLAB."""
    path.parent.mkdir(parents=True)
    held = {}
    for key, values in zip(("weight", "bias"), zip(*layers, strict=True), strict=True):
        held[key] = np.empty((1, len(values)), object)
        for index, value in enumerate(values):
            held[key][0, index] = value.astype(np.float32)
    savemat(path, held)


def zeros(*shape):
    return np.zeros(shape), np.zeros(shape[2])


def differences(clones):
    """Sheared-EPI: the score is minus the absolute difference of both rows."""
    shapes = [(9, 32), (32, 64), (64, 64), (64, 64), (64, 64), (64, 128), (32, 128), (64, 1)]
    layers = [(np.zeros((3, 3, *shape)), np.zeros(shape[1] if index < 4 or index == 7 else shape[0]))
              for index, shape in enumerate(shapes)]
    layers[0][0][1, 1, [0, 8], 0] = 1, -1
    layers[0][0][1, 1, [0, 8], 1] = -1, 1
    layers[7][0][1, 1, 32:34, 0] = -1  # after 32 channels from below come those of the first layer
    cells(clones / "Sheared-EPI/Model/model.mat", layers)


def tent(clones):
    """EPICNN: three rows for each, by linear interpolation."""
    first, second, last = np.zeros((5, 5, 1, 64)), np.zeros((5, 5, 64, 32)), np.zeros((9, 9, 1, 32))
    first[2, 2, 0, 0] = second[2, 2, 0, 0] = 1
    last[2:7, 4, 0, 0] = np.array([1, 2, 3, 2, 1]) / 3
    cells(clones / "lfepicnn/EPICNN/EPICNN_model.mat", [(first, np.zeros(64)), (second, np.zeros(32)),
                                                        (last, np.zeros(1))])


def numbered(clones, pairs):
    """LightFieldAngularSR: the luma of the n-th new view is n / 100."""
    shapes = {"pre_level1_conv6d": ((3, 3, 3, 3, 1, 64), ""), "level1_conv6d": ((3, 3, 2, 2, 64, 60), ""),
              "pre_level1_conv6d_": ((3, 3, 2, 2, 1, 16), "_2"), "level1_conv6d_": ((3, 3, 2, 2, 16, 64), "_post"),
              "level1_conv6d__": ((3, 3, 2, 2, 64, 60), "_post2")}
    for pair in range(1, pairs + 1):
        shapes |= {f"level{pair}_conv6d___": ((3, 3, 1, 1, 64, 64), "_mid"),
                   f"level{pair}_conv6d____": ((1, 1, 3, 3, 64, 64), "_mid2")}
    found = []
    for name, (shape, end) in shapes.items():
        bias = np.arange(60) / 100 if shape[-1] == 60 and not end else np.zeros(shape[-1])
        found += [(f"{name.rstrip('_')}_f{end}", np.zeros(shape)), (f"{name.rstrip('_')}_b{end}", bias)]
    params = np.empty((1, len(found)), [("name", object), ("value", object)])
    for index, each in enumerate(found):
        params[0, index] = each
    path = clones / f"LightFieldAngularSR/pretrained_models/Layer{pairs}.mat"
    path.parent.mkdir(parents=True, exist_ok=True)
    savemat(path, {"net": {"params": params}})
