"""How many bits of a 64-bit integer are set, for compiled loops: LLVM makes one instruction of it.

A kernel that calls it keeps its compiled copy when this file changes: what it returns must never change.
"""

from __future__ import annotations

import numpy as np

from fdslam.native import njit

# By two, by four, by eight, then all eights at once.
_TWOS, _FOURS, _EIGHTS = (np.uint64(n) for n in (0x5555555555555555, 0x3333333333333333, 0x0F0F0F0F0F0F0F0F))
_ALL, _1, _2, _4, _56 = (np.uint64(n) for n in (0x0101010101010101, 1, 2, 4, 56))


@njit
def bits_set(value):
    """Count the bits that are set in a uint64."""
    value -= (value >> _1) & _TWOS
    value = (value & _FOURS) + ((value >> _2) & _FOURS)
    return (((value + (value >> _4)) & _EIGHTS) * _ALL) >> _56
