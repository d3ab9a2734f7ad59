"""How fast the stages are, each beside a baseline measured in the same run: python -m experiments.speed.stages

CPU seconds of one thread. U is the time of OpenCV's brute-force Hamming 2-NN of 1490 × 1490 descriptors, a unit that
travels between machines.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import cv2
import numpy as np
import torch

from fdslam import config
from fdslam.autoencoder.network import input_size
from fdslam.autoencoder.places import fit_places
from fdslam.bow.index import InvertedFile
from fdslam.bow.lists import ranks_of
from fdslam.bow.orb import extract
from fdslam.bow.vocabulary import Vocabulary
from fdslam.config import Autoencoder, Fd, Keypoints, Orb
from fdslam.data.campus import World
from fdslam.detectors.fault_diagnosis import loc_cells
from fdslam.harris_laplace import harris_laplace, sift
from fdslam.localization import keypoints_inside, strong_list
from fdslam.nearest import nearest_distance
from fdslam.progress import single_threaded
from tests import reference

KEYPOINTS, OBBS, HEIGHT, WIDTH = 1490, 64, 480, 640
Row = tuple[str, float, str, float]  # what, its seconds, a baseline, the baseline's seconds


def cpu_seconds(work: Callable[[], object], repeat: int = 3) -> float:
    """Return the least CPU time of ``repeat`` calls, after one that is not counted."""
    work()
    times = []
    for _ in range(repeat):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def random_descriptors() -> np.ndarray:
    """Return uint8 [KEYPOINTS, 32]."""
    return np.random.default_rng(1).integers(0, 256, (KEYPOINTS, 32), dtype=np.uint8)


def unit_seconds(descriptors: np.ndarray) -> float:
    """Return U: the CPU time of OpenCV's brute-force Hamming 2-NN of the descriptors among themselves."""
    matcher = cv2.BFMatcher(cv2.NORM_HAMMING)
    return cpu_seconds(lambda: matcher.knnMatch(descriptors, descriptors, 2))


def random_boxes(rng: np.random.Generator) -> np.ndarray:
    """Return OBBS boxes of many sizes: float32 [OBBS, 4] xyxy pixels."""
    size = np.exp(rng.uniform(np.log(40), np.log(400), (OBBS, 2)))
    corner = rng.uniform(0, 1, (OBBS, 2)) * np.maximum([WIDTH, HEIGHT] - size, 1)
    return np.concatenate([corner, np.minimum(corner + size, [WIDTH, HEIGHT])], axis=1).astype(np.float32)


def bag_of_words(unit: float, descriptors: np.ndarray) -> list[Row]:
    """Measure words, lists and FD."""
    rng = np.random.default_rng(0)
    rows: list[Row] = []
    vocabulary = Vocabulary(config.Vocabulary(exact_below=1 << 30))
    vocabulary.append(rng.integers(0, 256, (100_000, 32), dtype=np.uint8))
    rows.append(
        ("words of a query, 100,000 words, exact", cpu_seconds(lambda: vocabulary.match(descriptors)), "U", unit)
    )

    popularity = 1 / np.arange(1, 20_001)
    draw = partial(rng.choice, 20_000, KEYPOINTS, p=popularity / popularity.sum())
    index = InvertedFile([draw().astype(np.int32) for _ in range(500)], 20_000)
    words, boxes = draw().astype(np.int32), random_boxes(rng)
    xy = rng.uniform(0, 1, (KEYPOINTS, 2)) * [WIDTH, HEIGHT]
    inside = keypoints_inside(boxes, xy)

    def lists(which: np.ndarray) -> np.ndarray:
        return ranks_of(index.scores(words, which, "ibow"), "last")

    together = cpu_seconds(lambda: strong_list(lists(inside)))
    one_by_one = cpu_seconds(lambda: strong_list(np.concatenate([lists(row[None]) for row in inside])))
    rows.append(("64 weak lists and the strong one, M = 500", together, "one list at a time", one_by_one))

    ranks = rng.integers(1, 500, (OBBS, 10)).astype(np.int32)
    painted = cpu_seconds(lambda: loc_cells(boxes, ranks, HEIGHT, WIDTH, Fd()))
    loops = cpu_seconds(
        lambda: reference.fault_diagnosis(boxes, ranks, 48, 64, "min", "fuse_then_pool", "harmonic"), repeat=1
    )
    rows.append(
        ("FD of a query, 640 × 480, 64 OBBs, Y = 10", painted, "pixel by pixel", loops * HEIGHT * WIDTH / 48 / 64)
    )
    return rows


def images(unit: float) -> list[Row]:
    """Measure what works on pixels."""
    rng = np.random.default_rng(0)
    rows: list[Row] = []
    world = World(0, 384, 308, 404)
    image = world.view("AU", 1).image
    rows.append(("campus view 308 × 404", cpu_seconds(lambda: world.view("AU", 1)), "U", unit))
    rows.append(("ORB of a view, upscaled, on a grid", cpu_seconds(lambda: extract(image, Orb())), "U", unit))
    keypoints = harris_laplace(image, Keypoints())
    rows.append(("Harris-Laplace of a view", cpu_seconds(lambda: harris_laplace(image, Keypoints())), "U", unit))
    rows.append(("SIFT at them", cpu_seconds(lambda: sift(image, keypoints)), "U", unit))

    maps = [rng.integers(0, 256, (1500, 128), dtype=np.uint8) for _ in range(10)]
    one, stacked = maps[0].astype(np.float32), np.concatenate(maps).astype(np.float32)
    product = cpu_seconds(lambda: one @ stacked.T)
    rows.append(
        (
            "PC: 1500 SIFT in ten map images",
            cpu_seconds(lambda: nearest_distance(maps[0], maps)),
            "the product alone",
            product,
        )
    )

    size = input_size(404, 308, Autoencoder().pixels)
    batch = torch.from_numpy(rng.random((16, 3, *size), np.float32))
    training = Autoencoder(epochs=1, folds=2)
    rows.append(
        (
            "AE: an epoch of three trainings on 16 images",
            cpu_seconds(lambda: fit_places([batch], training, 0)),
            "U",
            unit,
        )
    )
    return rows


def measure() -> list[Row]:
    """Measure U, then every stage."""
    descriptors = random_descriptors()
    unit = unit_seconds(descriptors)
    itself = ("U: OpenCV 2-NN of 1490 × 1490", unit, "itself", unit)
    return [itself, *bag_of_words(unit, descriptors), *images(unit)]


def main() -> None:
    """Print the table."""
    single_threaded()
    print("| stage | ms | baseline | ms | stage / baseline |\n|---|---:|---|---:|---:|")
    for what, seconds, baseline, base in measure():
        print(f"| {what} | {1000 * seconds:.1f} | {baseline} | {1000 * base:.1f} | {seconds / base:.3g} |")


if __name__ == "__main__":
    main()
