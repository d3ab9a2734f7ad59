"""The schema of anomaly detection: places, autoencoders, and how their error becomes a likelihood of change."""

from __future__ import annotations

from dataclasses import dataclass

from fdslam.config.options import Checked, option

ERRORS = ("l1", "ssim", "gradient")


@dataclass
class Places(Checked):
    """Partition of the map images into places (§AD)."""

    k: int = option(10, "number of places and of autoencoders", low=1, high=10_000)
    places: str = option("appearance", "k-means on what", choices=("appearance", "pose", "time"))


@dataclass
class Autoencoder(Checked):
    """One convolutional autoencoder and its training."""

    pixels: int = option(
        12_288, "area of the AE's input; its sides are multiples of 16 at the image's aspect", low=1024, high=1_048_576
    )
    channels: int = option(16, "channels of the first block, doubled by each of the four", low=1, high=256)
    latent: int = option(128, "size of the code", low=1, high=4096)
    epochs: int = option(60, "most epochs", low=1, high=100_000)
    patience: int = option(12, "epochs without a better held-out loss before stopping", low=1, high=100_000)
    batch: int = option(8, "images per step", low=1, high=4096)
    learning_rate: float = option(2e-3, "of Adam", low=1e-8, high=1)
    folds: int = option(
        3, "cross-fitting folds inside a place: they give μ, σ and the number of epochs", low=2, high=100
    )


@dataclass
class Ad(Places, Autoencoder):
    """Anomaly detection (§AD)."""

    train: str = option(
        "auto",
        "all AEs in one batched pass, or each in a thread of its own; auto: what is faster, together on a GPU and "
        "apart on a CPU",
        choices=("auto", "together", "apart"),
    )
    error: str = option("l1", "what the AE could not reconstruct: |I - I'|, 1 - SSIM, or |∇I - ∇I'|", choices=ERRORS)
    region: str = option(
        "pixel", "V_RE at each pixel, or its mean over each OBB, painted on the OBB", choices=("pixel", "obb")
    )
    c: float = option(0.8, "normaliser coefficient of z = (RE - μ) / (c σ)", low=1e-6, high=1e6)
    hypotheses: str = option(
        "top1", "the AE of the best hypothesis, or the smallest z over the top Y", choices=("top1", "min")
    )

    def together(self, device: str) -> bool:
        """Whether all AEs are trained in one batched pass on that device."""
        return self.train == "together" or (self.train == "auto" and device != "cpu")
