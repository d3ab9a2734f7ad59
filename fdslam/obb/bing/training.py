"""Training of BING's two stages on images with boxes, both by linear support vector machines.

Stage I tells windows on objects (all with IoU ≥ 0.5) from random windows beside them. Scores are only ever compared
within a size there, so the windows beside weigh, size by size, as much as those on objects: otherwise the filter
learns which sizes are frequent. Mirrored windows count as well. Stage II tells, size by size, the windows that stage I
lets through and that are on an object from the others, by their score alone. Its loss is the squared hinge, whose
minimum is 2 P(object | score) − 1: that is what makes sizes comparable, so there nothing is weighted.

Source: Cheng et al., CVPR 2014, §3; which windows are drawn, and how they weigh, is ours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from sklearn.svm import LinearSVC

from fdslam.errors import InputError
from fdslam.obb.bing.binary import SIDE
from fdslam.obb.bing.filters import SIZES, Filters
from fdslam.obb.bing.gradient import normed_gradient
from fdslam.obb.bing.proposals import candidates, resized, resized_shape, window_boxes
from fdslam.obb.overlap import iou
from fdslam.progress import in_parallel
from fdslam.types import Image

T = TypeVar("T")
FOUND = 0.5  # IoU from which a window counts as an object's
_ITERATIONS = 10_000


@dataclass(frozen=True)
class Scene:
    """An image and what stands in it."""

    image: Image  # uint8 [H, W, 3] RGB
    objects: NDArray[np.float32]  # [n, 4] xyxy pixels, half-open
    ignored: NDArray[np.float32]  # [m, 4] xyxy: nearly hidden objects, neither right nor wrong to find


@dataclass(frozen=True)
class Training:
    """What the training can be told."""

    beside: int = 20  # random windows of every size in every image, less those that fall on an object
    least: int = 5  # windows on objects that a size needs, in stage I and in stage II, to become active
    first_c: float = 0.01  # C of stage I, on gradients as shares of 255: larger fits closer
    second_c: float = 10.0  # C of stage II, on scores of mean 0 and variance 1
    seed: int = 0


@dataclass(frozen=True)
class Windows:
    """Windows of one image, or of many, for stage I."""

    gradients: NDArray[np.uint8]  # [n, 8, 8]
    sizes: NDArray[np.int64]  # [n] indices into SIZES
    on: NDArray[np.bool_]  # [n] on an object


def _on_any(boxes: NDArray, objects: NDArray) -> NDArray[np.bool_]:
    """Tell which boxes are on any of the objects: bool [n]."""
    return np.asarray(np.any(iou(boxes, objects) >= FOUND, axis=1), np.bool_)


def windows(scene: Scene, space: str, beside: int, rng: np.random.Generator) -> Windows:
    """Draw the windows of one image: all on its objects, and at most ``beside`` of each size beside them."""
    gradients = [np.empty((0, SIDE, SIDE), np.uint8)]
    sizes: list[int] = []
    on: list[bool] = []
    for index, size in enumerate(SIZES):
        shape = resized_shape(scene.image, size)
        if shape is None:
            continue
        gradient = normed_gradient(resized(scene.image, shape), space)
        every = np.lib.stride_tricks.sliding_window_view(gradient, (SIDE, SIDE))
        every = every.reshape(-1, SIDE, SIDE)
        boxes = window_boxes(np.arange(len(every)), shape, scene.image)
        hit = _on_any(boxes, scene.objects)
        free = ~hit & ~_on_any(boxes, scene.ignored)
        drawn = rng.integers(0, len(every), beside)
        for chosen in (np.flatnonzero(hit), drawn[free[drawn]]):
            gradients.append(every[chosen])
            sizes += [index] * len(chosen)
            on += hit[chosen].tolist()
    return Windows(np.concatenate(gradients), np.array(sizes, np.int64), np.array(on, bool))


def joined(found: Sequence[Windows]) -> Windows:
    """Return the windows of several images as one."""
    return Windows(*(np.concatenate([getattr(one, name) for one in found]) for name in ("gradients", "sizes", "on")))


def fit_first(found: Windows, settings: Training) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the filter of stage I, float32 [8, 8], and the active sizes, int32 [n].

    Raises:
        InputError: too few objects for any size.
    """
    on, beside = (np.bincount(found.sizes[found.on == kind], minlength=len(SIZES)) for kind in (True, False))
    active = (on >= settings.least) & (beside > 0)
    if not active.any():
        raise InputError(
            f"BING: at most {on.max()} windows of one size lie on an object and {settings.least} are needed; train on "
            "more annotated images"
        )
    weight = np.where(found.on, 1.0, (on / np.maximum(beside, 1))[found.sizes])
    used = active[found.sizes]
    gradients, weight, truth = found.gradients[used], weight[used], found.on[used]
    rows = np.concatenate([gradients, gradients[:, :, ::-1]]).reshape(-1, SIDE * SIDE) / 255
    weight = np.concatenate([weight, weight]) / weight.mean()
    machine = LinearSVC(C=settings.first_c, dual=False, max_iter=_ITERATIONS)
    machine.fit(rows, np.concatenate([truth, truth]), sample_weight=weight)
    return (machine.coef_[0] / 255).reshape(SIDE, SIDE).astype(np.float32), np.flatnonzero(active).astype(np.int32)


def judged(scene: Scene, first: Filters) -> list[tuple[NDArray[np.float32], NDArray[np.bool_]]]:
    """Return for each active size the scores of the windows that stage I lets through, and which are on an object."""
    rows = []
    for found in candidates(scene.image, first):
        if found is None:
            rows.append((np.empty(0, np.float32), np.empty(0, bool)))
            continue
        on = _on_any(found.boxes, scene.objects)
        counts = on | ~_on_any(found.boxes, scene.ignored)
        rows.append((found.scores[counts], on[counts]))
    return rows


def fit_second(scores: NDArray[np.float32], on: NDArray[np.bool_], settings: Training) -> tuple[float, float]:
    """Return v and t of one size from the scores (float32 [n]) and which are on an object (bool [n], both kinds)."""
    mean, spread = float(scores.mean(dtype=np.float64)), float(scores.std(dtype=np.float64)) or 1.0
    rows = (scores[:, None].astype(np.float64) - mean) / spread
    machine = LinearSVC(C=settings.second_c, dual=False, intercept_scaling=10.0, max_iter=_ITERATIONS).fit(rows, on)
    v = float(machine.coef_[0, 0]) / spread
    return v, float(machine.intercept_[0]) - v * mean


def train(scenes: Sequence[Scene], space: str, settings: Training, workers: int = 1) -> Filters:
    """Train the filters of one colour space; the number of workers changes nothing but the time.

    Args:
        scenes: images with the boxes of their objects.
        space: a colour space of ``gradient.SPACES``.
        settings: what there is to choose.
        workers: threads, 0: one a core.

    Raises:
        InputError: too few objects to learn from.
    """
    found = _of_each(
        scenes, lambda i, one: windows(one, space, settings.beside, np.random.default_rng([settings.seed, i])), workers
    )
    first, active = fit_first(joined(found), settings)
    stage = Filters(space, first, active, np.zeros((len(active), 2), np.float32))
    rows = _of_each(scenes, lambda _, one: judged(one, stage), workers)
    sizes, second = [], []
    for which, index in enumerate(active.tolist()):
        scores = np.concatenate([row[which][0] for row in rows])
        on = np.concatenate([row[which][1] for row in rows])
        if settings.least <= np.count_nonzero(on) < len(on):
            sizes.append(index)
            second.append(fit_second(scores, on, settings))
    if not sizes:
        raise InputError("BING: stage I finds too few objects of any size; train on more annotated images")
    return Filters(space, first, np.array(sizes, np.int32), np.array(second, np.float32))


def _of_each(scenes: Sequence[Scene], what: Callable[[int, Scene], T], workers: int) -> list[T]:
    """Return ``what`` of each scene, in their order."""
    jobs = (lambda i=i, one=one: (i, what(i, one)) for i, one in enumerate(scenes))
    return [result for _, result in sorted(in_parallel(jobs, workers), key=lambda pair: pair[0])]
