import numpy as np
import pytest

from fdslam.obb.yolo.heads import Candidates
from fdslam.obb.yolo.suppression import merged, suppressed
from tests.reference import suppression as reference


def candidates(boxes, score, label=None):
    return Candidates(
        np.array(boxes, np.float64).reshape(-1, 4),
        np.array(score, np.float32),
        np.zeros(len(score), np.int64) if label is None else np.array(label, np.int64),
    )


def random_candidates(seed, count=80, levels=1000):
    rng = np.random.default_rng(seed)
    corner, size = rng.uniform(0, 12, (count, 2)), rng.uniform(20, 30, (count, 2))
    return candidates(
        np.concatenate([corner, corner + size], axis=1),
        rng.integers(1, levels, count) / levels,
        rng.integers(0, 3, count),
    )


@pytest.mark.parametrize("levels", [1000, 4])  # 4: most scores are ties
@pytest.mark.parametrize("overlap", [0.2, 0.45, 0.8])
@pytest.mark.parametrize("seed", range(5))
def test_equals_the_loop(seed, overlap, levels):
    found = random_candidates(seed, levels=levels)
    kept = suppressed(found, overlap)
    slow = reference.suppressed(found.xyxy, found.score, found.label, overlap)
    assert 3 <= len(slow) < 80
    assert np.array_equal(kept.xyxy, found.xyxy[slow])
    assert np.array_equal(kept.label, found.label[slow])


def test_classes_do_not_suppress_each_other():
    found = candidates([[0, 0, 10, 10]] * 3, [0.5, 0.9, 0.7], [0, 1, 1])
    assert suppressed(found, 0.45).score.tolist() == pytest.approx([0.9, 0.5])


def test_nothing_stays_nothing():
    assert suppressed(candidates([], []), 0.45).xyxy.shape == (0, 4)


TILES = [(0, 0, 100, 100), (80, 0, 180, 100)]


def tiled(left, right):
    return merged([left, right], TILES, 100, 180, 0.45)


def test_an_object_in_the_overlap_is_found_once():
    one = candidates([[84, 20, 96, 60]], [0.8])
    other = candidates([[84, 21, 96, 60]], [0.9])
    assert tiled(one, other).xyxy.tolist() == [[84, 21, 96, 60]]


@pytest.mark.parametrize("score", [0.3, 0.95])  # the part may be the surer one
def test_the_part_that_an_edge_cuts_off_gives_way_to_the_whole(score):
    part, whole = candidates([[85, 20, 100, 60]], [score]), candidates([[85, 20, 130, 60]], [0.6])
    assert tiled(part, whole).xyxy.tolist() == [[85, 20, 130, 60]]
    assert len(tiled(candidates([[85, 20, 100, 60]], [score], [1]), whole).score) == 2  # another class
    assert len(tiled(candidates([[70, 20, 90, 60]], [score]), whole).score) == 2  # nothing cuts it


def test_a_part_at_the_image_s_own_border_is_whole():
    small, large = candidates([[0, 0, 10, 10]], [0.9]), candidates([[0, 0, 60, 60]], [0.5])
    both = merged([small, large], [(0, 0, 100, 100), (0, 0, 100, 100)], 100, 100, 0.45)
    assert len(both.score) == 2


def test_one_tile_is_left_as_it_is():
    found = random_candidates(3)
    assert merged([found], [(0, 0, 100, 100)], 100, 100, 0.45) is found
