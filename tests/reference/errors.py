"""Errors of reconstructions, one pixel after the other: SSIM by its definition, gradients by Sobel's weights."""

import numpy as np

SOBEL = np.array([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]]) / 8


def ssim_per_pixel(images, outputs):
    """Return (1 - SSIM) / 2 averaged over the channels: Gaussian of 11 taps, σ 1.5, borders reflected."""
    taps = np.exp(-((np.arange(11) - 5) ** 2) / (2 * 1.5**2))
    window = np.outer(taps, taps) / taps.sum() ** 2
    n, channels, h, w = images.shape
    out = np.zeros((n, h, w))
    for i in range(n):
        for c in range(channels):
            a, b = (np.pad(x[i, c].astype(np.float64), 5, mode="reflect") for x in (images, outputs))
            for y in range(h):
                for x in range(w):
                    p, q = a[y : y + 11, x : x + 11], b[y : y + 11, x : x + 11]
                    mp, mq = (window * p).sum(), (window * q).sum()
                    vp, vq = (window * (p - mp) ** 2).sum(), (window * (q - mq) ** 2).sum()
                    both = (window * (p - mp) * (q - mq)).sum()
                    value = (2 * mp * mq + 1e-4) * (2 * both + 9e-4) / ((mp**2 + mq**2 + 1e-4) * (vp + vq + 9e-4))
                    out[i, y, x] += (1 - value) / 2 / channels
    return out


def gradient_per_pixel(images, outputs):
    """Return the length of the difference of Sobel's gradients, averaged over the channels, borders repeated."""
    n, channels, h, w = images.shape
    out = np.zeros((n, h, w))
    for i in range(n):
        for c in range(channels):
            a, b = (np.pad(x[i, c].astype(np.float64), 1, mode="edge") for x in (images, outputs))
            for y in range(h):
                for x in range(w):
                    d = a[y : y + 3, x : x + 3] - b[y : y + 3, x : x + 3]
                    out[i, y, x] += np.hypot((SOBEL * d).sum(), (SOBEL.T * d).sum()) / channels
    return out
