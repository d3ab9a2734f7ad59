"""Places against loops over pixels, and k-means against its definition: nearest centre, no class empty."""

from __future__ import annotations

import itertools
import threading
import warnings

import cv2
import numpy as np
import pytest

from fdslam.errors import InputError
from fdslam.places import (
    BINS,
    CLIP,
    GRID,
    SIDE,
    global_descriptor,
    nearest_places,
    place_classes,
    pose_vectors,
    time_vectors,
)
from tests.reference import block_normalised, inertia, orientation_histogram


def picture(seed, height=96, width=128):
    noise = np.random.default_rng(seed).integers(0, 256, (6, 8, 3), dtype=np.uint8)
    return cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)


def blobs(seed=0, classes=4, each=6):
    rng = np.random.default_rng(seed)
    centres = 20 * rng.standard_normal((classes, 5))
    return (centres[:, None] + rng.standard_normal((classes, each, 5))).reshape(-1, 5)


def test_descriptor_equals_a_loop_over_pixels():
    image = picture(0, 96, SIDE)  # already at the working size: nothing is resized
    cells = orientation_histogram(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), GRID, BINS)
    np.testing.assert_allclose(global_descriptor(image), block_normalised(cells, CLIP), atol=1e-6)


@pytest.mark.parametrize("shape", [(360, 480), (404, 308), (20, 2000), (1, 1)])
def test_descriptor_has_one_shape_for_images_of_all_sizes(shape):
    vector = global_descriptor(picture(1, *shape))
    assert vector.shape == ((GRID - 1) ** 2 * 4 * BINS,)
    assert vector.dtype == np.float32
    assert np.isfinite(vector).all()
    assert (vector >= 0).all()


def test_descriptor_tolerates_light_and_tells_places_apart():
    image = picture(2)
    dark = (255 * (image / 255) ** 1.8 * 0.7).astype(np.uint8)
    vector = global_descriptor(image)
    other = min(np.linalg.norm(vector - global_descriptor(picture(seed))) for seed in range(3, 9))
    assert np.linalg.norm(vector - global_descriptor(dark)) < 0.5 * other
    # A gain and an offset, which no pixel leaves the range under, change only the rounding.
    soft = (40 + 0.5 * image).astype(np.uint8)
    assert np.linalg.norm(vector - global_descriptor(soft)) < 0.1 * other


def test_descriptor_of_a_blank_image_is_zero():
    assert not global_descriptor(np.full((50, 60, 3), 90, dtype=np.uint8)).any()


@pytest.mark.parametrize("shape", [(50, 60), (50, 60, 4), (0, 60, 3)])
def test_descriptor_refuses_what_is_no_rgb_image(shape):
    with pytest.raises(InputError, match="RGB"):
        global_descriptor(np.zeros(shape, dtype=np.uint8))


def test_classes_are_numbered_by_first_appearance_and_none_is_empty():
    labels = place_classes(blobs(), 4, seed=0)
    assert labels.dtype == np.int64
    assert labels.tolist() == np.repeat(np.arange(4), 6).tolist()
    for k, seed in itertools.product((1, 3, 7, 24), (0, 1)):
        labels = place_classes(blobs(seed), k, seed)
        first = [labels.tolist().index(i) for i in range(k)]  # raises if a class is empty
        assert set(labels.tolist()) == set(range(k))
        assert first == sorted(first)


def test_every_vector_belongs_to_its_nearest_centre():
    vectors = np.random.default_rng(3).standard_normal((60, 3))
    labels = place_classes(vectors, 5, seed=0)
    centres = np.stack([vectors[labels == i].mean(axis=0) for i in range(5)])
    np.testing.assert_array_equal(((vectors[:, None] - centres) ** 2).sum(axis=2).argmin(axis=1), labels)


def test_partition_is_the_best_of_all_on_a_set_small_enough_to_try_them():
    vectors = np.random.default_rng(4).standard_normal((8, 2))
    best = min(inertia(vectors, np.array(p)) for p in itertools.product((0, 1, 2), repeat=8) if len(set(p)) == 3)
    assert inertia(vectors, place_classes(vectors, 3, seed=0)) == pytest.approx(best)


def test_partition_survives_scale_shift_and_order():
    vectors = blobs(5)
    labels = place_classes(vectors, 4, seed=0)
    np.testing.assert_array_equal(place_classes(3 * vectors + 7, 4, seed=0), labels)
    order = np.random.default_rng(0).permutation(len(vectors))
    shuffled = place_classes(vectors[order], 4, seed=0)
    same = labels[order]
    np.testing.assert_array_equal(shuffled[:, None] == shuffled, same[:, None] == same)


def test_k_is_clamped_to_the_distinct_vectors_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert place_classes(np.repeat(np.eye(3), 4, axis=0), 10, seed=0).tolist() == [0] * 4 + [1] * 4 + [2] * 4
        assert place_classes(np.ones((1, 288), dtype=np.float32), 10, seed=0).tolist() == [0]
        assert place_classes(np.ones((5, 2)), 3, seed=0).tolist() == [0] * 5


def test_partition_is_the_same_again_and_in_another_thread():
    vectors = np.random.default_rng(6).standard_normal((80, 288)).astype(np.float32)
    results = []
    threads = [threading.Thread(target=lambda: results.append(place_classes(vectors, 10, 1))) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    expected = place_classes(vectors, 10, 1)
    assert [r.tobytes() for r in results] == [expected.tobytes()] * 2


@pytest.mark.parametrize(
    ("vectors", "k"), [(np.empty((0, 3)), 2), (np.ones((3, 2)), 0), (np.full((3, 2), np.nan), 2), (np.ones(4), 2)]
)
def test_partition_refuses_what_cannot_be_partitioned(vectors, k):
    with pytest.raises(InputError, match="k-means"):
        place_classes(vectors, k, seed=0)


@pytest.mark.parametrize("seed", range(5))
def test_later_images_go_to_the_place_whose_mean_is_nearest(seed):
    rng = np.random.default_rng(seed)
    vectors = rng.integers(0, 4, (30, 2)).astype(np.float64)  # whole numbers: some are as near to two places
    label = place_classes(vectors[:12], 4, seed)
    found = nearest_places(vectors, label)
    assert np.array_equal(found[:12], label)
    for vector, place in zip(vectors[12:], found[12:], strict=True):
        means = [
            [np.mean([v[d] for v, one in zip(vectors, label, strict=False) if one == c]) for d in (0, 1)]
            for c in range(label.max() + 1)
        ]
        distance = [sum((a - b) ** 2 for a, b in zip(mean, vector, strict=True)) for mean in means]
        assert place == distance.index(min(distance))


def test_no_later_image_changes_nothing():
    label = np.array([0, 1, 0])
    assert np.array_equal(nearest_places(np.zeros((3, 2)), label), label)


def test_pose_and_time_vectors():
    poses = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, -3.0]])
    assert pose_vectors(poses).tolist() == [[1.0, 2.0], [4.0, 5.0]]
    assert time_vectors(np.array([0.0, 1.0, 1000.0])).tolist() == [[0.0], [1.0], [1000.0]]
    # Two passes of one spot, with opposite headings, are one place by pose and two by time.
    passes = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [0.0, 0.1, 3.1]])
    assert place_classes(pose_vectors(passes), 2, seed=0).tolist() == [0, 1, 0]
    assert place_classes(time_vectors(np.array([0.0, 1.0, 1000.0])), 2, seed=0).tolist() == [0, 0, 1]
