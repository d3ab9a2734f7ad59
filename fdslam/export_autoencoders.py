"""Write the autoencoders of a map as ONNX models: ``python -m fdslam.export_autoencoders FOLDER KEY=VALUE…``.

The keys are those of ``python -m fdslam.run``. For every pair of sessions FOLDER gets ``place_0.onnx`` and so on (in a
folder QUERY_MAP each, where there are several pairs) and ``places.csv`` with the place of every map image. What is not
trained yet is trained first, and stored. A folder with models of more places than there are now is refused.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from fdslam.compose import configured
from fdslam.config import Config
from fdslam.errors import InputError
from fdslam.run import USAGE_ERROR, check_surroundings


def export_autoencoders(config: Config, folder: Path) -> list[Path]:
    """Train, or take from the store, the AEs of every map of a configuration, and write them.

    Returns:
        The models, in the order of pairs and places.

    Raises:
        InputError: bad data or configuration, the extra ``export`` is not installed, or a folder holds models that
            would not be written over.
    """
    from fdslam.autoencoder.onnx_place import check_export, export_place
    from fdslam.context import Context
    from fdslam.data import load_datasets
    from fdslam.pipeline import check_data
    from fdslam.place_models import place_labels, trained_places
    from fdslam.progress import single_threaded
    from fdslam.store import Store, write_atomically

    check_export()
    single_threaded()
    store, maps, written = Store(config.store), [], []
    datasets = load_datasets(config.dataset, store, config.workers)
    for data in datasets:
        check_data(config, data)
        context = Context(config, data, store, (), (), ())
        inner = folder / "_".join(data.pair) if data.pair is not None and len(datasets) > 1 else folder
        _refuse_others(inner, int(place_labels(context).max()) + 1)
        maps.append((context, inner))
    for context, inner in maps:
        found = trained_places(context)
        for place, model in enumerate(found.models):
            written.append(inner / f"place_{place}.onnx")
            export_place(model, found.size, written[-1])
        named = zip(context.dataset.map, found.label.tolist(), strict=True)
        rows = [f"{frame.name},{place}" for frame, place in named]
        write_atomically(inner / "places.csv", "\n".join(["map_file,place", *rows, ""]).encode())
    return written


def _refuse_others(folder: Path, places: int) -> None:
    """Refuse a folder with a model of a place that there is not: beside new ones it would be taken for one of them."""
    numbers = [
        found for path in folder.glob("place_*.onnx") if (found := re.fullmatch(r"place_(\d+)\.onnx", path.name))
    ]
    if others := sorted(int(number[1]) for number in numbers if int(number[1]) >= places):
        raise InputError(
            f"{folder}: holds place_{others[0]}.onnx, of an export with more places than the {places} of this map; "
            "choose another folder, or remove the models and places.csv"
        )


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns the exit status: 0, or 2 for something the user can mend."""
    given = sys.argv[1:] if arguments is None else arguments
    if not given or given[0].startswith("-") or "=" in given[0]:
        print(__doc__)
        return 0 if given and given[0] in ("-h", "--help") else USAGE_ERROR
    try:
        config = configured(given[1:])
        check_surroundings(config)
        written = export_autoencoders(config, Path(given[0]))
    except InputError as error:
        print(f"fdslam: {error}", file=sys.stderr)
        return USAGE_ERROR
    print(f"{len(written)} models written to {given[0]}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
