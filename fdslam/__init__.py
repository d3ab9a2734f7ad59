"""fdslam: where the robot is and what has changed, from one live image and a compact bag-of-words map."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fdslam.api import ChangeDetector as ChangeDetector
    from fdslam.detection import Detection as Detection

__all__ = ["ChangeDetector", "Detection"]


def __getattr__(name: str) -> Any:
    """Import the library when it is asked for: its stages take seconds, and the command checks its words before."""
    if name == "ChangeDetector":
        from fdslam.api import ChangeDetector

        return ChangeDetector
    if name == "Detection":
        from fdslam.detection import Detection

        return Detection
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
