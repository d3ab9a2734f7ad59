"""A store over another: what is found about live images leaves the map's own store as it is."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fdslam.errors import InputError
from fdslam.store import Arrays, Key, Stage, Store


class Layered(Store):
    """What a store holds, and above it what is found from now on: in memory, gone with the object, or in another store.

    A robot's images come and go, and nothing may pile up on its disk. Threads may share it.
    """

    def __init__(self, below: Store, above: Store | None = None) -> None:
        """Look at a store.

        Args:
            below: it is read; nothing is written to it, and what is damaged there is removed.
            above: takes what is put; None: memory does.
        """
        super().__init__(below.root)
        self._below, self._above = below, above
        self._held: dict[tuple[str, Key], Arrays] = {}

    def path(self, stage: Stage, key: Key) -> Path:
        """Return where the artefact lies, if it is a file; else where it would be put, or where it is not."""
        path = self._below.path(stage, key)
        return path if self._above is None or path.is_file() else self._above.path(stage, key)

    def lacks(self, stage: Stage, keys: Iterable[Key]) -> int:
        """Count the artefacts that are in no layer."""
        return sum((stage.name, key) not in self._held and not self.path(stage, key).is_file() for key in keys)

    def get(self, stage: Stage, key: Key) -> Arrays | None:
        """Return the arrays of an artefact, the caller's own as those read from a file are; None if it is absent."""
        held = self._held.get((stage.name, key))
        if held is not None:
            return {name: array.copy() for name, array in held.items()}
        found = self._above.get(stage, key) if self._above is not None else None
        return found if found is not None else self._below.get(stage, key)

    def put(self, stage: Stage, key: Key, arrays: Arrays) -> None:
        """Keep the arrays; raises InputError if the disk refuses."""
        if self._above is not None:
            self._above.put(stage, key, arrays)
        else:
            self._held[stage.name, key] = {name: array.copy() for name, array in arrays.items()}

    def discard(self, stage: Stage, key: Key) -> None:
        """Forget an artefact that was put; what lies below stays."""
        self._held.pop((stage.name, key), None)
        if self._above is not None:
            self._above.discard(stage, key)


class Copying(Store):
    """A store that leaves a copy of every artefact that is read from it: all that a reader needs, and nothing else."""

    def __init__(self, source: Store, copy: Store) -> None:
        """Read from ``source``, leave copies in ``copy``."""
        super().__init__(source.root)
        self._source, self._copy = source, copy

    def path(self, stage: Stage, key: Key) -> Path:
        """Return where the artefact lies in the source."""
        return self._source.path(stage, key)

    def get(self, stage: Stage, key: Key) -> Arrays | None:
        """Return the arrays of an artefact, or None, and leave a copy."""
        arrays = self._source.get(stage, key)
        if arrays is not None:
            self._copy.put(stage, key, arrays)
        return arrays

    def put(self, stage: Stage, key: Key, arrays: Arrays) -> None:
        """Store the arrays in both; raises InputError if the disk refuses."""
        self._source.put(stage, key, arrays)
        self._copy.put(stage, key, arrays)


class Sealed(Store):
    """A store that has to hold all that is asked of it: nothing is made in its stead."""

    def get(self, stage: Stage, key: Key) -> Arrays:
        """Return the arrays of an artefact.

        Raises:
            InputError: it is not there, or damaged.
        """
        arrays = super().get(stage, key)
        if arrays is None:
            raise InputError(f"{self.root}: lacks the {stage.name} that this program would make, or it is damaged")
        return arrays
