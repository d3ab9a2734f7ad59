"""What the classes of a segmentation model are, as labels of ``fdslam.types.LABELS``.

Ground is where one drives or walks; sky is sky; the rest matters to nobody but a reader of pictures.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fdslam.types import LABELS

ADE20K_32 = (
    "other", "wall", "building", "sky", "floor", "tree", "ceiling", "road", "bed", "windowpane", "grass", "cabinet",
    "sidewalk", "person", "earth", "door", "table", "mountain", "plant", "curtain", "chair", "car", "water", "painting",
    "sofa", "shelf", "house", "sea", "mirror", "rug", "field", "armchair",
)  # fmt: skip
CITYSCAPES_19 = (
    "road", "sidewalk", "building", "wall", "fence", "pole", "traffic light", "traffic sign", "vegetation", "terrain",
    "sky", "person", "rider", "car", "truck", "bus", "train", "motorcycle", "bicycle",
)  # fmt: skip
LABEL_MAPS: dict[str, tuple[str, ...]] = {"ade20k32": ADE20K_32, "cityscapes19": CITYSCAPES_19, "campus": LABELS}

_MEMBERS = {
    "sky": ("sky",),
    "ground": ("ground", "floor", "road", "grass", "sidewalk", "earth", "field", "terrain"),
    "building": ("building", "wall", "ceiling", "windowpane", "door", "house", "fence"),
    "vegetation": ("vegetation", "tree", "plant", "mountain"),
}
_LABEL_OF = {name: label for label, names in _MEMBERS.items() for name in names}
KNOWN = {name for names in LABEL_MAPS.values() for name in names}


def labels_of(names: Sequence[str]) -> NDArray[np.uint8]:
    """Return the index into ``LABELS`` of every class: uint8 [classes]; what is neither of the above is an object."""
    return np.array([LABELS.index(_LABEL_OF.get(name, "object")) for name in names], np.uint8)


def custom(classes: int, sky: Sequence[int], ground: Sequence[int]) -> NDArray[np.uint8]:
    """Return the same for classes given by number."""
    found = np.full(classes, LABELS.index("object"), np.uint8)
    found[list(sky)], found[list(ground)] = LABELS.index("sky"), LABELS.index("ground")
    return found
