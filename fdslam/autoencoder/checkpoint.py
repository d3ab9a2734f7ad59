"""Checkpoints of trainings, as artefacts of the store: a killed training goes on from the last to the same bytes."""

from __future__ import annotations

import time
from typing import Protocol

from fdslam.store import Arrays, Key, Stage, Store, digest

STAGE = Stage("autoencoder_checkpoint", ())  # the key of the model, which holds the code, is part of its keys
SECONDS = 30.0  # of training between two checkpoints
SHARE = 20.0  # and so many times what writing the last one took


class Keeper(Protocol):
    """Where a training writes itself down."""

    def due(self, name: str) -> bool:
        """Tell whether it is time."""

    def save(self, name: str, arrays: Arrays) -> None:
        """Write a training down under its name, in place of what was there."""

    def load(self, name: str) -> Arrays | None:
        """Return what was written down last, or None."""


class Forgetful:
    """Keeps nothing: for trainings that nobody would go on with."""

    def due(self, name: str) -> bool:
        """Never."""
        return False

    def save(self, name: str, arrays: Arrays) -> None:
        """Do nothing."""

    def load(self, name: str) -> Arrays | None:
        """Return None."""
        return None


class Checkpoints:
    """Checkpoints in a store.

    Args:
        store: where they are kept.
        key: address of what the training will give in the end.
    """

    def __init__(self, store: Store, key: Key) -> None:
        self.store, self.key = store, key
        self.names: set[str] = set()
        self._next = time.monotonic() + SECONDS

    def _address(self, name: str) -> Key:
        self.names.add(name)
        return digest([self.key, name])

    def due(self, name: str) -> bool:
        """Tell whether SECONDS have passed since the last checkpoint, or longer where writing takes long."""
        return time.monotonic() >= self._next

    def save(self, name: str, arrays: Arrays) -> None:
        """Write a training down under its name, in place of what was there."""
        begin = time.monotonic()
        self.store.put(STAGE, self._address(name), arrays)
        took = time.monotonic() - begin
        self._next = time.monotonic() + max(SECONDS, SHARE * took)

    def load(self, name: str) -> Arrays | None:
        """Return what was written down last, or None."""
        return self.store.get(STAGE, self._address(name))

    def clear(self) -> None:
        """Remove what was written down: the result is stored."""
        for name in self.names:
            self.store.discard(STAGE, self._address(name))
