"""How fast BING is, beside what it cannot do without: python -m experiments.speed.bing

CPU milliseconds of one thread, on a campus view of 480 × 360 and the 28 window sizes of the published filters. The
baseline resizes the view to each of them and takes both Sobel derivatives, all in OpenCV; U as in stages.py.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from experiments.speed.stages import cpu_seconds, random_descriptors, unit_seconds
from fdslam.data.campus import World
from fdslam.obb.bing import Filters, own_filters, proposals
from fdslam.obb.bing.binary import binarise, score_map
from fdslam.obb.bing.filters import SIZES
from fdslam.obb.bing.gradient import SPACES, normed_gradient
from fdslam.obb.bing.proposals import PER_SIZE, RADIUS, resized, resized_shape
from fdslam.obb.bing.suppression import best_windows
from fdslam.progress import single_threaded
from fdslam.types import Image

HEIGHT, WIDTH = 360, 480
LEFT_OUT = {3, 4, 5, 10, 11, 24, 30, 31}  # of the 36 sizes; the published filters know the others
REPEAT = 10


def filters(space: str) -> Filters:
    """Return filters of a colour space for the 28 sizes; what they hold makes no difference to the time."""
    sizes = np.array([i for i in range(len(SIZES)) if i not in LEFT_OUT], np.int32)
    second = np.tile(np.array([1, -1], np.float32), (len(sizes), 1))
    return Filters(space, own_filters()[0].first, sizes, second)


def works(image: Image) -> dict[str, Callable[[], object]]:
    """Return what is measured; the first is the baseline."""
    spaces = {space: filters(space) for space in SPACES}
    one = spaces["maxbgr"]
    shapes = [shape for i in one.sizes if (shape := resized_shape(image, SIZES[i])) is not None]
    beta, signs = binarise(one.first)
    gradients = [normed_gradient(resized(image, shape), "maxbgr") for shape in shapes]
    scores = [score_map(gradient, beta, signs) for gradient in gradients]

    def baseline() -> None:
        for shape in shapes:
            small = cv2.resize(image, shape[::-1])
            for order in ((1, 0), (0, 1)):
                cv2.Sobel(small, cv2.CV_16S, *order)

    return {
        "baseline: resize and Sobel": baseline,
        **{f"50 proposals, {space}": lambda one=one: proposals(image, one, 50) for space, one in spaces.items()},
        "50 proposals, three colour spaces": lambda: proposals(image, list(spaces.values()), 50),
        "1000 proposals, maxbgr": lambda: proposals(image, one, 1000),
        "of it resize and gradients": lambda: [normed_gradient(resized(image, shape), "maxbgr") for shape in shapes],
        "of it score maps": lambda: [score_map(gradient, beta, signs) for gradient in gradients],
        "of it suppression": lambda: [best_windows(s, RADIUS, PER_SIZE) for s in scores],
        "50 proposals, the package's filters": lambda: proposals(image, own_filters(), 50),
    }


def main() -> None:
    """Print the table."""
    single_threaded()
    unit = unit_seconds(random_descriptors())
    image = World(0, 384, WIDTH, HEIGHT).view("AU", 1).image
    seconds = {name: cpu_seconds(work, REPEAT) for name, work in works(image).items()}
    base = next(iter(seconds.values()))
    print(f"U = {1000 * unit:.1f} ms; {WIDTH} × {HEIGHT}, 28 sizes, one thread\n")
    print("| what | ms | / baseline | / U |\n|---|---:|---:|---:|")
    for name, took in seconds.items():
        print(f"| {name} | {1000 * took:.2f} | {took / base:.2f} | {took / unit:.2f} |")


if __name__ == "__main__":
    main()
