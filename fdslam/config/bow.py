"""The switches of the bag of words (§FD)."""

from __future__ import annotations

from dataclasses import dataclass

from fdslam.config.options import Checked, option


@dataclass
class Orb(Checked):
    """Keypoints and descriptors of an image."""

    features: int = option(1500, "ORB features per image", low=1, high=20_000)
    grid: int = option(8, "spread the features over about grid² equal cells; 0: OpenCV's own choice", low=0, high=64)
    min_side: int = option(720, "upscale images whose shorter side is below this, pixels; 0: never", low=0, high=8192)
    fast_threshold: int = option(20, "FAST threshold of ORB, grey levels", low=1, high=255)


@dataclass
class Vocabulary(Checked):
    """The incremental vocabulary."""

    ratio: float = option(0.8, "a word is accepted if d1 <= ratio * d2", low=0, high=1)
    exact_below: int = option(100_000, "exact search of fewer words, by lists around pivots of more", low=1)
    probes: int = option(32, "lists searched per keypoint after that: its recall", choices=(8, 16, 32, 64))
    second: str = option(
        "nearest",
        "d2 is the distance of the second nearest word, or of the nearest that another place gave",
        choices=("nearest", "other_place"),
    )
    purge: bool = option(False, "drop words seen fewer than 2 times by the second image after their own")


@dataclass
class Retrieval(Checked):
    """Weak lists."""

    document: str = option("image", "what the map posts: its images, or each of their OBBs", choices=("image", "obb"))
    score: str = option(
        "ibow", "Σ over words of n_jw² idf c | n_jw idf c | idf of those present", choices=("ibow", "tfidf", "binary")
    )
    unretrieved: str = option(
        "last", "rank of images with score 0: M, or next after the others", choices=("last", "next")
    )
    islands: str = option(
        "none",
        "neighbours along the path vouch for each other: iBoW-LCD's rule, DLoopDetector's, or not",
        choices=("none", "ibow", "dloop"),
    )
    verify_top: int = option(0, "images of each list that are verified by geometry; 0: none", low=0, high=10_000)
    verify_inliers: int = option(20, "agreeing keypoints of the whole query that verify an image", low=1)
    min_keypoints: int = option(1, "an OBB with fewer keypoints says nothing", low=1)


@dataclass
class Bow(Orb, Vocabulary, Retrieval):
    """Bag of words (§FD)."""
