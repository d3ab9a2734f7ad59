"""The four sessions, as NCLT's: what the light and the plants, snow, rain and people have made of the campus."""

from __future__ import annotations

from dataclasses import dataclass

from fdslam.data.campus.light import Light
from fdslam.data.campus.texture import Color


@dataclass(frozen=True)
class Season:
    """What a session's day is like; shares are 0..1."""

    light: Light
    leaves: tuple[Color, ...]  # a plant takes one of the four
    density: float  # share of a crown that is full of leaves; 0: bare
    grass: Color
    litter: float  # fallen leaves per square metre near the path
    snow: float  # share of open ground under snow
    wet: float  # share of the paving that is wet
    walkers: int  # whose footprints are to be seen
    wheels: int  # of carts and bicycles, whose tracks are to be seen
    shut: float  # share of the windows with a drawn blind
    lamps: float  # share of the windows with a light behind


WINTER = Season(
    Light(
        azimuth=-2.2, elevation=0.3, sun=(0.30, 0.28, 0.27), ambient=(0.68, 0.70, 0.75), zenith=(176, 184, 196),
        horizon=(220, 224, 229), clouds=0.95, exposure=1.14, balance=(0.98, 1.0, 1.03), gamma=1.08, noise=4.5,
        haze=80.0,
    ),
    ((104, 92, 80), (96, 88, 76), (112, 98, 84), (60, 86, 62)), 0.0, (138, 134, 100), 0.0, 0.8, 0.4, 7, 3, 0.3, 0.22,
)  # fmt: skip
SPRING = Season(
    Light(
        azimuth=-0.9, elevation=0.7, sun=(0.62, 0.60, 0.54), ambient=(0.48, 0.52, 0.60), zenith=(104, 148, 206),
        horizon=(204, 220, 234), clouds=0.6, exposure=1.06, balance=(0.99, 1.0, 1.02), gamma=1.0, noise=2.4, haze=320.0,
    ),
    ((158, 180, 84), (140, 168, 70), (226, 186, 196), (128, 160, 76)), 0.28, (128, 146, 74), 0.05, 0.0, 0.55, 2, 3,
    0.12, 0.03,
)  # fmt: skip
SUMMER = Season(
    Light(
        azimuth=-1.9, elevation=1.0, sun=(0.64, 0.61, 0.55), ambient=(0.53, 0.57, 0.62), zenith=(92, 140, 206),
        horizon=(196, 216, 232), clouds=0.45, exposure=1.06, balance=(1.0, 1.0, 1.0), gamma=1.0, noise=2.0, haze=260.0,
    ),
    ((92, 138, 58), (72, 118, 52), (112, 150, 70), (84, 126, 76)), 1.0, (112, 142, 74), 0.0, 0.0, 0.0, 0, 1, 0.18, 0.0,
)  # fmt: skip
AUTUMN = Season(
    Light(
        azimuth=0.5, elevation=0.42, sun=(0.74, 0.56, 0.36), ambient=(0.46, 0.48, 0.56), zenith=(112, 130, 172),
        horizon=(240, 206, 168), clouds=0.7, exposure=1.12, balance=(1.05, 0.99, 0.92), gamma=1.08, noise=2.8,
        haze=200.0,
    ),
    ((196, 132, 48), (178, 92, 42), (150, 140, 60), (206, 164, 70)), 0.55, (132, 136, 78), 0.8, 0.0, 0.35, 0, 2, 0.2,
    0.12,
)  # fmt: skip
SEASONS = {"WI": WINTER, "SP": SPRING, "SU": SUMMER, "AU": AUTUMN}
SESSIONS = tuple(SEASONS)  # the order of the names in every listing
