"""The training of one autoencoder as a text book has it: one network, one image after the other drawn, plain Adam."""

import numpy as np
import torch

from fdslam.autoencoder.augmentation import augment, draw
from fdslam.autoencoder.network import ConvAutoencoder


def train_plainly(images, held, config, seed, epochs, patience):
    """Return (losses, held-out losses, weights) of a training: to the end, or ``patience`` epochs without gain."""
    generator = torch.Generator().manual_seed(int(np.random.SeedSequence(seed).generate_state(1)[0]))
    network = ConvAutoencoder((images.shape[2], images.shape[3]), config.channels, config.latent, generator)
    parameters = [*network.parameters()]
    mean, square, step = [0.0] * len(parameters), [0.0] * len(parameters), 0
    losses, held_losses, best = [], [], (0, float("inf"))
    for epoch in range(1, epochs + 1):
        total = 0.0
        for batch in torch.randperm(len(images), generator=generator).split(config.batch):
            settings = draw(len(batch), generator)
            shown = torch.cat([augment(images[i : i + 1], s[None]) for i, s in zip(batch, settings, strict=True)])
            loss = sum((network(one[None]) - one).abs().mean() for one in shown) / len(shown)
            gradients = torch.autograd.grad(loss, parameters)
            step += 1
            with torch.no_grad():
                for k, (parameter, gradient) in enumerate(zip(parameters, gradients, strict=True)):
                    mean[k] = 0.9 * mean[k] + 0.1 * gradient
                    square[k] = 0.999 * square[k] + 0.001 * gradient**2
                    fair = mean[k] / (1 - 0.9**step), square[k] / (1 - 0.999**step)
                    parameter -= config.learning_rate * fair[0] / (fair[1].sqrt() + 1e-8)
            total += float(loss.detach()) * len(batch)
        losses.append(total / len(images))
        if held is not None:
            with torch.no_grad():
                held_losses.append(float(np.mean([float((network(h[None]) - h).abs().mean()) for h in held])))
            if held_losses[-1] < best[1] - 1e-5:
                best = epoch, held_losses[-1]
            if epoch - best[0] >= patience:
                break
    return losses, held_losses, {name: value.numpy() for name, value in network.state_dict().items()}
