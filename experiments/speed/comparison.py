"""What PC costs at the paper's size, in one run with its baselines: python -m experiments.speed.comparison

CPU time of one thread, on a campus view of 1232 × 1616: Harris-Laplace keypoints beside OpenCV's own detector, SIFT
at them beside OpenCV's at its own, and the comparison with ten map images beside the plain matrix product.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import cv2
import numpy as np

from experiments.speed.stages import Row, cpu_seconds, random_descriptors, unit_seconds
from fdslam.config import Keypoints
from fdslam.data.campus import World
from fdslam.harris_laplace import HarrisLaplace, harris_laplace, sift
from fdslam.nearest import LENGTH, nearest_distance
from fdslam.progress import single_threaded

HEIGHT, WIDTH, MAPS = 1616, 1232, 10


def features(height: int, width: int) -> tuple[list[Row], np.ndarray]:
    """Measure keypoints and descriptors of one view; also return the descriptors, uint8 [n, 128]."""
    image = World(0, 2959, width, height).view("SU", 0).image
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    opencv = cv2.SIFT.create(Keypoints().keypoints)
    own = opencv.detect(grey)
    detected = cpu_seconds(lambda: opencv.detect(grey))
    described = cpu_seconds(lambda: opencv.compute(grey, own))
    found = harris_laplace(image, Keypoints())
    _, first = np.unique(found.scale, return_index=True)  # one of each scale needs the same pyramid as all
    few = HarrisLaplace(found.xy[first], found.scale[first], found.response[first])
    n = len(found.scale)
    rows: list[Row] = [
        (f"Harris-Laplace, {n} keypoints", cpu_seconds(lambda: harris_laplace(image, Keypoints())), "detect", detected),
        (f"SIFT at the {n}", cpu_seconds(lambda: sift(image, found)), "compute", described),
        ("of it the pyramid", cpu_seconds(lambda: sift(image, few)), "compute", described),
    ]
    return rows, sift(image, found).astype(np.uint8)


def alike(descriptors: np.ndarray, seed: int) -> np.ndarray:
    """Return as many descriptors in another order, each entry up to 8 away: another view of the same place."""
    rng = np.random.default_rng(seed)
    moved = rng.permutation(descriptors).astype(int) + rng.integers(-8, 9, descriptors.shape)
    return moved.clip(0, 255).astype(np.uint8)


def neighbours(query: np.ndarray) -> tuple[list[Row], list[tuple[str, float]]]:
    """Measure the comparison with all hypotheses; also return rates in floating point operations per second."""
    maps = [alike(query, seed) for seed in range(MAPS)]
    q, m = query.astype(np.float32), np.concatenate(maps).astype(np.float32)
    result = np.empty((len(m), len(q)), np.float32)
    square = np.random.default_rng(0).random((2048, 2048), np.float32)
    product = cpu_seconds(lambda: np.matmul(m, q.T, out=result), 7)
    ours = cpu_seconds(lambda: nearest_distance(query, maps), 7)
    largest = cpu_seconds(lambda: square @ square, 7)
    flops = 2 * LENGTH * len(q) * len(m)
    rates = [("nearest_distance", flops / ours), ("the product alone", flops / product)]
    rates.append(("2048 × 2048 × 2048", 2 * len(square) ** 3 / largest))
    return [(f"nearest of {MAPS} map images", ours, "the product alone", product)], rates


def table(unit: float, rows: Iterable[Row], rates: Iterable[tuple[str, float]]) -> str:
    """Return the measurements as Markdown."""
    lines = ["| what | ms | baseline | ms | / baseline | / U |", "|---|---:|---|---:|---:|---:|"]
    lines += [
        f"| {what} | {1000 * s:.1f} | {baseline} | {1000 * base:.1f} | {s / base:.2f} | {s / unit:.2f} |"
        for what, s, baseline, base in rows
    ]
    lines += ["", "| product | GFLOP/s |", "|---|---:|", *(f"| {what} | {rate / 1e9:.1f} |" for what, rate in rates)]
    return "\n".join(lines)


def main(say: Callable[[str], None] = print) -> None:
    """Print the tables."""
    single_threaded()
    unit = unit_seconds(random_descriptors())
    rows, descriptors = features(HEIGHT, WIDTH)
    more, rates = neighbours(descriptors)
    say(f"U = {1000 * unit:.1f} ms; a view of {WIDTH} × {HEIGHT}\n\n{table(unit, [*rows, *more], rates)}")


if __name__ == "__main__":
    main()
