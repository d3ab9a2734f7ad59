"""BING as a source of the library: its boxes are those of the proposals, and its identity is what decides them."""

import numpy as np
import pytest

from fdslam.config import Bing, Obb
from fdslam.errors import InputError
from fdslam.obb import Library, expected_boxes
from fdslam.obb.bing import OWN, load_filters, proposals, save_filters


def scene():
    rng = np.random.default_rng(0)
    image = rng.integers(0, 40, (180, 240, 3)).astype(np.uint8)
    image[40:120, 60:150] += 120
    return image


def test_the_library_has_the_boxes_of_bing():
    found = Library(Obb("J+B+BING", bing=Bing(count=7))).boxes(scene())
    assert found.source == ("J",) * 15 + ("B",) * 4 + ("BING",) * 7
    assert np.array_equal(found.xyxy[-7:], proposals(scene(), load_filters(OWN), 7)[0])
    assert expected_boxes(Obb("J+B+BING", bing=Bing(count=7))) == 26


def test_what_decides_the_boxes_is_the_identity(tmp_path):
    own = Library(Obb("BING"))
    assert Library(Obb("BING", bing=Bing(count=49))).identity != own.identity
    assert Library(Obb("BING", bing=Bing(filters=str(OWN)))).identity == own.identity  # the same, whatever its path
    copy = tmp_path / "copy.safetensors"
    save_filters(copy, load_filters(OWN))
    assert Library(Obb("BING", bing=Bing(filters=str(copy)))).identity == own.identity


def test_missing_filters_are_named(tmp_path):
    with pytest.raises(InputError, match="no BING filters"):
        Library(Obb("BING", bing=Bing(filters=str(tmp_path))))
