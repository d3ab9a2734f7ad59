"""Oracle: ranks by counting cells, sums of fractions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import rankdata

from fdslam import fusion
from fdslam.errors import InputError
from fdslam.fusion import RULES, competition_ranks, fuse
from tests import reference

SHAPES = [(2, 3), (1, 4), (3, 1)]


@st.composite
def detectors(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    number, levels = draw(st.integers(1, 5)), draw(st.sampled_from([1, 4, 10**6]))
    shapes = SHAPES[: draw(st.integers(1, 3))]
    return [[rng.integers(0, levels, shape).astype(np.float32) for shape in shapes] for _ in range(number)]


@settings(max_examples=60, deadline=None)
@given(detectors(), st.sampled_from(RULES))
def test_matches_counting(maps, rule):
    fused = fuse(maps, rule)
    assert [cells.shape for cells in fused] == [cells.shape for cells in maps[0]]
    assert all(cells.dtype == np.float64 for cells in fused)
    flat = np.concatenate([cells.ravel() for cells in fused])
    exact = rule in ("harmonic", "reciprocal")  # the others hold logarithms, and sums that cancel
    oracle = np.array(reference.fuse(maps, rule), dtype=float)
    np.testing.assert_allclose(flat, oracle, rtol=1e-14 if exact else 1e-12, atol=0 if exact else 1e-12)


@settings(max_examples=60, deadline=None)
@given(detectors(), st.sampled_from(RULES), st.randoms(use_true_random=False))
def test_order_of_detectors_and_queries_changes_no_bit(maps, rule, random):
    fused = fuse(maps, rule)
    queries = random.sample(range(len(fused)), len(fused))
    shuffled = random.sample(maps, len(maps))
    again = fuse([[detector[q] for q in queries] for detector in shuffled], rule)
    for cells, q in zip(again, queries, strict=True):
        assert np.array_equal(cells, fused[q])


@settings(max_examples=30, deadline=None)
@given(detectors(), st.sampled_from(RULES))
def test_only_the_order_of_the_values_matters(maps, rule):
    other = [[np.log1p(cells.astype(np.float64)) * 3 - 5 for cells in detector] for detector in maps]
    for one, two in zip(fuse(maps, rule), fuse(other, rule), strict=True):
        assert np.array_equal(one, two)


@pytest.mark.parametrize("rule", RULES)
def test_one_detector_keeps_its_order(rule):
    cells = np.array([[0.5, -1, 3, 0.5]], np.float32)
    fused = fuse([[cells]], rule)[0]
    assert np.argsort(fused[0], kind="stable").tolist() == [1, 0, 3, 2]
    assert fused[0, 0] == fused[0, 3]


def test_harmonic_vetoes_and_reciprocal_does_not():
    """The first cell is the most likely for one detector and the least for the other."""
    one, two = np.array([[5, 4, 3, 2, 1]], np.float32), np.array([[1, 4, 5, 3, 2]], np.float32)
    assert fuse([[one], [two]], "harmonic")[0].argmin() in (0, 4)
    assert fuse([[one], [two]], "harmonic")[0][0].tolist() == pytest.approx([10 / 6, 4, 30 / 8, 12 / 5, 4 / 3])
    assert fuse([[one], [two]], "reciprocal")[0][0].tolist() == pytest.approx([6 / 5, 1, 4 / 3, 7 / 12, 9 / 20])


def test_p_values_add_up_where_detectors_agree():
    """Cell 0 is first for one detector and last for the other; cell 1 is second for both."""
    one, two = np.array([[5, 4, 3, 2, 1]], np.float32), np.array([[1, 4, 3, 2, 5]], np.float32)
    assert fuse([[one], [two]], "stouffer")[0].argmax() == 1
    assert fuse([[one], [two]], "stouffer")[0][0, 0] == pytest.approx(0, abs=1e-12)
    assert fuse([[one], [two]], "fisher")[0][0].tolist() == pytest.approx(
        [-np.log(0.1 * 0.9), -2 * np.log(0.3), -2 * np.log(0.5), -2 * np.log(0.7), -np.log(0.9 * 0.1)]
    )
    blind = np.zeros((1, 5), np.float32)  # says nothing, and changes no order
    assert fuse([[one], [blind]], "stouffer")[0].argsort().tolist() == one.argsort().tolist()


@pytest.mark.parametrize(
    ("maps", "rule", "message"),
    [
        ([[np.zeros((1, 1))]], "borda", "fusion rule 'borda': choose one of harmonic, reciprocal, stouffer, fisher"),
        ([], "harmonic", "no detector"),
        ([[np.zeros((1, 2))], [np.zeros((2, 1))]], "harmonic", "differ in number or shape"),
        ([[np.zeros((1, 2))], []], "harmonic", "differ in number or shape"),
    ],
)
def test_bad_input(maps, rule, message):
    with pytest.raises(InputError, match=message) as error:
        fuse(maps, rule)
    assert "\n" not in str(error.value)


def test_no_queries():
    assert fuse([[], []], "harmonic") == []


@settings(max_examples=100, deadline=None)
@given(arrays(np.float32, st.integers(0, 60), elements=st.sampled_from([-2.0, -0.0, 0.0, 1.0, 1.5, 7.0])))
def test_competition_ranks_are_those_of_scipy(values):
    assert np.array_equal(competition_ranks(values), rankdata(values, method="min"))


@settings(max_examples=40, deadline=None)
@given(detectors(), st.sampled_from(RULES), st.integers(1, 50))
def test_chunks_of_any_size_give_the_same(maps, rule, chunk):
    whole = fuse(maps, rule)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fusion, "CHUNK", chunk)
        again = fuse(maps, rule)
    assert all(np.array_equal(one, two) for one, two in zip(whole, again, strict=True))
