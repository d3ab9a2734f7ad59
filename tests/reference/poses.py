"""Poses between poses, as loops: one image at a time, angles as complex numbers."""

import cmath
import math


def interpolated(rows, utime, gap):
    """Return (x, y, heading) at ``utime`` µs from (utime, x, y, heading) rows in any order, or None.

    Of rows with one stamp the first counts, and rows with NaN do not.
    """
    known = {}
    for stamp, x, y, heading in rows:
        if not any(math.isnan(value) for value in (x, y, heading)) and stamp not in known:
            known[stamp] = (x, y, heading)
    if utime in known:
        return known[utime]
    before = [stamp for stamp in known if stamp < utime]
    after = [stamp for stamp in known if stamp > utime]
    if not before or not after or min(after) - max(before) > round(gap * 1e6):
        return None
    t0, t1 = max(before), min(after)
    share = (utime - t0) / (t1 - t0)
    (x0, y0, h0), (x1, y1, h1) = known[t0], known[t1]
    turn = cmath.phase(cmath.rect(1, h1) / cmath.rect(1, h0))
    return x0 + share * (x1 - x0), y0 + share * (y1 - y0), h0 + share * turn


def sampled(utimes, poses, every, seconds):
    """Return which images are kept, by the words of the docstring of ``sample``."""
    kept = []
    for i in range(len(utimes)):
        if not kept:
            kept.append(i)
            continue
        last = kept[-1]
        distance = math.dist(poses[i][:2], poses[last][:2])
        if distance >= every and utimes[i] - utimes[last] >= round(seconds * 1e6):
            kept.append(i)
    return kept
