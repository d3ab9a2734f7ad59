"""Oracles: the words and places that were packed; reference.compact.packed, word by word."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from fdslam.compact.gradients import Gradients
from fdslam.compact.map import SIGNS, WHOLE, CompactMap, Placed
from fdslam.compact.signs import centring
from fdslam.config import Dense
from fdslam.data.images import read_image
from fdslam.mapping import PLACED
from fdslam.store import Store, sha256_file
from fdslam.types import Frame
from tests.data.worlds import texture
from tests.reference import compact as reference


def words_of(draws, first):
    """Words as an image has them: new ones follow on, and between them older ones and new ones again."""
    words, following = [], first
    for new, which in draws:
        if new or following == 0:
            words.append(following)
            following += 1
        else:
            words.append(which % following)  # of the map before, or one that this image has given already
    return np.array(words, np.int32)


DRAWS = st.lists(st.tuples(st.booleans(), st.integers(0, 10_000)), max_size=60)


@given(DRAWS, st.integers(0, 1000), st.integers(0, 10_000), st.sampled_from([(360, 480), (1, 1), (4000, 16)]))
def test_what_is_packed_comes_back(draws, first, seed, size):
    words = words_of(draws, first)
    height, width = size
    xy = (np.random.default_rng(seed).random((len(words), 2)) * (width, height)).astype(np.float32)
    xy = np.minimum(xy, np.nextafter(np.array([width, height], np.float32), np.float32(0)))
    kept = Placed.pack(words, xy, height, width, first)
    assert kept.words().dtype == np.int32
    assert np.array_equal(kept.words(), words)
    places = kept.places(height, width)
    assert places.dtype == np.float32
    assert places.shape == xy.shape
    # Half a unit, and what float32 rounds.
    assert (np.abs(places - xy) <= np.array([width, height]) * (0.5 / WHOLE + 2e-7)).all()
    born, older = reference.packed(words.tolist(), first)
    assert np.unpackbits(kept.born, count=len(words)).astype(bool).tolist() == born
    assert kept.older.tolist() == older
    assert kept.nbytes == 4 * len(words) + -(-len(words) // 8) + 4 * len(older) + 8


@given(st.lists(st.integers(0, 2**31 - 2), max_size=40), st.integers(0, 2**31 - 2))
def test_words_in_any_order_come_back(words, first):
    # Where words were dropped, ids do not follow on.
    words = np.array(words, np.int32)
    kept = Placed.pack(words, np.zeros((len(words), 2), np.float32), 10, 10, first)
    assert np.array_equal(kept.words(), words)


def test_mostly_new_words_take_few_bytes():
    rng = np.random.default_rng(0)
    words = words_of([(rng.random() < 0.8, int(rng.integers(10_000))) for _ in range(1000)], 50_000)
    kept = Placed.pack(words, (rng.random((1000, 2)) * 300).astype(np.float32), 300, 300, 50_000)
    assert kept.nbytes < 0.5 * PLACED * len(words)


def test_an_empty_image():
    kept = Placed.pack(np.zeros(0, np.int32), np.zeros((0, 2), np.float32), 360, 480, 7)
    assert kept.words().shape == (0,)
    assert kept.places(360, 480).shape == (0, 2)


class Words:
    """A map of words in which every image has given two."""

    identity = "two words an image"

    def posted(self, image):
        return np.array([2 * image, 2 * image + 1, 0], np.int32), np.array([[1, 2], [50, 60], [3.5, 9]], np.float32)

    def born(self, image):
        return 2 * image, 2 * image + 2

    def descriptors(self, words):
        return np.repeat(words.astype(np.uint8)[:, None], 32, axis=1)


@pytest.fixture
def frames(tmp_path):
    found = []
    for i, size in enumerate([(120, 160), (120, 160), (90, 200), (120, 160)]):
        path = tmp_path / f"{i}.png"
        Image.fromarray(texture(i, *size)).save(path)
        found.append(Frame(path.name, path, sha256_file(path), *size))
    return found


def compact(frames, store, **changes):
    config = Dense(source="gradients", **changes)
    return CompactMap(frames, Gradients(config), config, Words(), store, 1)


def test_looks_are_signs_centred_on_the_map(frames, tmp_path):
    kept, source = compact(frames[:3], Store(tmp_path)), Gradients(Dense())
    described = [source.describe(read_image(frame.path)) for frame in frames]
    kept.ensure(frames, "looks")
    fitted = [centring([one[level] for one in described[:3]], bits) for level, bits in ((0, 64), (1, 128))]
    for frame, levels in zip(frames, described, strict=True):
        looks = kept.looks(frame)
        again = kept.look(read_image(frame.path))
        assert looks.bits == (63, 117)
        for level in range(2):
            assert np.array_equal(looks.signs[level], fitted[level].signs(levels[level]))
            assert np.array_equal(looks.signs[level], again.signs[level])
            assert looks.grids[level] == again.grids[level]
            assert looks.signs[level].shape[:2] == (looks.grids[level].rows, looks.grids[level].cols)


def test_what_is_stored_is_not_described_again(frames, tmp_path, monkeypatch):
    store = Store(tmp_path)
    first = [compact(frames, store).looks(frame) for frame in frames]
    keys = [compact(frames, store).key(frame) for frame in frames]
    damaged = store.path(SIGNS, keys[1])
    damaged.write_bytes(damaged.read_bytes()[:-3])
    kept = compact(frames, store)
    assert store.lacks(SIGNS, keys) == 0
    kept.ensure(frames, "looks")
    monkeypatch.setattr(Gradients, "describe", None)
    for before, frame in zip(first, frames, strict=True):
        again = kept.looks(frame)
        assert all(np.array_equal(a, b) for a, b in zip(before.signs, again.signs, strict=True))


def test_addresses_follow_what_decides(frames, tmp_path):
    store = Store(tmp_path)
    plain = compact(frames, store).key(frames[0])
    others = [
        compact(frames, store, fine_bits=128).key(frames[0]),
        compact(frames, store, kilobytes=9).key(frames[0]),
        compact(frames, store, sample=2).key(frames[0]),
        compact(frames[1:], store).key(frames[0]),
        compact(frames, store).key(frames[1]),
    ]
    assert len({plain, *others}) == 6
    assert compact(frames, store).key(frames[0]) == plain


def test_words_at_their_places(frames, tmp_path):
    kept = compact(frames, Store(tmp_path))
    for image in (0, 2):
        words, xy = Words().posted(image)
        found = kept.words(image)
        assert np.allclose(found.xy, xy, atol=0.01)
        assert np.array_equal(found.descriptors, Words().descriptors(words))
    assert kept.size(2) == (90, 200)


def test_what_is_kept_is_counted(frames, tmp_path):
    kept = compact(frames, Store(tmp_path))
    dense = sum(signs.nbytes for frame in frames for signs in kept.looks(frame).signs)
    fitted = sum(one.mean.nbytes + one.turn.nbytes for one in kept.centrings)
    words = sum(kept.placed(image).nbytes for image in range(4))
    assert kept.kept() == (dense + fitted + words) / 4
    assert dense / 4 <= 1000 * Dense().kilobytes
