"""Against loops with complex numbers (tests/reference/poses.py)."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fdslam.data.nclt.poses import Track, interpolate, read_track, sample, wrap
from fdslam.errors import InputError
from tests.reference.poses import interpolated, sampled

STAMP = st.integers(0, 40).map(lambda step: 1_326_000_000_000_000 + step * 100_000)
VALUE = st.one_of(st.floats(-50, 50), st.just(math.nan))
ROWS = st.lists(st.tuples(STAMP, VALUE, VALUE, st.one_of(st.floats(-9, 9), st.just(math.nan))), min_size=1, max_size=12)
GAP = st.sampled_from([0.0, 0.1, 0.25, 1.0, 5.0])


def written(path, rows):
    lines = [f"{u},{x!r},{y!r},0.5,0.0,-0.0,{h!r}\n" for u, x, y, h in rows]
    path.write_text("".join(lines))
    return path


@given(ROWS, st.lists(st.integers(-200_000, 4_200_000), min_size=1, max_size=8), GAP)
def test_poses_between_poses(tmp_path_factory, rows, offsets, gap):
    assume(any(not math.isnan(x + y + h) for _, x, y, h in rows))
    track = read_track(written(tmp_path_factory.getbasetemp() / "poses.csv", rows))
    utimes = np.array([1_326_000_000_000_000 + offset for offset in offsets])
    found = interpolate(track, utimes, gap)
    for utime, pose in zip(utimes.tolist(), found, strict=True):
        expected = interpolated(rows, utime, gap)
        if expected is None:
            assert np.isnan(pose).all()
            continue
        np.testing.assert_allclose(pose[:2], expected[:2], atol=1e-9)
        assert -math.pi < pose[2] <= math.pi
        assert (
            abs(complex(math.cos(pose[2]), math.sin(pose[2])) - complex(math.cos(expected[2]), math.sin(expected[2])))
            < 1e-6
        )


@given(
    st.lists(st.tuples(st.integers(0, 500_000), st.floats(-9, 9), st.floats(-9, 9)), min_size=1, max_size=30),
    st.sampled_from([0.0, 1.0, 5.0]),
    st.sampled_from([0.0, 0.2, 1.0]),
)
def test_sampling_by_distance_and_time(steps, every, seconds):
    utimes = np.cumsum([step for step, _, _ in steps])
    poses = np.array([(x, y, 0.0) for _, x, y in steps])
    assert sample(utimes, poses, every, seconds).tolist() == sampled(utimes.tolist(), poses.tolist(), every, seconds)


def test_headings_take_the_shorter_arc():
    track = Track(np.array([0, 100]), np.array([[0, 0, math.radians(170)], [1, 0, math.radians(-170)]]))
    assert math.degrees(interpolate(track, np.array([75]), 1)[0, 2]) == pytest.approx(-175)
    np.testing.assert_allclose(
        wrap(np.array([0.0, math.pi, -math.pi, 3 * math.pi, 7.0])), [0, math.pi, math.pi, math.pi, 7 - 2 * math.pi]
    )


def test_nothing_is_known_before_the_first_pose_in_a_gap_and_after_the_last():
    track = Track(np.array([1_000_000, 1_200_000, 3_000_000]), np.array([[1.0, 5, 0], [3, 5, 0], [9, 9, 1]]))
    found = interpolate(track, np.array([999_999, 1_000_000, 1_100_000, 2_000_000, 3_000_000, 3_000_001]), 0.2)
    assert np.isnan(found[[0, 3, 5]]).all()
    assert found[[1, 2, 4]].tolist() == [[1, 5, 0], [2, 5, 0], [9, 9, pytest.approx(1)]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "holds no pose"),
        ("\n\n", "holds no pose"),
        ("1,NaN,NaN,NaN,NaN,NaN,NaN\n2,nan,0,0,0,0,0\n", "holds no pose"),
        ("1,0,0,0,0,0,0\n\n2,0,0,0,0,north,0\n2,zero,0,0,0,0,0\n", "line 4: utime,x,y"),
        ("utime,x,y,z,roll,pitch,heading\n1,0,0,0,0,0,0\n", "line 1: utime,x,y"),
        ("# made by hand\n1,0,0,0,0,0,0\n", "line 1: utime,x,y"),
        ("1,0,0,0,0,0,0\n2,0,0\n", "line 2: utime,x,y"),
        ("1;0;0;0;0;0;0\n", "line 1: utime,x,y"),
        ("0.5,0,0,0,0,0,0\n", "no time stamp"),
        ("-5,0,0,0,0,0,0\n", "no time stamp"),
        ("1e300,0,0,0,0,0,0\n", "no time stamp"),
    ],
)
def test_a_file_that_holds_no_poses_is_named(tmp_path, text, said):
    path = tmp_path / "groundtruth_2012-01-22.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=rf"groundtruth_2012-01-22\.csv.*{said}") as error:
        read_track(path)
    assert "\n" not in str(error.value)


def test_a_binary_file_is_named(tmp_path):
    (tmp_path / "poses.csv").write_bytes(bytes(range(256)) * 9)
    with pytest.raises(InputError, match=r"poses\.csv"):
        read_track(tmp_path / "poses.csv")


def test_nan_rows_duplicates_and_any_order(tmp_path):
    rows = [(30, 3, 0, 0), (10, 1, 0, 0), (20, math.nan, 0, 0), (10, 7, 0, 0)]
    track = read_track(written(tmp_path / "poses.csv", rows))
    assert track.utimes.tolist() == [10, 30]
    assert track.poses[:, 0].tolist() == [1, 3]
