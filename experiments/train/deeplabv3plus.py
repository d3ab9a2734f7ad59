"""Train, export and test the segmentation of the embedded world: ``python -m experiments.train.deeplabv3plus``."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from experiments.train.data import IGNORED, Sample, batches, crop, recolored, sample_of
from experiments.train.export import Runner, export
from experiments.train.loop import options, prepare, rounds, train
from experiments.train.measure import confusion, iou, merged_iou
from experiments.train.networks import DeepLabV3Plus
from experiments.train.views import Views, joined, load
from fdslam.data.campus import SESSIONS
from fdslam.types import LABELS

SIDE = 512  # pixels: an image is stretched to SIDE × SIDE
NAME = "deeplabv3plus_campus"
DULL = LABELS.index("sky"), LABELS.index("ground")
OBJECT = LABELS.index("object")


@dataclass(frozen=True)
class Round:
    """How a round of the training sees the views."""

    window: int  # pixels: side of what is cut out of an image of SIDE × SIDE
    scale: tuple[float, float]  # least and largest factor of the image's size
    indoors: int  # how often in an epoch each view from indoors is seen
    objects: float  # weight of a pixel of an object
    rate: float  # largest step size


# First many small windows, then few large ones: a ceiling is told from a white sky by what is around.
ROUNDS = Round(256, (0.5, 1.5), 1, 1.0, 3e-3), Round(384, (0.6, 1.2), 3, 2.0, 2e-3)


def augmented(views: Views, plan: Round, side: int, rng: np.random.Generator, index: int) -> Sample:
    """Return a window of a view, for a network whose input has ``side``."""
    height, width = views.labels.shape[1:]
    size = side * plan.window // SIDE
    sample = crop(rng, sample_of(views, index), (side / width, side / height), plan.scale, (size, size))
    return Sample(recolored(rng, sample.image), sample.labels, sample.classes, sample.boxes, sample.clear)


def loss_of(samples: list[Sample], device: str, objects: float, net: nn.Module) -> Tensor:
    """Return the mean cross entropy over the pixels that count, those of objects weighted."""
    images = torch.from_numpy(np.stack([s.image for s in samples])).to(device).permute(0, 3, 1, 2).float()
    labels = torch.from_numpy(np.stack([s.labels for s in samples])).to(device).long()
    logits = net(images.contiguous(memory_format=torch.channels_last))
    weight = torch.tensor([objects if name == "object" else 1.0 for name in LABELS], device=logits.device)
    return F.cross_entropy(logits, labels, weight, ignore_index=IGNORED)


def stretched(image: NDArray[np.uint8], side: int = SIDE) -> NDArray[np.float32]:
    """Return an image [H, W, 3] as input [1, 3, side, side] of the network."""
    smaller = image.shape[0] * image.shape[1] > 2 * side * side
    resized = cv2.resize(image, (side, side), interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)
    return resized.transpose(2, 0, 1)[None].astype(np.float32)


def labelled(logits: NDArray[np.float32], height: int, width: int) -> NDArray[np.uint8]:
    """Return the label image [height, width] of logits [1, classes, side, side]: brought to its size, then decided."""
    maps = [cv2.resize(one, (width, height), interpolation=cv2.INTER_LINEAR) for one in logits[0]]
    return np.argmax(maps, axis=0).astype(np.uint8)


def matrices(run: Callable[[NDArray[np.float32]], NDArray[np.float32]], views: Views) -> NDArray[np.int64]:
    """Return the confusion matrix [n, true, said] of every view."""
    height, width = views.labels.shape[1:]
    said = (labelled(run(stretched(image)), height, width) for image in views.images)
    return np.stack([confusion(true, one, len(LABELS)) for true, one in zip(views.labels, said, strict=True)])


def report(run: Callable[[NDArray[np.float32]], NDArray[np.float32]], views: dict[str, Views]) -> str:
    """Return the table of IoU, per session and indoors and outdoors."""
    per = {name: matrices(run, one) for name, one in views.items()}
    every, inside = np.concatenate(list(per.values())), np.concatenate([views[name].indoors for name in per])
    rows = {**per, "outdoors": every[~inside], "indoors": every[inside], "all": every}
    lines = [
        "| | " + " | ".join(LABELS) + " | sky + ground | pixels right | objects masked |",
        "|---" * (len(LABELS) + 4) + "|",
    ]
    for name, counts in rows.items():
        table = counts.sum(0) if len(counts) else np.zeros((len(LABELS), len(LABELS)), np.int64)
        right = np.trace(table) / max(1, table.sum())
        lost = table[OBJECT, list(DULL)].sum() / max(1, table[OBJECT].sum())  # pixels of objects that are called dull
        figures = [*iou(table), merged_iou(table, DULL), right, lost]
        lines.append(
            f"| {name} ({len(counts)}) | " + " | ".join("–" if np.isnan(f) else f"{f:.3f}" for f in figures) + " |"
        )
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> None:
    """Render what is missing, train, export, check the export, and print the figures on unseen campuses."""
    args = options(__doc__, epochs=(4, 1), batch=12).parse_args(argv)
    prepare(args)
    size = {"height": args.height, "width": args.width, "workers": args.threads}
    small = min(args.height, args.width) < 200  # a trial

    def train_round(net: nn.Module, number: int) -> nn.Module:
        plan = ROUNDS[number]
        views = joined(list(load(args.store, args.seeds, args.every, **size).values()))
        seen = joined(list(load(args.store, args.validation, 2 * args.every, **size).values()))
        order = np.repeat(np.arange(len(views.images)), np.where(views.indoors, plan.indoors, 1))
        make = partial(augmented, views, plan, SIDE // 4 if small else SIDE)

        def epoch_of(epoch: int) -> Iterator[Callable[[nn.Module], Tensor]]:
            drawn = batches(
                len(order), args.batch, args.seed, 100 * number + epoch, lambda rng, k: make(rng, int(order[k]))
            )
            for samples in drawn:
                yield partial(loss_of, samples, args.device, plan.objects)

        def check(average: nn.Module) -> str:
            table = matrices(Runner.of_network(average, args.device), seen).sum(0)
            return f"IoU {np.round(iou(table), 3)}, sky + ground {merged_iou(table, DULL):.4f}"

        return train(net, args.epochs[number], plan.rate, epoch_of, len(order) // args.batch, check)

    net: nn.Module = DeepLabV3Plus(len(LABELS)).to(args.device, memory_format=torch.channels_last)
    net = rounds(net, args, NAME, train_round)
    metadata = {
        "names": str(dict(enumerate(LABELS))),
        "fdslam.layout": "logits",
        "fdslam.labels": json.dumps(LABELS),
        "fdslam.channels": "rgb",
        "fdslam.mean": "0 0 0",
        "fdslam.std": "1 1 1",
        "fdslam.domain": "embedded world only",
    }
    path = args.out / f"{NAME}.onnx"
    test = load(args.store, args.test, args.every, **size)
    examples = [stretched(one.images[0]) for one in test.values()]
    difference = export(net.cpu(), examples, path, "image", "logits", metadata)
    print(f"{path}: {path.stat().st_size:,} bytes; onnxruntime against torch: at most {difference:.2e}")
    print(report(Runner.of_file(path), {name: test[name] for name in SESSIONS}))


if __name__ == "__main__":
    main()
