"""Autoencoders (AE) of places (§AD): the network, its training, and its reconstruction error (RE) as a score."""
