"""Train, export and test the detector of the embedded world: ``python -m experiments.train.yolo``."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from experiments.train.assign import decoded, detection_loss, grids
from experiments.train.data import GREY, Sample, batches, crop, mosaic, recolored, sample_of
from experiments.train.export import Runner, export
from experiments.train.loop import options, prepare, rounds, train
from experiments.train.measure import Found, average_precision, box_iou, match, recall
from experiments.train.networks import STRIDES, Detector
from experiments.train.views import CLASSES, Views, joined, load
from fdslam.data.campus import SESSIONS

HEIGHT, WIDTH = 416, 320  # pixels of the network's input
WINDOW = 320, 256  # height and width of what it is trained on, but for the last epoch: it costs three fifths
NAME = "yolo_campus"
RATES = 2.5e-3, 2e-3, 2e-3  # largest step size of each round
EVENLY = 0.0, 0.5, 0.7  # of the mosaics of each round: rare kinds are not for the beginning
INDOORS = 1, 2, 3  # how often in an epoch of each round each view from indoors is seen
MOSAICS = 0.6  # their share, but for a round's last epoch
MOST = 11  # boxes of an image
LEAST_SCORE, SAME = 0.1, 0.45  # a box below this score is left out, and one of this IoU with a better one of its kind
Model = Callable[[NDArray[np.float32]], NDArray[np.float32]]


def augmented(
    views: Views, ratio: float, size: tuple[int, int], share: float, evenly: float, rng: np.random.Generator, index: int
) -> Sample:
    """Return a mosaic around four objects, or, not ``share`` of the time, a window of a view, both recoloured.

    Args:
        views: to draw from.
        ratio: of the network's pixels to a view's.
        size: height and width of the sample.
        share: of mosaics.
        evenly: see ``mosaic``.
        rng: draws.
        index: of the view.
    """
    if rng.random() < share and views.clear.any():
        sample = mosaic(rng, views, (ratio, ratio), (0.5, 1.6), size, evenly)
    else:
        sample = crop(rng, sample_of(views, index), (ratio, ratio), (0.65, 1.6), size)
    return Sample(recolored(rng, sample.image), sample.labels, sample.classes, sample.boxes, sample.clear)


def loss_of(samples: list[Sample], device: str, net: nn.Module) -> Tensor:
    """Return the loss of a batch."""
    images = torch.from_numpy(np.stack([s.image[..., ::-1] for s in samples])).to(device).permute(0, 3, 1, 2).float()
    most = max(1, *(len(s.boxes) for s in samples))
    classes = np.zeros((len(samples), most), np.int64)
    boxes, clear = np.zeros((len(samples), most, 4), np.float32), np.zeros((len(samples), most), bool)
    for k, s in enumerate(samples):
        n = len(s.boxes)
        classes[k, :n], boxes[k, :n], clear[k, :n] = s.classes, s.boxes, s.clear
    height, width = images.shape[2:]
    raw = net(images.contiguous(memory_format=torch.channels_last))
    truth = (torch.from_numpy(a).to(device) for a in (classes, boxes, clear))
    return detection_loss(raw, height, width, *truth)


def letterboxed(image: NDArray[np.uint8], size: tuple[int, int] = (HEIGHT, WIDTH)) -> tuple[NDArray[np.float32], float]:
    """Return an image [H, W, 3] RGB as input [1, 3, *size] BGR, in the top left of grey, and the factor of its size."""
    height, width = image.shape[:2]
    ratio = min(size[0] / height, size[1] / width)
    wide, high = (max(1, int(n * ratio + 1e-9)) for n in (width, height))  # YOLOX drops the fraction
    method = cv2.INTER_AREA if ratio < 0.7 else cv2.INTER_LINEAR
    canvas = np.full((*size, 3), GREY, np.uint8)
    canvas[:high, :wide] = cv2.resize(image, (wide, high), interpolation=method)
    return np.ascontiguousarray(canvas[..., ::-1].transpose(2, 0, 1)[None], np.float32), ratio


def boxes_of(
    raw: NDArray[np.float32], ratio: float, size: tuple[int, int], shape: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]:
    """Return the boxes [k, 4] in pixels of an image of ``shape``, scores [k] falling, and kinds [k], of an output."""
    cells, strides = grids(*size, torch.device("cpu"))
    boxes = decoded(torch.from_numpy(raw[0]), cells, strides).numpy() / ratio
    boxes[:, 0::2], boxes[:, 1::2] = boxes[:, 0::2].clip(0, shape[1]), boxes[:, 1::2].clip(0, shape[0])
    scores = raw[0, :, 4] * raw[0, :, 5:].max(1)
    kinds = raw[0, :, 5:].argmax(1)
    order = np.argsort(-scores, kind="stable")
    order = order[scores[order] >= LEAST_SCORE][:300]
    kept: list[int] = []
    for k in order:
        rivals = [j for j in kept if kinds[j] == kinds[k]]
        if not rivals or box_iou(boxes[[k]], boxes[rivals]).max() < SAME:
            kept.append(int(k))
    return boxes[kept], scores[kept], kinds[kept]


class Sigmoid(nn.Module):
    """The network as YOLOX is exported: the logits of object and kinds become scores from 0 to 1.

    Their square roots are taken: the product of the quality of a box and the probability of its kind is low for many a
    right box, and readers of such models leave out what scores less than 0.25. The order of the boxes is the same.
    """

    def __init__(self, net: nn.Module) -> None:
        super().__init__()
        self.net = net

    def forward(self, x: Tensor) -> Tensor:
        """Return [N, n, 5 + classes]: tx, ty, tw, th, object, kinds."""
        raw = self.net(x)
        return torch.cat([raw[..., :4], raw[..., 4:].sigmoid().sqrt()], -1)


def found(run: Model, views: Views, size: tuple[int, int]) -> dict[str, list[Found]]:
    """Return per kind, and as "any" whatever the kind, what was found in every view."""
    result: dict[str, list[Found]] = {name: [] for name in (*CLASSES, "any")}
    shape = views.labels.shape[1], views.labels.shape[2]
    for i, image in enumerate(views.images):
        x, ratio = letterboxed(image, size)
        boxes, scores, kinds = boxes_of(run(x), ratio, size, shape)
        classes, true, clear = views.of(i)
        result["any"].append(match(boxes, scores, true, clear))
        boxes, scores, kinds = boxes[:100], scores[:100], kinds[:100]
        for c, name in enumerate(CLASSES):
            mine, theirs = kinds == c, classes == c
            result[name].append(match(boxes[mine], scores[mine], true[theirs], clear[theirs]))
    return result


def mean_precision(result: dict[str, list[Found]]) -> float:
    """Return the mean of AP at IoU 0.5 over the kinds of which there are objects; NaN without any."""
    each = [average_precision(result[name]) for name in CLASSES if any(f.asked for f in result[name])]
    return float(np.mean(each)) if each else float("nan")


def report(run: Model, views: dict[str, Views], size: tuple[int, int]) -> str:
    """Return the tables of AP50 and recall, per kind, and per session and indoors and outdoors."""
    per = {name: found(run, one, size) for name, one in views.items()}
    inside = np.concatenate([one.indoors for one in views.values()])
    every = {kind: [f for one in per.values() for f in one[kind]] for kind in (*CLASSES, "any")}
    parts = {
        name: {kind: [f for f, i in zip(fs, inside, strict=True) if bool(i) == indoors] for kind, fs in every.items()}
        for name, indoors in (("outdoors", False), ("indoors", True))
    }
    lines = ["| kind | objects | AP50 | found |", "|---|---:|---:|---:|"]
    for kind in CLASSES:
        objects = sum(f.asked for f in every[kind])
        lines.append(f"| {kind} | {objects} | {average_precision(every[kind]):.3f} | {recall(every[kind], MOST):.3f} |")
    lines += [
        "",
        f"| views | objects | mean AP50 | AP50, any kind | found by {MOST} boxes |",
        "|---|---:|---:|---:|---:|",
    ]
    for name, one in {**per, **parts, "all": every}.items():
        objects = sum(f.asked for f in one["any"])
        figures = mean_precision(one), average_precision(one["any"]), recall(one["any"], MOST)
        lines.append(f"| {name} ({len(one['any'])}) | {objects} | " + " | ".join(f"{f:.3f}" for f in figures) + " |")
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> None:
    """Render what is missing, train, export, check the export, and print the figures on unseen campuses."""
    args = options(__doc__, epochs=(5, 4, 20), batch=12).parse_args(argv)
    prepare(args)
    look = {"height": args.height, "width": args.width, "workers": args.threads}
    size = (HEIGHT, WIDTH) if min(args.height, args.width) >= 200 else (96, 96)  # else a trial
    ratio = min(size[0] / args.height, size[1] / args.width)

    def train_round(net: nn.Module, number: int) -> nn.Module:
        views = joined(list(load(args.store, args.seeds, args.every, **look).values()))
        seen = joined(list(load(args.store, args.validation, 2 * args.every, **look).values()))
        order = np.repeat(np.arange(len(views.images)), np.where(views.indoors, INDOORS[number], 1))

        def epoch_of(epoch: int) -> Iterator[Callable[[nn.Module], Tensor]]:
            last = epoch == args.epochs[number] - 1
            share, window = (0.0, size) if last else (MOSAICS, min(size, WINDOW))
            make = partial(augmented, views, ratio, window, share, EVENLY[number])
            drawn = batches(
                len(order), args.batch, args.seed, 100 * number + epoch, lambda rng, k: make(rng, int(order[k]))
            )
            for samples in drawn:
                yield partial(loss_of, samples, args.device)

        def check(average: nn.Module) -> str:
            result = found(Runner.of_network(Sigmoid(average).eval(), args.device), seen, size)
            every = result["any"]
            figures = mean_precision(result), average_precision(every), recall(every, MOST)
            return "mean AP50 {:.3f}, any kind {:.3f}, found {:.3f}".format(*figures)

        return train(net, args.epochs[number], RATES[number], epoch_of, len(order) // args.batch, check)

    net: nn.Module = Detector(len(CLASSES)).to(args.device, memory_format=torch.channels_last)
    net = rounds(net, args, NAME, train_round)
    metadata = {
        "names": str(dict(enumerate(CLASSES))),
        "stride": str(max(STRIDES)),
        "fdslam.layout": "yolox",
        "fdslam.strides": json.dumps(STRIDES),
        "fdslam.channels": "bgr",
        "fdslam.white": "255",
        "fdslam.placement": "corner",
        "fdslam.domain": "embedded world only",
    }
    path = args.out / f"{NAME}.onnx"
    test = load(args.store, args.test, args.every, **look)
    examples = [letterboxed(one.images[0], size)[0] for one in test.values()]
    difference = export(Sigmoid(net.cpu()), examples, path, "images", "output", metadata)
    print(f"{path}: {path.stat().st_size:,} bytes; onnxruntime against torch: at most {difference:.2e}")
    print(report(Runner.of_file(path), {name: test[name] for name in SESSIONS}, size))


if __name__ == "__main__":
    main()
