import numpy as np

from lfsr_lab.experiments.displays.ways import clean_guides

RANDOM = np.random.default_rng(0)


def test_cleaned_normals_keep_their_direction():
    normal = np.zeros((64, 64, 3), np.float32) + np.float32([0, 0, 1])
    normal[:, 32:] = [-1, 0, 0]
    noisy = normal + RANDOM.normal(0, 0.2, normal.shape).astype(np.float32)
    cleaned = clean_guides({"normal": noisy})["normal"]
    assert np.abs(cleaned - normal).mean() < 0.5 * np.abs(noisy - normal).mean()
