"""Images to measure errors on: texture beside an almost flat half, blurred or noisy, and scikit-image's SSIM."""

import cv2
import numpy as np

# The settings under which scikit-image computes the SSIM of Wang et al.
GAUSSIAN = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "data_range": 1,
            "channel_axis": 2}


def textured_image(height=96, width=128, seed=0):
    """Texture on the left, almost flat on the right; (H, W, 3) in [0.2, 0.8]."""
    random = np.random.default_rng(seed)
    image = cv2.resize(random.random((height // 4, width // 4, 3)), (width, height), interpolation=cv2.INTER_CUBIC)
    image[:, width // 2:] = 0.5 + 0.02 * image[:, width // 2:]
    return 0.2 + 0.6 * np.clip(image, 0, 1)


def blurred(image, noise=0.01, seed=1):
    """A candidate: ``image`` blurred, with Gaussian noise."""
    return cv2.GaussianBlur(image, (0, 0), 1.2) + np.random.default_rng(seed).normal(0, noise, image.shape)


def noisy(image, noise, seed):
    """A render of ``image`` with Gaussian noise of standard deviation ``noise``."""
    return image + np.random.default_rng(seed).normal(0, noise, image.shape)
