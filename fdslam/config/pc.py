"""The switches of pairwise comparison (§PC)."""

from __future__ import annotations

from dataclasses import dataclass

from fdslam.config.options import Checked, option


@dataclass
class Keypoints(Checked):
    """Harris-Laplace keypoints of pairwise comparison."""

    keypoints: int = option(1500, "the strongest keypoints kept per image", low=1, high=100_000)
    harris_k: float = option(0.04, "k of det - k tr²", low=0, high=0.25)
    min_side: int = option(720, "upscale images whose shorter side is below this, pixels; 0: never", low=0, high=8192)
    sigma: float = option(1.5, "the finest integration scale σ_I, pixels of the upscaled image", low=1, high=16)
    scale_step: float = option(1.4, "ratio of neighbouring scales", low=1.05, high=2)
    scales: int = option(8, "number of scales, the two outermost only compared with", low=3, high=32)


@dataclass
class Comparison(Keypoints):
    """What decides the LoC."""

    spread: str = option(
        "cell",
        "keypoints to cells: the maximum in a cell, that blurred, or that divided by the blurred occupancy",
        choices=("cell", "gaussian", "normalised"),
    )
    spread_sigma: float = option(1.5, "of the blur, cells", low=0.1, high=20)
    spread_prior: float = option(
        0.15,
        "of spread=normalised: added to the occupancy, so that cells far from keypoints go to 0",
        low=1e-6,
        high=1e6,
    )
    descriptors: str = option(
        "exact",
        "what is kept of the map's SIFTs: their 128 bytes, or product-quantised codes",
        choices=("exact", "pq"),
    )
    code_bytes: int = option(16, "of descriptors=pq: bytes of a code", choices=(4, 8, 16, 32, 64))


@dataclass
class Pc(Comparison):
    """Pairwise comparison (§PC)."""

    threads: int = option(1, "threads of one query's comparison. Never changes a result", low=1, high=1024)
