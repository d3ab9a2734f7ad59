"""Batches with strong augmentation; each sample depends on the seed, the epoch and its number alone.

OpenCV augments here and not kornia: one core makes a sample in a few milliseconds, a tenth of what the network takes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.train.views import Views

GREY = 114  # around an image that does not fill the network's input
IGNORED = 255  # label of a pixel that does not count
LEFT = 0.35  # share of an object's box that must be left in a crop for the object to be asked for
FLOOR = 4.0  # pixels: an object narrower or lower than this in the network's input is not asked for
T = TypeVar("T")


@dataclass(frozen=True)
class Sample:
    """One input of a network and what it should say."""

    image: NDArray[np.uint8]  # [H, W, 3] RGB
    labels: NDArray[np.uint8]  # [H, W] indices into LABELS, or IGNORED
    classes: NDArray[np.int64]  # [k]
    boxes: NDArray[np.float32]  # [k, 4] xyxy
    clear: NDArray[np.bool_]  # [k]


def sample_of(views: Views, index: int) -> Sample:
    """Return a view as it is."""
    return Sample(views.images[index], views.labels[index], *views.of(index))


def placed(sample: Sample, matrix: NDArray[np.float64], height: int, width: int) -> Sample:
    """Return the sample under x' = a·x + b, y' = c·y + d in a window, a of either sign.

    Args:
        sample: the view.
        matrix: [2, 3] of a mapping between corners of pixels, without shear.
        height: of the window, pixels.
        width: of the window, pixels.
    """
    centres = matrix.copy()
    centres[:, 2] += 0.5 * matrix[:, :2].sum(1) - 0.5  # OpenCV's coordinates are those of pixel centres
    shrinks = abs(matrix[1, 1]) < 0.7
    source = sample.image
    if shrinks:  # a blur before sampling instead of aliases
        source = cv2.GaussianBlur(source, (0, 0), 0.4 / abs(matrix[1, 1]))
    image = cv2.warpAffine(source, centres, (width, height), flags=cv2.INTER_LINEAR, borderValue=(GREY,) * 3)
    labels = cv2.warpAffine(sample.labels, centres, (width, height), flags=cv2.INTER_NEAREST, borderValue=(IGNORED,))
    x = np.sort(sample.boxes[:, 0::2] * matrix[0, 0] + matrix[0, 2], axis=1)
    y = np.sort(sample.boxes[:, 1::2] * matrix[1, 1] + matrix[1, 2], axis=1)
    whole = (x[:, 1] - x[:, 0]) * (y[:, 1] - y[:, 0])
    x, y = x.clip(0, width), y.clip(0, height)
    wide, high = x[:, 1] - x[:, 0], y[:, 1] - y[:, 0]
    clear = sample.clear & (wide * high >= LEFT * whole) & (wide >= FLOOR) & (high >= FLOOR)
    boxes = np.stack([x[:, 0], y[:, 0], x[:, 1], y[:, 1]], 1).astype(np.float32)
    kept = (wide > 1) & (high > 1)
    return Sample(
        np.asarray(image, np.uint8), np.asarray(labels, np.uint8), sample.classes[kept], boxes[kept], clear[kept]
    )


def crop(
    rng: np.random.Generator,
    sample: Sample,
    base: tuple[float, float],
    scale: tuple[float, float],
    size: tuple[int, int],
    center: NDArray[np.float32] | None = None,
) -> Sample:
    """Cut a window out of a view that is scaled, stretched a little, and mirrored half of the time.

    Args:
        rng: draws.
        sample: the view.
        base: factors (x, y) from the view's pixels to the network's.
        scale: least and largest factor beyond that.
        size: height and width of the window.
        center: x and y of a point of the view that should be in the window; None: any.
    """
    height, width = size
    factor = np.exp(rng.uniform(*np.log(scale)))
    stretch = np.exp(rng.uniform(-0.12, 0.12))
    ax, ay = base[0] * factor * stretch, base[1] * factor / stretch
    rows, columns = sample.labels.shape
    room = np.array([columns * ax - width, rows * ay - height])  # negative: the view is smaller than the window
    if center is None:
        offset = rng.uniform(0, 1, 2) * room
    else:
        offset = center * (ax, ay) - rng.uniform(0.25, 0.75, 2) * (width, height)
        offset = np.clip(offset, np.minimum(0, room), np.maximum(0, room))
    matrix = np.array([[ax, 0, -offset[0]], [0, ay, -offset[1]]])
    if rng.random() < 0.5:
        matrix[0] = -matrix[0] + (0, 0, width)
    return placed(sample, matrix, height, width)


def mosaic(
    rng: np.random.Generator,
    views: Views,
    base: tuple[float, float],
    scale: tuple[float, float],
    size: tuple[int, int],
    evenly: float = 0.0,
) -> Sample:
    """Join four crops, each around an object, to one image: four times the objects for one pass of the network.

    Args:
        rng: draws.
        views: to draw from.
        base: see ``crop``.
        scale: see ``crop``.
        size: height and width of the image.
        evenly: an object of a kind that is n times as frequent as another is drawn ``n ** -evenly`` times as often.
    """
    height, width = size
    y, x = (round(rng.uniform(0.35, 0.65) * n / 8) * 8 for n in size)
    image = np.empty((height, width, 3), np.uint8)
    labels = np.empty((height, width), np.uint8)
    parts: list[tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.bool_]]] = []
    clear = np.flatnonzero(views.clear)
    kinds = views.classes[clear]
    weight = np.cumsum(np.bincount(kinds)[kinds] ** -evenly)
    for rows in (slice(0, y), slice(y, height)):
        for columns in (slice(0, x), slice(x, width)):
            k = clear[np.searchsorted(weight, rng.uniform(0, weight[-1]), side="right").clip(0, len(clear) - 1)]
            box = views.boxes[k]
            tile = rows.stop - rows.start, columns.stop - columns.start
            middle = (box[:2] + box[2:]) / 2
            cut = crop(rng, sample_of(views, int(views.view[k])), base, scale, tile, middle)
            image[rows, columns], labels[rows, columns] = cut.image, cut.labels
            shift = np.array([columns.start, rows.start] * 2, np.float32)
            parts.append((cut.classes, cut.boxes + shift, cut.clear))
    classes, boxes, seen = (np.concatenate(group) for group in zip(*parts, strict=True))
    return Sample(image, labels, classes, boxes, seen)


def recolored(rng: np.random.Generator, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Change light, contrast, hue and saturation, then blur, add noise and compress, each some of the time."""
    if rng.random() < 0.8:
        angle, saturation = rng.normal(0, 0.12), np.exp(rng.normal(0, 0.3))
        if rng.random() < 0.08:
            saturation = 0.0
        grey = np.full((3, 3), 1 / 3)
        axis = np.array([[0, -1, 1], [1, 0, -1], [-1, 1, 0]]) / np.sqrt(3)
        turn = grey + (np.eye(3) - grey) * np.cos(angle) + axis * np.sin(angle)  # about the axis of greys: a hue
        mix = np.diag(np.exp(rng.normal(0, 0.06, 3))) @ (grey + saturation * (turn - grey))
        image = cv2.transform(image, mix)
        levels = (np.arange(256) / 255) ** np.exp(rng.normal(0, 0.25))
        levels = (levels - 0.5) * np.exp(rng.normal(0, 0.2)) + 0.5 + rng.normal(0, 0.08)
        image = cv2.LUT(image, np.clip(levels * 255, 0, 255).astype(np.uint8))
    if rng.random() < 0.2:
        image = cv2.GaussianBlur(image, (0, 0), rng.uniform(0.4, 1.3))
    if rng.random() < 0.3:
        noise = np.empty(image.shape, np.int16)
        cv2.setRNGSeed(int(rng.integers(2**31 - 1)))
        cv2.randn(noise, (0,) * 3, (rng.uniform(1, 9),) * 3)
        image = cv2.add(image, noise, dtype=cv2.CV_8U)
    if rng.random() < 0.25:
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(25, 90))]
        image = cv2.imdecode(cv2.imencode(".jpg", image, quality)[1], cv2.IMREAD_COLOR)
    return np.asarray(image, np.uint8)


def batches(
    count: int, size: int, seed: int, epoch: int, make: Callable[[np.random.Generator, int], T], ahead: int = 2
) -> Iterator[list[T]]:
    """Yield the samples of an epoch in a random order; a thread makes the next batches meanwhile.

    Args:
        count: of samples.
        size: of a batch; what is left over is dropped.
        seed: of the training.
        epoch: which.
        make: makes sample ``index`` with a generator of its own.
        ahead: batches made in advance.
    """
    order = np.random.default_rng([seed, epoch]).permutation(count)
    groups = [order[i : i + size] for i in range(0, count - size + 1, size)]

    def build(group: Sequence[int]) -> list[T]:
        return [make(np.random.default_rng([seed, epoch, int(i)]), int(i)) for i in group]

    with ThreadPoolExecutor(1) as pool:
        waiting = [pool.submit(build, g.tolist()) for g in groups[:ahead]]
        for g in [*groups[ahead:], *[None] * min(ahead, len(groups))]:
            ready = waiting.pop(0).result()
            if g is not None:
                waiting.append(pool.submit(build, g.tolist()))
            yield ready
