import numpy as np
import pytest

from fdslam.config import Bing, Obb, Yolo
from fdslam.errors import InputError
from fdslam.obb import Library, parse_library
from fdslam.obb.templates import TEMPLATES, template_boxes

COUNTS = {"A": 1, "B": 4, "C": 2, "D": 3, "E": 1, "F": 3, "G": 3, "H": 9, "I": 6, "J": 15}


def covered(boxes, height, width):
    count = np.zeros((height, width), int)
    for x0, y0, x1, y1 in boxes.astype(int):
        count[y0:y1, x0:x1] += 1
    return count


@pytest.mark.parametrize("name", TEMPLATES)
@pytest.mark.parametrize("size", [(404, 308), (360, 480), (97, 61)])
def test_counts_and_bounds(name, size):
    height, width = size
    boxes = template_boxes(name, height, width)
    assert boxes.shape == (COUNTS[name], 4)
    assert boxes.dtype == np.float32
    assert (boxes[:, :2] >= 0).all()
    assert (boxes[:, 2] <= width).all()
    assert (boxes[:, 3] <= height).all()
    assert (boxes[:, 2:] > boxes[:, :2]).all()
    assert len(np.unique(boxes, axis=0)) == len(boxes)


@pytest.mark.parametrize("name", ["A", "B", "C", "D", "I"])
def test_partitions_cover_every_pixel_once(name):
    assert (covered(template_boxes(name, 203, 151), 203, 151) == 1).all()


@pytest.mark.parametrize("name", ["F", "G", "H", "J"])
def test_windows_cover_every_pixel(name):
    assert (covered(template_boxes(name, 203, 151), 203, 151) >= 1).all()


def test_sizes_in_cells():
    assert template_boxes("J", 600, 400)[0].tolist() == [0, 0, 200, 200]
    assert template_boxes("J", 600, 400)[1].tolist() == [100, 0, 300, 200]
    assert template_boxes("J", 600, 400)[-1].tolist() == [200, 400, 400, 600]
    assert template_boxes("E", 600, 400).tolist() == [[100, 150, 300, 450]]
    assert template_boxes("G", 600, 400)[1].tolist() == [0, 150, 400, 450]


def test_library_joins_its_parts():
    boxes = Library(Obb("J + B")).boxes(np.zeros((60, 40, 3), np.uint8))
    assert boxes.source == ("J",) * 15 + ("B",) * 4
    assert boxes.xyxy.shape == (19, 4)


@pytest.mark.parametrize("library", ["", "J+", "J+Q", "J+J"])
def test_unknown_or_repeated_parts_are_refused(library):
    with pytest.raises(InputError, match=r"obb\.library"):
        parse_library(library)
    with pytest.raises(InputError, match=r"obb\.library"):
        Library(Obb(library))


def test_settings_that_no_source_uses_decide_nothing():
    plain = Library(Obb("J+B"))
    assert plain.identity == [{"source": "J"}, {"source": "B"}]
    assert Library(Obb("J+B", Yolo(weights="/nowhere", score=0.9), Bing(count=3))).identity == plain.identity
    assert Library(Obb("B+J")).identity != plain.identity
