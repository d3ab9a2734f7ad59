"""The embedded world: a small synthetic campus, seen in two seasons, with everything known about every pixel."""

from fdslam.data.campus.sheet import contact_sheet
from fdslam.data.campus.world import View, World

__all__ = ["View", "World", "contact_sheet"]
