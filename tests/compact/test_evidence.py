"""Oracles: the parts that evidence is made of, which have oracles of their own; and scenes that are known."""

import numpy as np
import pytest

from fdslam.bow.around import NONE
from fdslam.compact.alignment import Aligned
from fdslam.compact.evidence import PRIOR, SIGMA, Looks, evidence
from fdslam.compact.features import KNOWN, MAPS, features
from fdslam.compact.grid import Grid
from fdslam.config import Compact
from fdslam.types import CELL, Features, grid_shape
from tests import reference
from tests.reference import compact as plain

SIZE = (120, 160)
SHAPE = grid_shape(*SIZE)
GRIDS = (Grid(15, 20, 8.0, 8.0), Grid(8, 10, 16.0, 16.0))
BITS = (64, 128)


def keypoints(seed, count):
    rng = np.random.default_rng(seed)
    return Features(
        (rng.random((count, 2)) * (159, 119)).astype(np.float32), rng.integers(0, 256, (count, 32), np.uint8)
    )


def looks(seed):
    rng = np.random.default_rng(seed)
    signs = tuple(
        rng.integers(0, 2**64, (grid.rows, grid.cols, bits // 64), dtype=np.uint64)
        for grid, bits in zip(GRIDS, BITS, strict=True)
    )
    return Looks(signs, GRIDS, BITS)


def laid(image, other, shift=(0.0, 0.0)):
    """A map image whose agreeing keypoints all say the same shift."""
    here = (np.random.default_rng(5).random((30, 2)) * (159, 119)).astype(np.float32)
    return Aligned(image, other, here, here + np.float32(shift), SIZE, SIZE)


def check(found):
    for name in (*MAPS, *KNOWN):
        if name != "FD":
            assert found[name].shape == SHAPE, name
            assert found[name].dtype == np.float32, name
            assert np.isfinite(found[name]).all(), name
    for name in ("fine", "coarse", "fine alone", "coarse alone", "words", "missing"):
        assert 0 <= found[name].min() <= found[name].max() <= 1 + 1e-6, name


@pytest.mark.parametrize("count", [0, 1, 40])
def test_without_an_aligned_image_nothing_is_known(count):
    query = keypoints(1, count)
    found = evidence(query, looks(1), SIZE, [], {}.__getitem__, Compact())
    check(found)
    for name in ("fine", "coarse", "fine alone", "coarse alone", "missing", "near", "wide"):
        assert len(np.unique(found[name])) == 1, name
    assert found["inliers"].shape == (0,)
    # No keypoint has a partner: the share of those is as the density of keypoints lets it be.
    alone = reference.cells_normalised(query.xy, np.ones(count, np.float32), *SIZE, SIGMA, PRIOR)
    assert np.allclose(found["words"], alone, rtol=1e-5, atol=1e-6)
    assert np.isfinite(features(found, np.zeros(SHAPE, np.float32))).all()


def test_the_smallest_share_of_several_images():
    query, ours = keypoints(1, 30), looks(1)
    theirs, config = {4: looks(2), 7: looks(3)}, Compact(reach=4)
    images = [laid(4, keypoints(2, 20), (3, -2)), laid(7, keypoints(3, 25), (-20, 6))]
    found = evidence(query, ours, SIZE, images, theirs.__getitem__, config)
    check(found)
    reach = 0.04 * np.sqrt(SIZE[0] * SIZE[1])
    for level, (name, sigma) in enumerate((("fine", config.fine_support), ("coarse", config.coarse_support))):
        each = []
        for one in images:
            at = one.to_map.at(GRIDS[level].centres())
            signs = theirs[one.image].signs[level]
            each.append(plain.smallest(ours.signs[level], signs, GRIDS[level], at, reach, sigma, np.inf))
        for what, pair in zip((f"{name} alone", name), zip(*each, strict=True), strict=True):
            smallest = np.minimum(*pair)
            assert np.isfinite(smallest).all()
            cells = GRIDS[level].to_cells((smallest / BITS[level]).astype(np.float32), *SIZE)
            assert np.allclose(found[what], cells, atol=1e-4), what
    assert found["inliers"].tolist() == [30, 30]


def test_where_no_image_reaches_it_is_as_elsewhere():
    ours = looks(1)
    found = evidence(keypoints(1, 5), ours, SIZE, [laid(0, keypoints(2, 5), (90, 0))], lambda m: ours, Compact())
    check(found)
    # The query's right half is outside of the map image.
    for name in ("fine", "fine alone"):
        right = found[name][:, 12:]
        assert np.ptp(right) < 1e-6
        assert found[name][:, :6].mean() == pytest.approx(right.mean(), abs=0.03)
    nowhere = evidence(keypoints(1, 5), ours, SIZE, [laid(0, keypoints(2, 5), (9000, 0))], lambda m: ours, Compact())
    check(nowhere)
    assert not nowhere["fine"].any()


def test_the_same_scene_shows_change_only_where_something_changed():
    ours = looks(1)
    signs = tuple(one.copy() for one in ours.signs)
    signs[0][4:8, 5:10] = ~signs[0][4:8, 5:10]
    signs[1][2:4, 2:5] = ~signs[1][2:4, 2:5]
    query = keypoints(1, 60)
    inside = ((query.xy > (40, 32)) & (query.xy < (80, 64))).all(axis=1)
    changed = Features(query.xy, np.where(inside[:, None], ~query.descriptors, query.descriptors))
    other = laid(0, query)
    config = Compact(reach=0, word_reach=0.5, fine_support=0.3, coarse_support=0.3)
    found = evidence(changed, Looks(signs, GRIDS, BITS), SIZE, [other], lambda m: ours, config)
    check(found)
    far = np.ones(SHAPE, bool)
    far[0:10, 1:12] = False
    assert found["fine"][5, 6] > 0.9
    assert found["coarse"][5, 6] > 0.9
    assert found["fine"][far].max() < 1e-3
    assert found["words"][4:6, 5:8].max() > 0.3
    # A Gaussian reaches four σ: 6 cells. There is no trace of it further away.
    assert found["words"][:, 15:].max() == 0
    assert found["missing"][:, 15:].max() == 0
    assert found["missing"][4:6, 5:8].max() > 0.3
    assert np.allclose(found["missing"], found["words"], atol=1e-3)  # each lost its partner, here and there


def test_confidence_is_of_the_best_image_and_texture_the_density_of_keypoints():
    query = keypoints(1, 25)
    here = np.full((20, 2), 30, np.float32) + np.random.default_rng(0).random((20, 2)).astype(np.float32)
    left, right = (Aligned(i, query, here + shift, here, SIZE, SIZE) for i, shift in enumerate((0, np.float32(70))))
    ours = looks(1)
    one, two, both = (
        evidence(query, ours, SIZE, images, lambda m: ours, Compact()) for images in ([left], [right], [left, right])
    )
    for name in ("near", "wide"):
        assert np.allclose(both[name], np.maximum(one[name], two[name]))
        assert one[name].argmax() != two[name].argmax()
    density = np.zeros(SHAPE)
    for x, y in query.xy:
        density[int(y) // CELL, int(x) // CELL] += 1
    assert np.allclose(one["texture"], reference.blurred(density, SIGMA), rtol=1e-3, atol=1e-4)


def test_missing_words_are_a_mean_over_the_images():
    query, ours = keypoints(1, 0), looks(1)
    other = keypoints(2, 40)
    nothing = Features(other.xy[:0], other.descriptors[:0])
    one, half = (
        evidence(query, ours, SIZE, images, lambda m: ours, Compact())["missing"]
        for images in ([laid(0, other)], [laid(0, other), laid(1, nothing)])
    )
    assert one.max() > 0.1
    assert np.allclose(half, one / 2, rtol=1e-5)


def test_the_threshold_is_that_of_the_configuration():
    query = keypoints(1, 60)
    other = Features(query.xy, query.descriptors.copy())
    other.descriptors[:, 0] ^= 255  # eight bits away
    ours = looks(1)
    assert NONE > 256
    for bits, found in ((7, True), (8, False)):
        share = evidence(
            query, ours, SIZE, [laid(0, other)], lambda m: ours, Compact(word_distance=bits, word_reach=0.1)
        )
        assert bool(share["words"].any()) == bool(share["missing"].any()) == found
