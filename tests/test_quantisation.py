"""Oracle: every codeword of every part, in whole numbers."""

import numpy as np
import pytest
from sklearn.cluster import KMeans

from fdslam import quantisation
from fdslam.quantisation import decode, encode, train
from tests.test_nearest import descriptors


@pytest.mark.parametrize("parts", [4, 16, 64])
def test_codes_against_all_codewords(parts):
    rng = np.random.default_rng(parts)
    codebook = rng.integers(0, 256, (parts, 256, 128 // parts), dtype=np.uint8)
    codebook[:, 7] = codebook[:, 3]  # of equal ones the first
    rows = rng.integers(0, 256, (40, 128), dtype=np.uint8)
    rows[0] = codebook[:, 7].ravel()
    codes = encode(rows, codebook)
    assert codes.dtype == np.uint8
    assert (codes[0] == 3).all()
    for row, code in zip(rows.astype(int), codes, strict=True):
        for part, piece in enumerate(row.reshape(parts, -1)):
            distance = ((codebook[part].astype(int) - piece) ** 2).sum(axis=1)
            assert code[part] == distance.argmin()
    back = decode(codes, codebook)
    assert back.dtype == np.uint8
    assert back.shape == rows.shape
    np.testing.assert_array_equal(encode(back, codebook), codes)
    np.testing.assert_array_equal(back[0], rows[0])
    assert decode(codes[:0], codebook).shape == (0, 128)


def test_few_descriptors_are_their_own_codewords():
    rng = np.random.default_rng(0)
    rows = descriptors(rng, 200)
    codebook = train(rows, 8, 0)
    np.testing.assert_array_equal(decode(encode(rows, codebook), codebook), rows)
    one = train(rows[:1], 8, 0)
    np.testing.assert_array_equal(decode(encode(rows[:3], one), one), rows[[0, 0, 0]])


def test_more_bytes_are_nearer(monkeypatch):
    monkeypatch.setattr(quantisation, "WORDS", 16)
    rng = np.random.default_rng(1)
    rows = descriptors(rng, 200)
    books = [train(rows, parts, 0) for parts in (4, 16, 64)]
    loss = [float(((decode(encode(rows, b), b).astype(float) - rows) ** 2).sum(axis=1).mean()) for b in books]
    assert loss[0] > loss[1] > loss[2] > 0
    scatter = ((rows - rows.mean(axis=0)) ** 2).sum(axis=1).mean()
    assert loss[0] < 0.9 * scatter  # a codebook that is no better than the mean would be of no use
    fitted = KMeans(16, n_init=1, max_iter=25, random_state=0).fit(rows[:, :2].astype(np.float32))
    np.testing.assert_array_equal(books[2][0], np.rint(fitted.cluster_centers_))


def test_the_seed_decides(monkeypatch):
    monkeypatch.setattr(quantisation, "WORDS", 16)
    rows = descriptors(np.random.default_rng(2), 300)
    np.testing.assert_array_equal(train(rows, 4, 5), train(rows, 4, 5))
    assert (train(rows, 4, 5) != train(rows, 4, 6)).any()


@pytest.mark.parametrize(("count", "parts"), [(0, 16), (5, 3)])
def test_no_codebook(count, parts):
    with pytest.raises(ValueError, match="a codebook of"):
        train(np.zeros((count, 128), np.uint8), parts, 0)
