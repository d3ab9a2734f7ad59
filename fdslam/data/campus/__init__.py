"""The embedded world: a small synthetic campus, seen in four seasons, with everything known about every pixel."""

from fdslam.data.campus.seasons import SESSIONS
from fdslam.data.campus.world import View, World

__all__ = ["SESSIONS", "View", "World"]
