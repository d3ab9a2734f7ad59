"""Semantic segmentation by an ONNX model such as DeepLabV3+: a label image for every image (§Performance).

The image is stretched to the input's size (averaged over areas where that has less than half as many pixels). Classes
become labels before anything is resized: of the logits of all classes that are one label the largest counts, which
leaves the winner of every pixel the label it had; these few maps are brought to the image's size linearly, and there
the largest wins. A model that puts out classes instead of logits is brought to it by the nearest pixel.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.config import Mask
from fdslam.errors import InputError
from fdslam.onnx_model import load_model, shipped
from fdslam.segmentation.label_maps import KNOWN, LABEL_MAPS, custom, labels_of
from fdslam.types import LABELS, Image

SHIPPED = "deeplabv3plus_campus.onnx"
_GREY = 128  # of the image that is looked at once to see what comes out
NORMALISATIONS: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {  # mean and std of the channels in RGB order
    "signed": ((128.0,) * 3, (128.0,) * 3),
    "unit": ((0.0,) * 3, (255.0,) * 3),
    "imagenet": ((123.675, 116.28, 103.53), (58.395, 57.12, 57.375)),
    "raw": ((0.0,) * 3, (1.0,) * 3),
}


class Segmentation:
    """A model and what its classes are. Threads may share it."""

    def __init__(self, config: Mask, device: str = "cpu") -> None:
        """Read the model and see what it puts out.

        Args:
            config: the switches.
            device: cpu or cuda.

        Raises:
            InputError: a model that is missing, damaged or no segmentation, or that does not fit the label map.
        """
        self.config = config
        way_out = "check the path, or run with mask=none"
        if not config.weights:
            way_out = (
                "it is the shipped model and not part of this installation; give mask.weights=FILE (docs/models.md), "
                "or run with mask=none"
            )
        self.model = load_model(config.weights or shipped(SHIPPED), "mask.weights", way_out, config.threads, device)
        self.height, self.width = self.model.height or config.side, self.model.width or config.side
        self.channels = config.channels if config.channels != "auto" else self.model.says("channels", ("rgb", "bgr"))
        self.channels = self.channels or "rgb"
        self.mean, self.std = self._normalisation()
        outputs = self.model.run(self._entering(np.full((self.height, self.width, 3), _GREY, np.uint8)))
        self.axis = self._class_axis(outputs)
        self.labels_of_classes = self._label_map(outputs[0].shape[self.axis] if self.axis else 0)

    def _normalisation(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        told = self.config.normalise
        mean, std = NORMALISATIONS[told if told != "auto" else "signed"]
        says = self.model.numbers("mean"), self.model.numbers("std")
        if told == "auto" and any(says):
            if [len(one) for one in says] != [3, 3] or min(says[1]) <= 0:
                raise InputError(
                    f"{self.model.where}: its metadata say fdslam.mean={list(says[0])} fdslam.std={list(says[1])}; "
                    "three numbers each are needed, or mask.normalise"
                )
            mean, std = says
        return np.array(mean, np.float32), np.array(std, np.float32)

    def _entering(self, image: Image) -> NDArray[np.float32]:
        """Return the image as it enters the model: float32 [height, width, 3]."""
        size = self.width, self.height
        smaller = image.shape[0] * image.shape[1] > 2 * size[0] * size[1]
        resized = cv2.resize(image, size, interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)
        normal = (resized.astype(np.float32) - self.mean) / self.std
        return np.asarray(normal[..., ::-1] if self.channels == "bgr" else normal, np.float32)

    def _class_axis(self, outputs: list[NDArray]) -> int:
        """Return which axis of the output counts classes, 0 where it holds their numbers."""
        shapes = ", ".join(f"{output.dtype} {list(output.shape)}" for output in outputs)
        expected = (
            "one output is expected: logits [1, classes, h, w] or [1, h, w, classes], or the numbers of classes "
            "as integers, [1, h, w] or [1, 1, h, w]"
        )
        [output] = outputs if len(outputs) == 1 else [np.empty(0)]
        shape = output.shape
        if np.issubdtype(output.dtype, np.integer) and output.ndim in (3, 4):
            if shape[0] == 1 and (output.ndim == 3 or 1 in (shape[1], shape[3])):
                return 0
        elif output.ndim == 4 and shape[0] == 1:
            # Two axes have the aspect of the input, and the third counts classes; of a cube's, the first.
            planes = {1: shape[2:], 3: shape[1:3]}
            fitting = [axis for axis, (h, w) in planes.items() if h * self.width == w * self.height]
            axis = fitting[0] if fitting else min(planes, key=lambda axis: shape[axis])
            if shape[axis] > 1:
                return axis
        raise InputError(f"{self.model.where}: its outputs are {shapes}; {expected}")

    def _label_map(self, classes: int) -> NDArray[np.uint8]:
        """Return the label of every class; ``classes`` is 0 where the model puts out numbers of unknown range."""
        told, names = self.config.label_map, tuple(name.lower() for name in self.model.names())
        if told == "custom":
            return self._custom(classes or 1 + max([*self.config.sky, *self.config.ground], default=0))
        if told == "auto":
            told = "as the model names them" if names and set(names) <= KNOWN else self._by_number(classes)
        found = LABEL_MAPS.get(told, names)
        if classes and len(found) != classes:
            raise InputError(
                f"{self.model.where}: puts out {classes} classes, mask.label_map={told} has {len(found)}; "
                f"choose another of {', '.join(LABEL_MAPS)}, or custom with mask.sky and mask.ground"
            )
        return labels_of(found)

    def _by_number(self, classes: int) -> str:
        fitting = [name for name, names in LABEL_MAPS.items() if len(names) == classes]
        if len(fitting) != 1:
            count = f"{classes} classes" if classes else "numbers of classes"
            raise InputError(
                f"{self.model.where}: puts out {count} and does not say what they are; choose mask.label_map of "
                f"{', '.join(f'{name} ({len(names)})' for name, names in LABEL_MAPS.items())}, or custom with mask.sky "
                "and mask.ground"
            )
        return fitting[0]

    def _custom(self, classes: int) -> NDArray[np.uint8]:
        sky, ground = self.config.sky, self.config.ground
        if not sky and not ground:
            raise InputError("mask.label_map=custom: say which classes are meant with mask.sky=[…] and mask.ground=[…]")
        if both := set(sky) & set(ground):
            raise InputError(f"mask.sky and mask.ground: both hold class {min(both)}")
        if beyond := [one for one in (*sky, *ground) if one >= classes]:
            raise InputError(f"mask.label_map=custom: class {beyond[0]} is not among the model's {classes}")
        return custom(classes, sky, ground)

    @property
    def identity(self) -> dict[str, Any]:
        """Whatever decides the labels of an image; threads do not."""
        return {
            **self.model.identity,
            "input": [self.channels, self.height, self.width, self.mean.tolist(), self.std.tolist()],
            "labels": self.labels_of_classes.tolist(),
        }

    def labels(self, image: Image) -> NDArray[np.uint8]:
        """Return the label of every pixel of an image (uint8 RGB [H, W, 3]): uint8 [H, W], indices into ``LABELS``.

        Raises:
            InputError: what comes out is not finite, or a class that the label map does not have.
        """
        [output] = self.model.run(self._entering(image))
        size = image.shape[1], image.shape[0]
        if not self.axis:
            return cv2.resize(self._looked_up(output), size, interpolation=cv2.INTER_NEAREST).astype(np.uint8)
        logits = output[0] if self.axis == 1 else output[0].transpose(2, 0, 1)
        if not np.isfinite(logits).all():
            raise InputError(
                f"{self.model.where}: its output is not finite; the model is damaged or mask.normalise is wrong"
            )
        present = np.unique(self.labels_of_classes)
        maps = [logits[self.labels_of_classes == label].max(axis=0).astype(np.float32) for label in present]
        return _winners(maps, present, size)

    def _looked_up(self, output: NDArray) -> NDArray[np.uint8]:
        numbers = output.reshape(
            [side for side in output.shape[1:] if side != 1] if output.ndim == 4 else output.shape[1:]
        )
        if self.config.label_map == "custom":  # the other classes need not be told, and how many there are is not known
            numbers = np.where((numbers < 0) | (numbers >= len(self.labels_of_classes)), -1, numbers)
            return np.append(self.labels_of_classes, np.uint8(LABELS.index("object")))[numbers]
        if numbers.min() < 0 or numbers.max() >= len(self.labels_of_classes):
            raise InputError(
                f"{self.model.where}: puts out class {numbers.max()}, mask.label_map={self.config.label_map} has "
                f"{len(self.labels_of_classes)}; choose the label map that the model was trained with"
            )
        return self.labels_of_classes[numbers]


def _winners(maps: list[NDArray[np.float32]], names: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the name of the map that is largest at each pixel, the first of equals, at ``size`` = (width, height)."""
    best = np.asarray(cv2.resize(maps[0], size, interpolation=cv2.INTER_LINEAR))
    found = np.full(best.shape, names[0])
    # In one buffer, and against the best so far: all maps at full size would take longer to allocate than to compare.
    one, better = np.empty_like(best), np.empty_like(found)
    for name, values in zip(names[1:], maps[1:], strict=True):
        cv2.resize(values, size, dst=one, interpolation=cv2.INTER_LINEAR)
        cv2.compare(one, best, cv2.CMP_GT, dst=better)
        cv2.max(one, best, dst=best)
        np.copyto(found, name, where=better.view(bool))
    return found
