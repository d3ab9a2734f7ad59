"""Small places and a small network, for the tests of this folder."""

import cv2
import numpy as np

from fdslam.autoencoder.network import prepare
from fdslam.config import Autoencoder

SMALL = Autoencoder(channels=4, latent=16, epochs=4, patience=2, batch=4, learning_rate=2e-3, folds=3)
SIZE = (32, 48)


def place(count, seed=0, height=32, width=48, step=2):
    """A scene seen from ``count`` positions of a path: a textured wall that slides by, ``step`` pixels an image."""
    noise = np.random.default_rng(seed).integers(0, 256, (5, 12, 3), dtype=np.uint8)
    wall = cv2.resize(noise, (2 * width, height), interpolation=cv2.INTER_CUBIC)
    return prepare([wall[:, step * i : step * i + width] for i in range(count)], (height, width))


def bytes_of(model):
    arrays = [model.weights[name] for name in sorted(model.weights)] + [model.training, model.validation]
    return b"".join(a.tobytes() for a in arrays), model.held_out, model.own, model.epochs
