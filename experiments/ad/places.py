"""How good places by appearance are, with the global descriptor of the pipeline and with others.

    python -m experiments.ad.places dataset=folder dataset.root=../shared/data/camvid_changes
    python -m experiments.ad.places dataset=campus

Takes the keys of ``python -m fdslam.run``. *Neighbours*: share of map images whose successor on the path is in the same
place. *By hypothesis*: share of queries whose best hypothesis is in the place of the true map image, which decides
whether AD asks the right autoencoder. *By look*: the same for the place whose centre is nearest to the query's own
descriptor. *recall@1*: the map image with the nearest descriptor is of the query's place. Means over three seeds of
k-means.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import KMeans

from fdslam.bow.orb import extract
from fdslam.compose import configured
from fdslam.config import Config, Mix, Orb
from fdslam.data.images import read_image
from fdslam.pipeline import Outcome, run
from fdslam.places import global_descriptor, place_classes
from fdslam.provenance import Stopwatch
from fdslam.run import check_surroundings
from fdslam.types import Image

SEEDS, CENTRES, SAMPLE = 3, 32, 20_000  # of k-means; of VLAD; keypoints that VLAD's centres are learned from
Describe = Callable[[Image], NDArray[np.float32]]


def thumbnail(image: Image) -> NDArray[np.float32]:
    """Return the image at 8 × 8 pixels, in 0..1: float32 [192]."""
    return cv2.resize(image, (8, 8), interpolation=cv2.INTER_AREA).astype(np.float32).ravel() / 255


def _bits(image: Image) -> NDArray[np.float32]:
    return np.unpackbits(extract(image, Orb()).descriptors, axis=1).astype(np.float32) * 2 - 1


def vlad(images: list[Image]) -> Describe:
    """Return VLAD over ORB (Jégou et al. 2010), its centres learned from the map: float32 [CENTRES · 256], length 1."""
    bits = np.concatenate([_bits(image) for image in images])
    some = np.random.default_rng(0).permutation(len(bits))[:SAMPLE]
    centres = KMeans(CENTRES, n_init=1, max_iter=20, random_state=0).fit(bits[some]).cluster_centers_

    def describe(image: Image) -> NDArray[np.float32]:
        mine = _bits(image)
        nearest = ((centres**2).sum(axis=1) - 2 * mine @ centres.T).argmin(axis=1)
        total = np.zeros_like(centres)
        np.add.at(total, nearest, mine - centres[nearest])
        total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-9)
        return (total / max(np.linalg.norm(total), 1e-9)).ravel().astype(np.float32)

    return describe


def line(name: str, describe: Describe, config: Config, outcome: Outcome) -> str:
    """Return the row of a descriptor."""
    data = outcome.dataset
    assert data.relevant is not None
    there, asked = (np.stack([describe(read_image(f.path)) for f in frames]) for frames in (data.map, data.query))
    known = [q for q, truth in enumerate(data.relevant) if len(truth)]
    truth = np.array([data.relevant[q][0] for q in known])
    best = np.array([outcome.hypotheses[q][0] for q in known])
    steps = np.abs(np.diff(data.times))
    joined = steps <= 3 * np.median(steps)  # not from the end of one drive to the start of the next
    nearest = ((asked[known][:, None] - there) ** 2).sum(axis=2).argmin(axis=1)
    recall = np.mean([m in data.relevant[q] for q, m in zip(known, nearest, strict=True)])
    rows = []
    for seed in range(SEEDS):
        label = place_classes(there, config.ad.k, seed)
        centres = np.stack([there[label == i].mean(axis=0) for i in range(label.max() + 1)])
        look = ((asked[known][:, None] - centres) ** 2).sum(axis=2).argmin(axis=1)
        neighbours = (label[1:] == label[:-1])[joined].mean()
        rows.append((neighbours, (label[best] == label[truth]).mean(), (look == label[truth]).mean()))
    mean = np.mean(rows, axis=0)
    return f"| {name} | {mean[0]:.3f} | {mean[1]:.3f} | {mean[2]:.3f} | {recall:.3f} |"


def main() -> None:
    """Print the table."""
    config = configured(sys.argv[1:])
    config = replace(config, mix=Mix(rows=["FD"]), evaluation=replace(config.evaluation, curve_Y=[], bootstrap=10))
    check_surroundings(config)
    outcome = run(config, Stopwatch())
    print("| descriptor | neighbours | by hypothesis | by look | recall@1 |\n|---|---:|---:|---:|---:|")
    print(line("thumbnail 8 × 8", thumbnail, config, outcome))
    print(line("oriented gradients (the pipeline's)", global_descriptor, config, outcome))
    print(line("VLAD of ORB", vlad([read_image(frame.path) for frame in outcome.dataset.map]), config, outcome))


if __name__ == "__main__":
    main()
