"""Train BING's filters: python -m experiments.train.bing [--out FILE] [dataset=folder dataset.root=DIR …]

Without a data set: on views of the embedded world, campuses that no test and no table knows, and the figures for
the card are printed, measured on others. With one, named as for fdslam.run: on the boxes annotated in its queries.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from experiments.obb_study.detection_rate import AT, random_boxes, rates
from experiments.train.scenes import annotated_scenes, campus_scenes, load
from fdslam.errors import InputError
from fdslam.obb.bing import OWN, digest, proposals, save_filters
from fdslam.obb.bing.filters import SIZES, Filters
from fdslam.obb.bing.gradient import SPACES
from fdslam.obb.bing.training import Scene, Training, train
from fdslam.progress import single_threaded
from fdslam.run import USAGE_ERROR

SEEDS, UNSEEN = range(1000, 1012), range(2000, 2004)  # campuses; 4 is the one of the tests and of the tables
DEFAULT = ("hsv",)  # colour spaces
IMAGES = 48  # views of each, a quarter of them in each session


def card(filters: tuple[Filters, ...], scenes: list[Scene]) -> str:
    """Return the detection rate on scenes not trained on, beside random boxes, as Markdown."""
    objects = sum(len(scene.objects) for scene in scenes)
    lines = [
        f"% of {objects} objects in {len(scenes)} views found (IoU ≥ 0.5) among the first n proposals:\n",
        "| n | " + " | ".join(map(str, AT)) + " |\n|---|" + "---:|" * len(AT),
    ]
    most = max(AT)
    rows = {one.space: rates(scenes, lambda image, _, one=one: proposals(image, one, most)[0]) for one in filters}
    if len(filters) > 1:
        rows["together"] = rates(scenes, lambda image, _: proposals(image, filters, most)[0])
    rows["random boxes"] = rates(scenes, lambda image, rng: random_boxes(*image.shape[:2], most, rng))
    lines += [
        f"| {name} | " + " | ".join(f"{100 * curve[n - 1]:.1f}" for n in AT) + " |" for name, curve in rows.items()
    ]
    return "\n".join(lines)


def main() -> None:
    """Train, write, and print the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("overrides", nargs="*", metavar="KEY=VALUE", help="a data set, as for fdslam.run")
    parser.add_argument("--out", type=Path, default=OWN, help="the filters; default: those of the package")
    parser.add_argument("--space", action="append", choices=tuple(SPACES), help="colour space, again for several")
    parser.add_argument("--seed", type=int, default=Training().seed, help="of the windows that are drawn")
    parser.add_argument("--campuses", type=int, default=len(SEEDS), help="how many, of the embedded world")
    parser.add_argument("--images", type=int, default=IMAGES, help="views of each")
    parser.add_argument("--workers", type=int, default=0, help="threads; 0: one a core")
    given = parser.parse_args()
    single_threaded()
    begin = time.perf_counter()
    unseen: list[Scene] = []
    if given.overrides:
        scenes = list(annotated_scenes(load(given.overrides, given.workers)))
    else:
        scenes = list(campus_scenes(SEEDS[: given.campuses], given.images, given.workers))
        unseen = list(campus_scenes(UNSEEN, given.images, given.workers))
    settings = Training(seed=given.seed)
    filters = tuple(train(scenes, space, settings, given.workers) for space in given.space or DEFAULT)
    save_filters(given.out, filters)
    objects = sum(len(scene.objects) for scene in scenes)
    print(f"{settings}\ntrained on {objects} objects in {len(scenes)} images, {time.perf_counter() - begin:.0f} s")
    for one in filters:
        print(f"{one.space}: sizes (h × w) {', '.join('{} × {}'.format(*SIZES[i]) for i in one.sizes)}")
    print(f"{given.out}: {given.out.stat().st_size} bytes, content {digest(filters)}\n")
    if unseen:
        print(card(filters, unseen))


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        print(f"fdslam: {error}", file=sys.stderr)
        sys.exit(USAGE_ERROR)
