"""The library in a run: OBBs are found once, and what is not in the library repeats nothing."""

from dataclasses import replace

import numpy as np
import pytest

from fdslam.config import Bow, Config, Evaluation, Folder, Mix, Obb, Yolo
from fdslam.data.folder import read_folder
from fdslam.data.images import read_image
from fdslam.mapping import BowMap
from fdslam.obb import Library
from fdslam.pipeline import run
from fdslam.proposals import Proposals
from fdslam.provenance import Stopwatch
from fdslam.store import Store
from tests.data.worlds import small_world
from tests.onnx_models import colour_finder

BOW = Bow(features=300, min_side=240)


@pytest.fixture
def world(tmp_path):
    return read_folder(small_world(tmp_path / "world"), Folder())


@pytest.fixture
def weights(tmp_path):
    return str(colour_finder(tmp_path / "m.onnx", "yolov8", size=3.0))


def counted(library):
    """Count how often the detector looks at an image."""
    looks = []
    source = library.sources["YOLO"]
    plain = source.boxes
    source.boxes = lambda image: (looks.append(1), plain(image))[1]
    return looks


def stored(tmp_path):
    return {path.relative_to(tmp_path / "s").parts[0] for path in (tmp_path / "s").rglob("*.safetensors")}


def test_equal_the_library_and_are_found_once(world, weights, tmp_path):
    library = Library(Obb("J+YOLO", Yolo(weights=weights, score=0.4)))
    direct = [library.boxes(read_image(frame.path)) for frame in world.query]
    assert sum(name == "YOLO" for boxes in direct for name in boxes.source) > 10
    looks = counted(library)
    store = Store(tmp_path / "s")
    for _ in range(2):
        proposals = Proposals(library, store, 2)
        proposals.ensure(world.query, "the queries")
        for frame, boxes in zip(world.query, direct, strict=True):
            found = proposals.of(frame)
            assert found.source == boxes.source
            assert np.array_equal(found.xyxy, boxes.xyxy)
    assert len(looks) == len(world.query)
    assert stored(tmp_path) == {"obbs"}


def localized(world, library, store, config=BOW):
    return BowMap(world.map, config, library, store, 1).localize(world.query)


def test_a_bag_of_words_with_other_switches_does_not_look_again(world, weights, tmp_path):
    library = Library(Obb("J+YOLO", Yolo(weights=weights, score=0.4)))
    looks = counted(library)
    store = Store(tmp_path / "s")
    keys, found = localized(world, library, store)
    assert any("YOLO" in one.boxes.source for one in found)
    assert localized(world, library, store, replace(BOW, islands="ibow"))[0] != keys
    assert len(looks) == len(world.query)
    localized(world, library, store, replace(BOW, document="obb"))
    assert len(looks) == len(world.query) + len(world.map)


def test_settings_of_a_source_decide_where_it_is_in_the_library_and_nowhere_else(world, weights, tmp_path):
    store = Store(tmp_path / "s")

    def keys(library, **changes):
        return localized(world, Library(Obb(library, Yolo(weights=weights, **changes))), store)[0]

    assert keys("J", score=0.1) == keys("J", score=0.9)
    assert keys("YOLO", score=0.1) != keys("YOLO", score=0.9)
    assert keys("YOLO", threads=1) == keys("YOLO", threads=2)


def test_an_image_where_nothing_is_found_says_nothing(world, weights, tmp_path):
    _, found = localized(world, Library(Obb("YOLO", Yolo(weights=weights, score=1.0))), Store(tmp_path / "s"))
    for one in found:
        assert one.lost or len(one.ranks) == 0
        assert one.boxes.xyxy.shape == one.library.xyxy.shape == (0, 4)
        assert one.strong.tolist() == list(range(len(world.map)))


def test_objectness_counts_what_the_detector_finds_beside_templates(world, weights, tmp_path):
    def maps(library, **changes):
        config = Config(
            store=str(tmp_path / "s"),
            dataset=Folder(root=str(tmp_path / "world")),
            bow=BOW,
            obb=Obb(library, Yolo(weights=weights, **changes)),
            mix=Mix(rows=["FD"]),
            evaluation=Evaluation(bootstrap=10),
        )
        return run(config, Stopwatch()).maps

    alone, beside = maps("YOLO", score=0.4), maps("J+YOLO", score=0.4)
    assert any(cells.any() for cells in alone["objectness"])
    assert all(np.array_equal(*pair) for pair in zip(alone["objectness"], beside["objectness"], strict=True))
    assert not any(cells.any() for cells in maps("J+YOLO", score=1.0)["objectness"])
    assert all(cells.any() for cells in maps("J", score=1.0)["objectness"])
    assert not any(np.array_equal(*pair) for pair in zip(alone["FD"], beside["FD"], strict=True))
