"""Oracle: reference (analytic derivatives, full resolution, a loop over pixels) and images of known corners."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import fdslam.harris_laplace
from fdslam.config import Keypoints
from fdslam.data.images import read_image
from fdslam.harris_laplace import FLOOR, HarrisLaplace, harris_laplace, sift
from tests import reference

ALL = Keypoints(keypoints=100_000)


def rgb(grey):
    return np.repeat(np.clip(np.round(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def texture(seed, height, width):
    """Colour noise of all scales between 1 and 8 pixels, so that every octave has keypoints."""
    rng = np.random.default_rng(seed)
    image = sum(
        s * gaussian_filter(rng.normal(size=(height, width, 3)), (s, s, 0), mode="reflect") for s in (1, 2, 4, 8)
    )
    return np.clip(128 + 60 * image, 0, 255).astype(np.uint8)


def rows(k):
    return np.column_stack([k.xy, k.scale, k.response])


def take(k, index):
    return HarrisLaplace(k.xy[index], k.scale[index], k.response[index])


def near(a, b, pixels):
    """Return the share of a's keypoints that have one of b at the same scale within so many pixels."""
    same = np.isclose(a[:, None, 2], b[None, :, 2]) & (np.abs(a[:, None, :2] - b[None, :, :2]).max(axis=2) <= pixels)
    return same.any(axis=1).mean()


@pytest.mark.parametrize(("seed", "k"), [(0, 0.04), (1, 0.06), (2, 0.0)])
def test_full_resolution_is_the_definition(monkeypatch, seed, k):
    monkeypatch.setattr(fdslam.harris_laplace, "LEVEL_SIGMA", 1e9)
    config = Keypoints(keypoints=100_000, harris_k=k)
    image = texture(seed, 90, 110)
    ours, oracle = harris_laplace(image, config), np.array(reference.harris_laplace(image, config, FLOOR))
    assert len(oracle) > 30
    # A pixel at which two scales or two neighbours are equal to a part in a thousand may fall either way: one in fifty.
    assert near(oracle, rows(ours), 0) >= 0.95
    assert near(rows(ours), oracle, 0) >= 0.95
    response = {(x, y, round(s, 3)): r for x, y, s, r in oracle.tolist()}
    for x, y, s, r in rows(ours).tolist():
        assert r == pytest.approx(response.get((x, y, round(s, 3)), r), rel=0.02)


@pytest.mark.parametrize("seed", [3, 4])
def test_pyramid_agrees_with_full_resolution(seed):
    image = texture(seed, 130, 151)
    ours, oracle = rows(harris_laplace(image, ALL)), np.array(reference.harris_laplace(image, ALL, FLOOR))
    assert near(oracle, ours, 1) >= 0.9
    assert near(ours, oracle, 1) >= 0.9
    response = {(x, y, round(s, 3)): r for x, y, s, r in oracle.tolist()}
    ratio = [r / response.get((x, y, round(s, 3)), np.nan) for x, y, s, r in ours.tolist() if s > 4]
    assert np.nanmedian(np.abs(np.array(ratio) - 1)) < 0.006  # nan where the place differs
    coarse = oracle[oracle[:, 2] > 4]  # the octaves above the first
    assert len(coarse) >= 10
    assert near(coarse, ours, 1) >= 0.65
    assert near(ours[ours[:, 2] > 4], oracle, 1) >= 0.65


@pytest.mark.parametrize("seed", [14, 15])
def test_strips_are_the_whole(monkeypatch, seed):
    image = texture(seed, 131, 90)
    k = harris_laplace(image, ALL)
    assert len(k.scale) > 30
    for rows_at_once in (1, 7, 64, 1000):
        monkeypatch.setattr(fdslam.harris_laplace, "STRIP", rows_at_once)
        np.testing.assert_array_equal(rows(harris_laplace(image, ALL)), rows(k))


@pytest.mark.parametrize("threads", [2, 5])
@pytest.mark.parametrize("settings", [{}, {"scales": 3}, {"scales": 20}, {"sigma": 6.0}, {"keypoints": 50}])
def test_threads_change_no_byte(settings, threads):
    image, config = texture(4, 230, 170), Keypoints(**{"keypoints": 100_000, **settings})
    alone, shared = harris_laplace(image, config), harris_laplace(image, config, threads)
    assert len(alone.scale) > 0
    assert rows(shared).tobytes() == rows(alone).tobytes()


def test_on_a_real_image():
    folder = Path(__file__).parents[2] / "shared" / "data" / "stromovka_winter" / "query"
    if not folder.is_dir():
        pytest.skip("../shared/data is not there")
    image = read_image(min(folder.glob("*.jpg")))[40:200, 300:540].copy()
    ours, oracle = rows(harris_laplace(image, ALL)), np.array(reference.harris_laplace(image, ALL, FLOOR))
    assert len(oracle) > 100
    assert near(oracle, ours, 1) >= 0.95
    assert near(ours, oracle, 1) >= 0.95


Y, X = np.mgrid[:97, :120].astype(float)


@pytest.mark.parametrize(
    "grey",
    [np.zeros((97, 120)), np.full((97, 120), 255), X, 2 * Y, X + Y, 250 - 0.5 * X - Y, 0.3 * X + 0.1 * Y],
    ids=["black", "white", "right", "down", "diagonal", "back", "faint"],
)
def test_blank_and_gradient_have_none(grey):
    k = harris_laplace(rgb(grey), ALL)
    assert [k.xy.shape, k.scale.shape, k.response.shape] == [(0, 2), (0,), (0,)]


@pytest.mark.parametrize("shape", [(1, 1), (1, 300), (300, 1), (2, 3), (8, 8), (9, 40)])
def test_tiny(shape):
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (*shape, 3), dtype=np.uint8)
    k = harris_laplace(image, ALL)
    assert k.xy.dtype == k.scale.dtype == k.response.dtype == np.float32
    assert k.xy.shape == (len(k.scale), 2)
    assert sift(image, k).shape == (len(k.scale), 128)
    assert len(harris_laplace(image, Keypoints(sigma=16)).scale) == 0


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("off", [0.9, 1.1])
def test_scale_of_a_blob(n, off):
    # σ² |LoG| of a Gaussian blob of deviation s is largest at σ = s; the nearest of our scales wins.
    s = 1.5 * 1.4**n * off
    y, x = np.mgrid[:125, :139]
    k = harris_laplace(rgb(30 + 200 * np.exp(-((x - 66) ** 2 + (y - 60) ** 2) / (2 * s**2))), ALL)
    np.testing.assert_allclose(k.scale, [1.5 * 1.4**n], rtol=1e-6)
    np.testing.assert_allclose(k.xy, [[66, 60]], atol=1)


@pytest.mark.parametrize(("side", "n"), [(6, 1), (8, 2), (12, 3), (16, 4)])
def test_squares(side, n):
    # To a window of its own size a square is one corner, at its centre; its scale grows with its side.
    grey = np.full((190, 260), 40.0)
    places = [(x, y) for y in (45, 95, 145) for x in (40, 100, 161, 221)]
    for x, y in places:
        grey[y : y + side, x : x + side] = 200
    k = harris_laplace(rgb(grey), ALL)
    centres = np.array(places) + (side - 1) / 2
    far = np.abs(k.xy[:, None] - centres[None]).max(axis=2)
    assert len(k.scale) == len(places)
    assert (far.min(axis=0) <= 1).all()
    np.testing.assert_allclose(k.scale, 1.5 * 1.4**n, rtol=1e-6)


def test_a_checkerboard_has_no_scale():
    # At a saddle the Laplacian is 0 at every scale: the corners are there for Harris, but Laplace keeps none.
    board = np.kron(np.indices((6, 7)).sum(axis=0) % 2, np.ones((20, 20)))
    assert len(harris_laplace(rgb(40 + 160 * board), ALL).scale) == 0


def test_strongest_first_and_no_more_than_asked():
    image = texture(5, 96, 128)
    k = harris_laplace(image, ALL)
    assert len(k.scale) > 40
    assert (np.diff(k.response) <= 0).all()
    assert (k.response > FLOOR).all()
    np.testing.assert_array_equal(rows(harris_laplace(image, Keypoints(keypoints=17))), rows(k)[:17])
    border = np.minimum(k.xy, (127, 95) - k.xy).min(axis=1)
    assert (border >= k.scale).all()
    assert set(np.round(k.scale, 4)) <= {np.float32(round(1.5 * 1.4**n, 4)) for n in range(1, 7)}


def test_ties_by_position():
    tile = texture(6, 64, 64)
    tile[:, 48:] = tile[48:] = 128
    k = harris_laplace(np.tile(tile, (3, 3, 1)), ALL)
    key = [(-r, y, x, s) for x, y, s, r in rows(k).tolist()]
    assert key == sorted(key)
    assert len(set(k.response.tolist())) < len(k.response)


def test_transposed_image():
    image = texture(7, 97, 125)
    k, t = rows(harris_laplace(image, ALL)), rows(harris_laplace(image.transpose(1, 0, 2).copy(), ALL))
    assert near(k, t[:, [1, 0, 2, 3]], 0) >= 0.98
    assert abs(len(k) - len(t)) <= 0.02 * len(k)


def test_contrast_to_the_fourth():
    grey = texture(8, 96, 96)[..., 0] // 2
    weak, strong = (rows(harris_laplace(rgb(f * grey.astype(int) + c), ALL)) for f, c in ((1, 40), (2, 0)))
    assert near(weak, strong, 0) >= 0.98
    np.testing.assert_allclose(strong[:10, 3], 16 * weak[:10, 3], rtol=1e-3)


def test_sift_is_opencvs_at_its_own_keypoints():
    # OpenCV's detector packs octave and layer itself; made upright, its keypoints must give its descriptors.
    image = texture(9, 160, 200)
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    own = [p for p in cv2.SIFT.create().detect(grey) if p.octave & 255 < 128][:50]  # the undoubled octaves
    assert len(own) >= 15
    for p in own:
        p.angle = 0
    own, expected = cv2.SIFT.create().compute(grey, own)
    xy, size = np.array([p.pt for p in own], np.float32), np.array([p.size for p in own], np.float32)
    ours = sift(image, HarrisLaplace(xy, size / np.float32(2), size))
    distance = np.linalg.norm(ours - expected, axis=1)
    assert np.median(distance) < 30
    assert (distance < 150).all()


def test_sift_is_covariant_with_scale():
    image = texture(10, 256, 320)
    half = cv2.GaussianBlur(image, (0, 0), 1.0)[::2, ::2].copy()
    k = harris_laplace(image, ALL)
    k = take(k, k.scale > 4)
    a, b = sift(image, k), sift(half, HarrisLaplace(k.xy / 2, k.scale / 2, k.response))
    across = np.linalg.norm(a[:, None] - b[None], axis=2)
    assert len(k.scale) > 30
    assert np.median(np.diag(across)) < 25
    np.fill_diagonal(other := across.copy(), np.inf)
    assert (np.diag(across) < other.min(axis=1)).mean() >= 0.98


def test_sift_is_plain():
    image = texture(11, 96, 128)
    d = sift(image, harris_laplace(image, ALL))
    assert d.dtype == np.float32
    assert d.shape[1] == 128
    np.testing.assert_array_equal(d, np.round(d))
    assert ((d >= 0) & (d <= 255)).all()
    norm = np.linalg.norm(d, axis=1)
    assert ((norm > 495) & (norm < 520)).all()
    assert np.median(d.max(axis=1)) > 105  # a square root would leave hardly an entry above 90


def test_sift_of_a_keypoint_depends_on_nothing_else():
    image = texture(12, 96, 128)
    k = harris_laplace(image, ALL)
    order = np.random.default_rng(0).permutation(len(k.scale))
    d = sift(image, k)
    np.testing.assert_array_equal(sift(image, take(k, order)), d[order])
    np.testing.assert_array_equal(sift(image, take(k, order[:5])), d[order[:5]])
    assert sift(image, take(k, order[:0])).shape == (0, 128)


class Shuffling:
    """An extractor that hands its keypoints back in another order, or fewer of them."""

    def __init__(self, real, lost):
        self.real, self.lost = real, lost

    def create(self, **arguments):
        self.extractor = self.real.create(**arguments)
        return self

    def compute(self, grey, keypoints):
        kept, d = self.extractor.compute(grey, keypoints)
        return kept[::-1][self.lost :], d[::-1][self.lost :]


def test_sift_whatever_the_order_that_comes_back(monkeypatch):
    image = texture(13, 96, 128)
    k = harris_laplace(image, ALL)
    expected, real = sift(image, k), cv2.SIFT
    monkeypatch.setattr(cv2, "SIFT", Shuffling(real, 0))
    np.testing.assert_array_equal(sift(image, k), expected)
    monkeypatch.setattr(cv2, "SIFT", Shuffling(real, 1))
    with pytest.raises(RuntimeError, match="described"):
        sift(image, k)
