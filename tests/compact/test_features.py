import numpy as np
import pytest

from fdslam.compact.features import KNOWN, MAPS, NAMES, fd_level, features

SHAPE = (12, 17)


def found(seed=0, shape=SHAPE, inliers=(40, 20, 9)):
    rng = np.random.default_rng(seed)
    evidence = {name: rng.random(shape).astype(np.float32) for name in (*MAPS, *KNOWN) if name != "FD"}
    evidence["texture"] *= 50
    return evidence | {"inliers": np.array(inliers, np.float32)}, rng.random(shape).astype(np.float32)


def column(rows, name):
    return rows[:, NAMES.index(name)].reshape(SHAPE)


def test_every_column_has_a_name_of_its_own():
    evidence, fd = found()
    rows = features(evidence, fd)
    assert rows.shape == (SHAPE[0] * SHAPE[1], len(NAMES))
    assert rows.dtype == np.float32
    assert len(set(NAMES)) == len(NAMES)
    assert np.isfinite(rows).all()
    for name in MAPS:
        assert np.array_equal(column(rows, f"{name} raw"), fd if name == "FD" else evidence[name])
    for name in KNOWN:
        assert np.array_equal(column(rows, f"{name} raw"), evidence[name])


def test_normalised_is_how_a_cell_stands_out():
    evidence, fd = found()
    rows = features(evidence, fd)
    for name in MAPS:
        raw, normal = (column(rows, f"{name} {form}").astype(float) for form in ("raw", "normalised"))
        middle = np.median(raw)
        assert np.allclose(normal, (raw - middle) / (np.abs(raw - middle).mean() + 1e-6), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("flip", [np.s_[:, ::-1], np.s_[::-1], np.s_[::-1, ::-1]])
def test_where_a_cell_is_cannot_be_told(flip):
    evidence, fd = found()
    other = {name: cells if name == "inliers" else cells[flip].copy() for name, cells in evidence.items()}
    plain, flipped = features(evidence, fd), features(other, fd[flip].copy())
    for i in range(len(NAMES)):
        here, there = (rows[:, i].reshape(SHAPE) for rows in (plain, flipped))
        assert np.allclose(here[flip], there, rtol=1e-5, atol=1e-5), NAMES[i]


def test_surroundings_reach_only_so_far():
    evidence, fd = found(shape=(60, 60))
    changed = {name: cells.copy() for name, cells in evidence.items()}
    changed["fine"][0, 0] += 0.5
    one, two = features(evidence, fd), features(changed, fd)
    differ = np.abs(one - two).max(axis=0)
    for i, name in enumerate(NAMES):
        assert (differ[i] > 0) <= name.startswith("fine "), name
    raw = NAMES.index("fine raw")
    assert np.flatnonzero(one[:, raw] != two[:, raw]).tolist() == [0]
    far = np.add.outer(np.arange(60) > 20, np.arange(60) > 20).ravel() > 0
    for name in NAMES:
        if name.startswith("fine σ"):
            i = NAMES.index(name)
            assert np.array_equal(one[far, i], two[far, i])


def test_constant_maps_are_finite():
    for level in (0.0, 0.3, 1.0):
        evidence, fd = found()
        for name in (*MAPS, *KNOWN):
            if name != "FD":
                evidence[name] = np.full(SHAPE, level, np.float32)
        rows = features(evidence, np.full_like(fd, level))
        assert np.isfinite(rows).all()
        assert np.abs(rows[:, [NAMES.index(f"{name} normalised") for name in MAPS]]).max() < 0.1


def test_nothing_is_the_same_for_the_whole_image():
    # A number of the image would tell a learner which image it is.
    rows = features(*found())
    assert all(len(np.unique(rows[:, i])) > 1 for i in range(len(NAMES)))
    assert np.array_equal(features(*found(inliers=())), rows)


@pytest.mark.parametrize("shape", [(1, 1), (1, 30), (2, 2)])
def test_small_images(shape):
    assert features(*found(shape=shape)).shape == (shape[0] * shape[1], len(NAMES))


def test_fd_is_told_alike_in_maps_of_any_size():
    for images in (2, 10, 164, 5000):
        assert np.allclose(fd_level(np.array([[0, 1, images**0.5, images]], np.float32), images), [[0, 0, 0.5, 1]])
    assert np.isfinite(fd_level(np.array([[0, 1]], np.float32), 1)).all()  # a map of one image
