"""Oracle: reference.compact.signs, channel by channel."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fdslam.compact.signs import Centring, centring, stored
from fdslam.store import Stage, Store
from tests.reference import compact as reference


def levels(seed, channels, count=3):
    rng = np.random.default_rng(seed)
    scale, shift = rng.uniform(0.1, 10, channels), rng.uniform(-5, 5, channels)
    shapes = rng.integers(1, 6, (count, 2))
    return [(rng.standard_normal((*shape, channels)) * scale + shift).astype(np.float32) for shape in shapes]


def bits_of(signs, row, col):
    return np.unpackbits(signs[row, col].view(np.uint8))


def padded(signs, bits):
    """The bits of every descriptor, bool [n, bits]; what is beyond is checked to be 0."""
    flat = np.unpackbits(np.ascontiguousarray(signs).view(np.uint8).reshape(-1, 8 * signs.shape[2]), axis=1)
    assert not flat[:, bits:].any()
    return flat[:, :bits].astype(bool)


@settings(deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([1, 7, 63, 64, 65, 100]))
def test_few_channels_are_signs_of_their_own(seed, channels):
    seen = levels(seed, channels)
    fitted = centring(seen, 128)
    rows = np.concatenate([one.reshape(-1, channels) for one in seen])
    assert np.allclose(fitted.mean, [rows[:, c].astype(float).mean() for c in range(channels)], rtol=1e-5, atol=1e-6)
    assert fitted.bits == channels
    for values in seen:
        signs = fitted.signs(values)
        assert signs.dtype == np.uint64
        assert signs.shape == (*values.shape[:2], -(-channels // 64))
        assert padded(signs, channels).tolist() == reference.signs(values, fitted.mean, None)


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10_000), st.sampled_from([(65, 64), (200, 64), (150, 128), (300, 192)]))
def test_many_channels_are_turned_by_a_fixed_rotation(seed, sizes):
    channels, bits = sizes
    seen = levels(seed, channels, count=12)
    fitted = centring(seen, bits)
    assert fitted.bits == bits
    assert np.array_equal(fitted.turn, centring(iter(seen), bits).turn)
    deviation = np.concatenate([one.reshape(-1, channels) for one in seen]).astype(float).std(axis=0)
    rotation = fitted.turn * deviation[:, None]  # orthonormal once each channel has unit variance
    assert np.allclose(rotation.T @ rotation, np.eye(bits), atol=1e-3)
    values = seen[0]
    centred = (values - fitted.mean).astype(float) @ fitted.turn.astype(float)
    clear = np.abs(centred).reshape(-1, bits) > 1e-4  # near 0 the order of a sum decides
    expected = np.array(reference.signs(values, fitted.mean, fitted.turn))
    assert (padded(fitted.signs(values), bits) == expected)[clear].all()
    assert clear.mean() > 0.99


def test_turned_bits_tell_how_far_descriptors_are_apart():
    rng = np.random.default_rng(0)
    fitted = centring([rng.standard_normal((40, 40, 300)).astype(np.float32)], 256)
    one = rng.standard_normal((1, 1, 300)).astype(np.float32)
    near = one + 0.2 * rng.standard_normal(one.shape).astype(np.float32)
    far = rng.standard_normal(one.shape).astype(np.float32)
    apart = [int((bits_of(fitted.signs(one), 0, 0) != bits_of(fitted.signs(two), 0, 0)).sum()) for two in (near, far)]
    assert apart[0] < 40
    assert 90 < apart[1] < 166


@pytest.mark.parametrize("bits", [64, 128])
def test_a_channel_that_never_changes_is_no_trouble(bits):
    seen = levels(3, 100)
    for values in seen:
        values[..., 7], values[..., 8] = 0.1, 0
    fitted = centring(seen, bits)
    assert np.isfinite(fitted.mean).all()
    assert np.isfinite(fitted.turn).all()
    # It says nothing: another descriptor that differs elsewhere has the same bits as if it were not there.
    if bits == 128:
        assert not padded(fitted.signs(seen[0]), 100)[:, 7:9].any()
    else:
        others = np.delete(np.arange(100), [7, 8])
        without = Centring(fitted.mean[others], fitted.turn[others])
        assert np.array_equal(fitted.signs(seen[0]), without.signs(seen[0][..., others]))


@pytest.mark.parametrize("channels", [40, 90])
def test_storage_keeps_it(tmp_path, channels):
    fitted = centring(levels(1, channels), 64)
    store, stage = Store(tmp_path), Stage("centring", ())
    key = stage.key({}, [])
    store.put(stage, key, fitted.arrays("fine"))
    again = stored(store.get(stage, key), "fine")
    assert again.bits == fitted.bits
    values = levels(2, channels)[0]
    assert np.array_equal(again.signs(values), fitted.signs(values))
