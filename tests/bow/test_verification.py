import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdslam.bow import verification
from fdslam.bow.verification import (
    agreeing,
    correspondences,
    inliers_per_obb,
    promote,
    supporting_matches,
    verified,
)
from fdslam.types import Features
from tests.reference import refinement


def features(seed, count):
    rng = np.random.default_rng(seed)
    return Features(rng.uniform(0, 400, (count, 2)).astype(np.float32), rng.integers(0, 256, (count, 32), np.uint8))


def seen_from_elsewhere(seed, kept=60, new=20, planar=False, noise=0.3):
    """A scene of points, a view of it, and another that shares ``kept`` of its keypoints."""
    rng = np.random.default_rng(seed)
    points = np.stack([*rng.uniform(-2, 2, (2, kept)), np.full(kept, 5.0) if planar else rng.uniform(3, 9, kept)], 1)
    turn, _ = cv2.Rodrigues(np.array([0.02, 0.15, 0.01]))
    views = []
    for rotation, shift in ((np.eye(3), np.zeros(3)), (turn, np.array([0.5, 0.1, 0.2]))):
        moved = points @ rotation.T + shift
        views.append(300 * moved[:, :2] / moved[:, 2:] + 320 + rng.normal(0, noise, (kept, 2)))
    shared, one, two = features(seed, kept), features(seed + 1, new), features(seed + 2, new)
    flipped = shared.descriptors ^ (rng.random((kept, 32)) < 0.2).astype(np.uint8)
    query = Features(
        np.concatenate([views[0], one.xy]).astype(np.float32), np.concatenate([shared.descriptors, one.descriptors])
    )
    other = Features(np.concatenate([two.xy, views[1]]).astype(np.float32), np.concatenate([two.descriptors, flipped]))
    return query, other


@given(st.integers(0, 10_000), st.integers(0, 12), st.integers(0, 12))
def test_matches_equal_the_loops(seed, count, others):
    rng = np.random.default_rng(seed)
    pool = rng.integers(0, 256, (6, 32), np.uint8)  # many near ones, so that several want the same one
    few = [pool[rng.integers(0, 6, n)] ^ (rng.random((n, 32)) < 0.1).astype(np.uint8) for n in (count, others)]
    query, other = (Features(np.zeros((len(d), 2), np.float32), d) for d in few)
    mine, theirs = correspondences(query, other)
    assert list(zip(mine.tolist(), theirs.tolist(), strict=True)) == refinement.one_to_one(query, other)


@pytest.mark.parametrize("planar", [False, True])
def test_a_view_from_elsewhere_agrees_and_another_place_does_not(planar):
    query, other = seen_from_elsewhere(3, planar=planar)
    found = agreeing(query, other, 20)
    assert found[:60].mean() > 0.8
    assert not found[60:].any()
    assert not agreeing(query, features(9, 80), 20).any()
    assert not agreeing(query, other, 61).any()
    assert np.array_equal(found, agreeing(query, other, 20))


def test_a_homography_takes_fewer_matches_than_a_fundamental_matrix():
    one = features(5, 12)
    other = Features(one.xy + np.array([7, 3], np.float32), one.descriptors)
    for count in (4, 6, 7):
        few = Features(one.xy[:count], one.descriptors[:count])
        assert agreeing(few, other, 4).sum() == count
    assert not agreeing(Features(one.xy[:3], one.descriptors[:3]), other, 3).any()


@pytest.mark.parametrize("count", [0, 1, 7])
def test_too_few_keypoints_verify_nothing(count):
    query, other = seen_from_elsewhere(4)
    few = Features(query.xy[:count], query.descriptors[:count])
    assert agreeing(few, other, 1).sum() <= count
    assert not agreeing(few, features(0, 0), 1).any()
    assert agreeing(features(0, 0), other, 1).shape == (0,)


def test_where_no_fundamental_matrix_is_found_a_homography_is_tried(monkeypatch):
    query, other = seen_from_elsewhere(5, planar=True)
    monkeypatch.setattr(verification, "_MODELS", ((lambda *_: (None, None), 7), verification._MODELS[1]))
    assert agreeing(query, other, 20)[:60].mean() > 0.8


def test_what_opencv_trips_over_is_no_model_and_nothing_else_is_hidden(monkeypatch):
    query, other = seen_from_elsewhere(5, planar=True)

    def trips(message):
        def find(*_):
            raise cv2.error(message)

        monkeypatch.setattr(verification, "_MODELS", ((find, 7), (cv2.findHomography, 4)))

    trips("(-215:Assertion failed) !model.empty() in function 'setModelParameters'")
    assert agreeing(query, other, 20)[:60].mean() > 0.8
    trips("(-4:Insufficient memory)")
    with pytest.raises(cv2.error, match="memory"):
        agreeing(query, other, 20)


def test_all_obbs_at_once_count_what_each_alone_does():
    query, other = seen_from_elsewhere(6)
    others = [other, features(7, 80), seen_from_elsewhere(6, noise=2.0)[1]]
    inside = np.random.default_rng(0).random((9, 80)) < 0.4
    counts = inliers_per_obb(query, inside, others, 20)
    one_by_one = [[int((agreeing(query, o, 20) & box).sum()) for o in others] for box in inside]
    assert counts.tolist() == one_by_one
    assert counts[:, 0].min() > 0
    assert not counts[:, 1].any()
    assert inliers_per_obb(query, inside, [], 20).shape == (9, 0)
    assert np.array_equal(inliers_per_obb(query, inside[::-1], others, 20), counts[::-1])


@given(st.integers(0, 10_000), st.integers(1, 7))
def test_promotion_equals_sorting(seed, top):
    rng = np.random.default_rng(seed)
    levels = rng.integers(0, 5, (4, 7)).astype(np.int64)
    candidates = np.flatnonzero(rng.random(7) < 0.7)
    inliers = rng.integers(0, 3, (4, len(candidates)))
    first = rng.random(inliers.shape) < 0.6
    result = promote(levels, first, candidates, inliers)
    for row, new, among, counts in zip(levels, result, first, inliers, strict=True):
        chosen = set(candidates[among].tolist())
        expected = refinement.verified_order(row.tolist(), chosen, dict(zip(candidates.tolist(), counts, strict=True)))
        assert [set(np.flatnonzero(new == v).tolist()) for v in sorted(set(new.tolist()), reverse=True)] == expected
        assert not new[[m for m in range(7) if row[m] == 0 and m not in chosen]].any()


def test_only_the_first_images_of_a_list_are_looked_at_and_each_once():
    query, other = seen_from_elsewhere(8)
    asked = []

    def map_features(image):
        asked.append(image)
        return other if image == 2 else features(100 + image, 50)

    inside = np.ones((2, 80), bool)
    levels = np.array([[9, 8, 7, 0, 1], [0, 9, 8, 0, 0]], np.int64)
    result = verified(levels, query, inside, map_features, 3, 20)
    assert sorted(asked) == [0, 1, 2]  # never retrieved ones are not worth a look
    assert result[0].argmax() == result[1].argmax() == 2
    assert np.array_equal(np.delete(result, 2, axis=1), np.delete(levels, 2, axis=1))
    assert np.array_equal(verified(levels, query, inside, map_features, 0, 20), levels)
    assert np.array_equal(verified(levels, query, inside, map_features, 1, 20), levels)


def test_matches_at_hand_are_those_that_would_be_made(monkeypatch):
    """The oracle is matching each pair anew, without a memory."""
    made = []

    def counted(ours, theirs):
        made.append(len(ours))
        return matched(ours, theirs)

    matched = verification._matched
    pairs = [seen_from_elsewhere(seed) for seed in range(3)]
    monkeypatch.setattr(verification, "_matched", counted)
    verification._at_hand.cache_clear()
    for query, other in pairs * 2:
        moved = Features(other.xy + np.float32(0.004), other.descriptors.copy())  # the same words, placed as packed
        for there in (other, moved):
            expected = verification._fitting(query, there, matched(query.descriptors, there.descriptors), 8)
            found = supporting_matches(query, there, 8)
            assert len(found[0]) > 40
            for one, two in zip(found, expected, strict=True):
                assert one.tobytes() == two.tobytes()
                one[:] = 0  # what is given is the asker's own
    assert len(made) == len(pairs)
    query, other = pairs[0]
    kept = verification._at_hand(query.descriptors.tobytes(), other.descriptors.tobytes())
    assert not any(one.flags.writeable for one in kept)
    less = Features(other.xy[:30], other.descriptors[:30])
    assert len(supporting_matches(query, less, 4)[0]) < len(supporting_matches(query, other, 4)[0])
    none = Features(other.xy[:0], other.descriptors[:0])
    assert all(len(one) == 0 for pair in ((query, none), (none, query)) for one in supporting_matches(*pair, 8))


@pytest.mark.parametrize("count", [1, 2, 3, 9])
def test_the_best_supported_are_those_of_all_and_no_more_are_fitted_than_it_takes(count, monkeypatch):
    query, other = seen_from_elsewhere(3)
    sizes = [30, 60, 0, 45, 60, 20]  # of the views; equal ones go by their id, 0 has nothing
    images = {m: Features(other.xy[20 : 20 + n], other.descriptors[20 : 20 + n]) for m, n in enumerate(sizes)}
    images[6] = features(9, 300)  # another place
    strewn = np.concatenate([other.xy[20:38], features(9, 32).xy])  # many matches, of which few fit
    images[7] = Features(strewn, other.descriptors[20:70])
    expected = sorted((-len(supporting_matches(query, images[m], 8)[0]), m) for m in images)[:count]
    fitted = []
    fit = verification._fitting
    monkeypatch.setattr(
        verification, "_fitting", lambda q, o, matches, least: fitted.append(o) or fit(q, o, matches, least)
    )
    found = verification.best_supported(query, [7, 6, 5, 4, 3, 2, 1, 0], images.__getitem__, 8, count)
    assert len(fitted) == {1: 2, 2: 2, 3: 4, 9: 8}[count]
    assert [(-len(one.mine), one.image) for one in found] == expected
    for one in found:
        assert one.other is images[one.image]
        for mine, theirs in zip((one.mine, one.theirs), supporting_matches(query, one.other, 8), strict=True):
            assert np.array_equal(mine, theirs)
