"""k autoencoders trained one after the other, in one batched pass, and each in a thread of its own.

    python -m experiments.speed.autoencoders [--channels 4 --pixels 3072] [--cores 1 2]

Images a second of the clock and CPU milliseconds an image (every image counts once an epoch). The ways take turns, and
of each the best turn counts, since other work may run on the machine. Losses are those of the last epoch, the mean of
the k networks: the ways train the same. The last lines say what an image costs at least: the rate of the machine's
matrix product, and the operations of a training step.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import torch

from fdslam.autoencoder.apart import train_apart
from fdslam.autoencoder.checkpoint import Forgetful
from fdslam.autoencoder.job import Job
from fdslam.autoencoder.network import ConvAutoencoder
from fdslam.autoencoder.together import train_together
from fdslam.config import Autoencoder
from fdslam.progress import in_parallel


def scenes(k: int, images: int, size: tuple[int, int]) -> list[torch.Tensor]:
    """Return smooth random images of k places: [images, 3, h, w] float32 in 0..1 each."""
    made = []
    for place in range(k):
        coarse = torch.rand(images, 3, 6, 8, generator=torch.Generator().manual_seed(place))
        made.append(torch.nn.functional.interpolate(coarse, size, mode="bilinear"))
    return made


def one_after_the_other(jobs: Sequence[Job], cores: int) -> None:
    """Train each network with all cores, then the next."""
    torch.set_num_threads(cores)
    train_apart(jobs, "cpu", Forgetful(), "")


def together(jobs: Sequence[Job], cores: int) -> None:
    """Train all in one batched pass with all cores."""
    torch.set_num_threads(cores)
    train_together(jobs, "cpu", Forgetful(), "")


def in_threads(jobs: Sequence[Job], cores: int) -> None:
    """Train each in a thread of its own, as many at a time as there are cores."""
    torch.set_num_threads(1)
    for _ in in_parallel([partial(train_apart, [job], "cpu", Forgetful(), "") for job in jobs], cores):
        pass


WAYS: dict[str, Callable[[Sequence[Job], int], None]] = {
    "one after the other": one_after_the_other,
    "in one batched pass": together,
    "each in a thread": in_threads,
}


def operations(network: ConvAutoencoder, size: tuple[int, int]) -> float:
    """Return the floating-point operations of a training step an image: three products a layer, two in the first."""
    total, (height, width) = 0.0, size
    for block in range(4):
        down = network.encoder[2 * block].weight.numel() * height * width / 4**block / 4
        up = network.decoder[7 - 2 * block].weight.numel() * height * width / 4**block / 4
        total += 2 * (down * (2 if block == 0 else 3) + 3 * up)
    return total + 2 * 3 * (network.encode.weight.numel() + network.decode.weight.numel())


def product_rate() -> float:
    """Return floating-point operations a CPU second of a large matrix product, one thread."""
    torch.set_num_threads(1)
    a = torch.rand(1024, 1024)
    times = []
    for _ in range(10):
        begin = time.process_time()
        a @ a
        times.append(time.process_time() - begin)
    return 2 * 1024**3 / min(times)


def measure(config: Autoencoder, size: tuple[int, int], k: int, images: int, cores: int, turns: int) -> None:
    """Print the lines of one number of cores."""
    places = scenes(k, images, size)
    best = dict.fromkeys(WAYS, (np.inf, np.inf, 0.0))
    for _ in range(turns):
        for way, train in WAYS.items():
            jobs = [Job(shown, None, config.epochs, (0, place), config) for place, shown in enumerate(places)]
            clock, cpu = time.perf_counter(), time.process_time()
            train(jobs, cores)
            took = time.perf_counter() - clock, time.process_time() - cpu
            best[way] = *np.minimum(best[way][:2], took), float(np.mean([job.losses[-1] for job in jobs]))
    count = k * images * config.epochs
    base = best["one after the other"]
    for way, (clock, cpu, loss) in best.items():
        rate, each = count / clock, 1e3 * cpu / count
        print(
            f"| {cores} | {way} | {rate:.0f} | {base[0] / clock:.2f} | {each:.2f} | {base[1] / cpu:.2f} | {loss:.5f} |",
            flush=True,
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--k", type=int, default=10)
    parser.add_argument("--images", type=int, default=16, help="of a place")
    parser.add_argument("--epochs", type=int, default=3)
    parser.add_argument("--channels", type=int, default=Autoencoder().channels)
    parser.add_argument("--pixels", type=int, default=Autoencoder().pixels)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--cores", type=int, nargs="+", default=[1, os.cpu_count() or 1])
    args = parser.parse_args()
    config = Autoencoder(channels=args.channels, pixels=args.pixels, epochs=args.epochs)
    side = max(16, round((args.pixels / 12_288) ** 0.5 * 6) * 16)
    size = side, side * 4 // 3 // 16 * 16
    network = ConvAutoencoder(size, config.channels, config.latent)
    rate, needed = product_rate(), operations(network, size)
    print("| cores | way | images / s | ratio | CPU ms an image | ratio | loss |\n|---:|---|---:|---:|---:|---:|---:|")
    for cores in args.cores:
        measure(config, size, args.k, args.images, cores, args.turns)
    print(
        f"\n{size[0]} × {size[1]}, {config.channels} channels, {sum(p.numel() for p in network.parameters()):,} weights"
    )
    print(
        f"a step: {needed / 1e6:.0f} million operations an image, {1e3 * needed / rate:.2f} ms at the {rate / 1e9:.0f} "
        "GFLOP/s of a matrix product: no way can be faster on one core"
    )


if __name__ == "__main__":
    main()
