"""A map without one of its images, for training. Oracle: a map that was built without it.

The two must agree where the image shares no word with others: its words are then exactly those that its absence takes
away, and as each word is held by one image, idf is the same for all words in either map and orders nothing.
"""

from dataclasses import replace

import numpy as np
import pytest

from fdslam import keypoints, mapping
from fdslam.bow.vocabulary import NO_WORD
from fdslam.config import Bow, Obb
from fdslam.mapping import BowMap
from fdslam.obb import Library
from fdslam.store import Store
from fdslam.types import Features, Frame
from tests import reference

HEIGHT, WIDTH = 120, 160
PLAIN = Bow(min_side=0, features=40)


class Scenes:
    """Images that are numbers, and the keypoints of each as they are said to be."""

    def __init__(self, monkeypatch, tmp_path):
        self.features, self.tmp_path = {}, tmp_path
        for module in (mapping, keypoints):
            monkeypatch.setattr(module, "extract", lambda image, config: self.features[int(image[0, 0, 0])])
        monkeypatch.setattr(keypoints, "read_image", lambda path: self.image(int(path.name)))

    def image(self, number):
        return np.full((HEIGHT, WIDTH, 3), number, np.uint8)

    def add(self, descriptors, seed=0):
        rng = np.random.default_rng(seed)
        xy = (rng.random((len(descriptors), 2)) * (WIDTH - 1, HEIGHT - 1)).astype(np.float32)
        self.features[len(self.features)] = Features(xy, np.asarray(descriptors, np.uint8))
        return len(self.features) - 1

    def map(self, numbers, config=PLAIN):
        frames = [Frame(str(n), self.tmp_path / str(n), f"digest {n}", HEIGHT, WIDTH) for n in numbers]
        return BowMap(frames, config, Library(Obb("J+B")), Store(self.tmp_path / "store"), 1)


@pytest.fixture
def scenes(monkeypatch, tmp_path):
    return Scenes(monkeypatch, tmp_path)


def descriptors(seed, count=30):
    return np.random.default_rng(seed).integers(0, 256, (count, 32), np.uint8)


def near(rows, seed, flipped=0.02):
    """The same descriptors but for some bits."""
    noise = np.random.default_rng(seed).random((len(rows), 256)) < flipped
    return rows ^ np.packbits(noise, axis=1)


@pytest.mark.parametrize("switches", [{}, {"score": "tfidf"}, {"islands": "ibow"}, {"unretrieved": "next"}])
@pytest.mark.parametrize("document", ["image", "obb"])
@pytest.mark.parametrize("left", [0, 2, 5])
def test_it_is_the_map_built_without_it(scenes, left, document, switches):
    numbers = [scenes.add(descriptors(i), i) for i in range(6)]
    config = replace(PLAIN, document=document, **switches)
    seen = np.concatenate([near(descriptors(i)[:n], i) for i, n in enumerate([12, 3, 20, 8, 15, 20])])
    query = scenes.add(seen, 99)
    found, local = scenes.map(numbers, config).localize_without(scenes.image(query), left)
    others = [n for n in numbers if n != left]
    frame = Frame("query", scenes.tmp_path / str(query), "query", HEIGHT, WIDTH)
    [expected] = scenes.map(others, config).localize([frame])[1]
    assert np.array_equal(found.xy, scenes.features[query].xy)
    assert [numbers.index(others[m]) for m in expected.strong] == local.strong.tolist()
    assert np.array_equal(np.delete(local.ranks, left, axis=1), expected.ranks)
    assert local.boxes.source == expected.boxes.source
    assert len(np.unique(local.ranks)) > 3  # it knows something
    assert left not in local.strong
    assert (local.ranks[:, left] == len(numbers)).all()


def flipped(rows, *bits):
    """The same descriptors but for the bits in these ranges."""
    mask = np.zeros(256, bool)
    for begin, end in bits:
        mask[begin:end] = True
    return rows ^ np.packbits(mask)


def test_a_word_of_the_left_out_image_hides_none_of_the_others(scenes):
    # The query is what image 1 showed, twice and much alike; image 4 has what is less like it, and nothing else is.
    base = descriptors(7, 15)
    numbers = [scenes.add(descriptors(10 + i), i) for i in range(5)]
    scenes.features[1] = Features(scenes.features[1].xy, np.concatenate([base, flipped(base, (0, 10), (200, 210))]))
    scenes.features[4] = Features(scenes.features[4].xy[:15], flipped(base, (0, 50)))
    query = scenes.add(base, 99)
    bow = scenes.map(numbers)
    assert len(bow.bag.vocabulary) == 5 * 30 - 15  # no word is shared
    assert bow.localize_without(scenes.image(query), 0)[1].strong[0] == 1
    local = bow.localize_without(scenes.image(query), 1)[1]
    frame = Frame("query", scenes.tmp_path / str(query), "query", HEIGHT, WIDTH)
    [expected] = scenes.map([0, 2, 3, 4]).localize([frame])[1]
    assert np.array_equal(np.delete(local.ranks, 1, axis=1), expected.ranks)
    assert local.strong.tolist() == [[0, 2, 3, 4][m] for m in expected.strong]
    assert local.strong[0] == 4


def test_what_is_verified_are_the_others(scenes):
    numbers = [scenes.add(descriptors(i), i) for i in range(5)]
    config, asked = replace(PLAIN, verify_top=2, verify_inliers=8), []
    for left in (0, 3):
        bow = scenes.map(numbers, config)
        query = scenes.add(near(np.concatenate([descriptors(i)[:15] for i in (1, 3)]), 1), 50)
        features = bow._map_features
        bow._map_features = lambda m, known=features: (asked.append(m), known(m))[1]
        local = bow.localize_without(scenes.image(query), left)[1]
        assert left not in asked
        assert asked
        assert sorted(local.strong.tolist()) == [m for m in range(5) if m != left]
        asked.clear()


def test_a_query_of_the_left_out_image_alone_knows_nothing(scenes):
    numbers = [scenes.add(descriptors(i), i) for i in range(5)]
    bow = scenes.map(numbers)
    local = bow.localize_without(scenes.image(3), 3)[1]
    assert local.strong.tolist() == [0, 1, 2, 4]  # as the ids come
    assert (np.delete(local.ranks, 3, axis=1) == 4).all()  # no list retrieves any of the four
    assert bow.localize_without(scenes.image(3), 1)[1].strong[0] == 3


def shared_map(scenes, **changes):
    """Each image sees half of what the one before saw, as along a path."""
    pool = descriptors(0, 100)
    numbers = [scenes.add(near(pool[15 * i : 15 * i + 30], i, 0.01), i) for i in range(5)]
    return scenes.map(numbers, replace(PLAIN, **changes)), numbers


def test_posted_words_are_those_that_were_learned(scenes):
    bow, numbers = shared_map(scenes)
    words, born = reference.learn([scenes.features[n].descriptors for n in numbers], bow.config.ratio)
    first = 0
    for image, number in enumerate(numbers):
        posted, xy = bow.posted(image)
        assert posted.tolist() == words[image]
        assert np.array_equal(xy, scenes.features[number].xy)
        begin, end = bow.born(image)
        assert begin == first
        assert end == max(max(words[image]) + 1, first)
        first = end
        assert np.array_equal(bow.descriptors(posted), [born[word] for word in words[image]])
        placed = bow.placed_words(image)
        assert np.array_equal(placed.descriptors, bow.descriptors(posted))
    assert first == len(born)


@pytest.mark.parametrize("purge", [False, True])
def test_without_an_image_its_words_are_those_of_the_others_themselves(scenes, purge):
    bow, numbers = shared_map(scenes, purge=purge)
    taken = 0
    for image in range(5):
        own, (words, xy) = scenes.features[numbers[image]], bow.posted(image)
        keypoint = [int(np.flatnonzero((own.xy == place).all(axis=1))[0]) for place in xy]
        for without in range(5):
            begin, end = bow.born(without)
            found = bow.words_without(image, without)
            assert np.array_equal(found.xy, xy)
            assert found.descriptors.dtype == np.uint8
            for i, word in enumerate(words.tolist()):
                gone = begin <= word < end
                expected = own.descriptors[keypoint[i]] if gone else bow.descriptors(words[i : i + 1])[0]
                assert np.array_equal(found.descriptors[i], expected)
                taken += gone and image != without
    assert taken > 10


def test_a_dropped_word_is_posted_nowhere(scenes):
    bow, numbers = shared_map(scenes, purge=True)
    posted = [bow.posted(image)[0] for image in range(5)]
    assert sum(map(len, posted)) < sum(len(scenes.features[n].xy) for n in numbers)
    assert NO_WORD not in np.concatenate(posted)
