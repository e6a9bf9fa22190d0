"""Readers of what the workflow keeps: arrays, clusters, records, images, tables."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import chdir, suppress
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gspure.artifacts import (
    embedding_of,
    facts_of,
    load_array,
    motion_of,
    read_json,
    require_agreement,
    require_kind,
    require_same_origin,
    save_array,
    settings_of,
    write_json,
    write_record,
)
from gspure.artifacts.checksums import record_file, with_checksum
from gspure.artifacts.replacement import is_result
from gspure.cameras.reading import read_transform
from gspure.cost import Cost, read_cost
from gspure.errors import InputError
from gspure.evaluation.comparison import read_metrics, write_metrics
from gspure.evaluation.csv_tables import write_table
from gspure.evaluation.detection import Reading, read_detections
from gspure.evaluation.outcomes import collect
from gspure.evaluation.results import read_results, write_results
from gspure.evaluation.retrieval import Retrieval, Retrieved
from gspure.failures import Failure, is_interrupted, read_failure, reason_in
from gspure.images import (
    RENDERED,
    background_of,
    origin_of,
    read_image,
    record_views,
    require_all_images,
    require_comparable,
)
from gspure.method.clustering.store import Clusters, read_clusters, read_labels, read_tree, write_clusters
from gspure.method.contributions import Measurement, Stage, read_index, read_stage, write_index
from gspure.model import read_model, write_model
from gspure.renderer import CONTRIBUTION
from gspure.workflow.notes import misfit, write_note
from tests.contest_cases import attacked, measured
from tests.hostile.bytes_and_text import Rng
from tests.hostile.contract import Reader
from tests.models import blobs

ROWS = 12


def _array(name: str, make: Callable[[Rng], np.ndarray]) -> Callable[[Path], None]:
    return lambda folder: save_array(folder / name, make(np.random.default_rng(0)))


def _contribution(rng: Rng) -> np.ndarray:
    stage = np.zeros(ROWS, CONTRIBUTION)
    stage["index"], stage["sum"], stage["max"], stage["pixels"] = np.arange(ROWS), 0.5 + rng.random(ROWS), 0.5, 3
    return stage


def _read_stage(folder: Path) -> None:
    stage = read_stage(folder / "view.npy")
    assert stage.dtype == CONTRIBUTION
    assert all(np.isfinite(stage[name]).all() and (stage[name] >= 0).all() for name in ("sum", "max"))
    assert (np.diff(stage["index"].astype(np.int64)) > 0).all()


def _index(folder: Path) -> None:
    stages = [Stage(f"v{i}", f"{i:032x}", folder / f"v{i}.{i:032x}.npy") for i in range(4)]
    write_index(folder / "index.tsv", stages, Measurement(f"{7:032x}", f"{8:032x}", "device", len(stages)))


def _read_index(folder: Path) -> None:
    stages = read_index(folder / "index.tsv")
    assert len({stage.view for stage in stages}) == len(stages)


def _read_array(name: str, dtype: Any, shape: tuple[int | None, ...], folder: Path) -> np.ndarray:
    array = load_array(folder / name, dtype=dtype, shape=shape)
    assert array.dtype == dtype
    assert array.dtype.kind != "f" or np.isfinite(array).all()
    return array


def _read_verified(folder: Path) -> None:
    """Whatever is corrupted, the array or its record, nothing but the array that was written is returned."""
    array = load_array(folder / "weights.npy", dtype=np.float32, shape=(ROWS,))
    assert array.tobytes() == np.arange(ROWS, dtype=np.float32).tobytes()


def _path(rng: Rng) -> np.ndarray:
    """A spanning tree of 40 points: each hangs on the one before."""
    places = np.arange(39.0)
    return np.column_stack([places, places + 1, np.sort(rng.random(39))])


def _read_tree(folder: Path) -> None:
    tree = read_tree(folder / "tree.npy")
    count, (a, b, distances) = len(tree) + 1, tree.T
    graph = coo_array((np.ones(len(tree)), (a.astype(np.intp), b.astype(np.intp))), (count, count))
    assert connected_components(graph)[0] == 1
    assert ((a < b) & (distances >= 0)).all()
    assert (np.diff(distances) >= 0).all()


def _clusters(folder: Path) -> None:
    labels = np.array([0, 0, 1, 1, -1, 2], np.int32)
    write_clusters(folder / "clusters.npz", Clusters(labels, 1), {"min_cluster_size": 5, "selection": "leaf"})


def _labels(folder: Path) -> None:
    save_array(folder / "labels.npy", np.array([0, 0, 1, -1, 1, 2], np.int32))


def _read_labels(folder: Path) -> None:
    labels = read_labels(folder / "labels.npy")
    assert labels.dtype == np.int32
    assert labels.min(initial=-1) >= -1


def _read_clusters(folder: Path) -> None:
    clusters = read_clusters(folder / "clusters.npz")
    assert clusters.labels.dtype == np.int32
    assert clusters.labels.min(initial=-1) >= -1
    assert clusters.coincident >= 0


def _records(folder: Path) -> None:
    save_array(folder / "weights.npy", np.ones(3, np.float32))
    write_record(folder / "weights.npy", inputs={"model": folder / "weights.npy"}, settings={"reduction": "sum"})
    reason = "gspure attack: model.ply: file: expected a .ply, found nothing"
    Failure("attack_model", reason, str(folder / "attack.log"), "run.log", ["prune_mask.npy"]).write()
    write_json(folder / "verdict.json", {"reached": {"message": True, "message_oracle": False}})


def _read_table(folder: Path) -> None:
    failure = read_failure(folder / "attack.failed.json")
    assert all(isinstance(text, str) for text in (failure.reason, failure.log, *failure.missing))
    for name in ("weights.npy.json", "verdict.json"):
        read_json(folder / name)


def _log(folder: Path) -> None:
    lines = ("device cpu", "gspure attack: model.ply: file: expected a .ply, found nothing", "exit status 2")
    (folder / "attack.log").write_text("\n".join(lines))


def _read_log(folder: Path) -> None:
    assert isinstance(is_interrupted(folder / "attack.log", stopped=False), bool)
    assert len(reason_in(folder / "attack.log", "attack_model").splitlines()) == 1


JOB = ("results/logs/weights.log", "settings", ["results/weights.npy"])


def _note(folder: Path) -> None:
    with chdir(folder):
        save_array(Path(JOB[2][0]), np.ones(3))
        write_note(*JOB, {})


def _read_note(folder: Path) -> None:
    with chdir(folder):
        assert isinstance(misfit(*JOB), str)


VARIANTS = {"unattacked": 0.0, "gspure": 5.0}


def _run(folder: Path) -> None:
    model = folder / "planted" / "room"
    for variant, drop in VARIANTS.items():
        rows = [measured(target, 20.0 + i - drop, view=f"v{i}") for target in ("scene", "message") for i in range(2)]
        write_metrics(model / variant / "metrics.csv", rows)
        save_array(model / variant / "public" / "prune_mask.npy", np.arange(ROWS) < drop)
        write_json(model / variant / "verdict.json", {"reached": {"message": True}, "strength": "tau=4"})
    save_array(model / "key" / "message_rows.npy", np.arange(ROWS) < 3)
    rows = [Retrieved(variant, "message", Retrieval(0.5, 0.75, 0.5, 2, 4)) for variant in VARIANTS]
    write_table(model / "retrieval.csv", Retrieved, rows)


def _read_run(folder: Path) -> None:
    model = folder / "planted" / "room"
    files = ("metrics.csv", "public/prune_mask.npy", "verdict.json")
    metrics, masks, verdicts = ([model / variant / file for variant in VARIANTS] for file in files)
    retrievals = [model / "retrieval.csv"]
    if links := [path for path in (*metrics, *masks, *verdicts, *retrievals) if path.is_symlink()]:
        raise InputError(links[0], "path", expected="a file", found="a link")  # as the command line refuses loops
    for outcome in collect(metrics, masks, [model / "key" / "message_rows.npy"], verdicts, retrievals=retrievals):
        assert outcome.variant in VARIANTS
        assert not outcome.pruned_share < 0
        assert not outcome.pruned_share > 1


TIMES = count(1)


def _signed(file: Path) -> None:
    """Renew the checksum of a record, as its author can."""
    with suppress(OSError, ValueError, RecursionError):
        record = json.loads(file.read_text() if file.is_file() and not file.is_symlink() else "")
        if isinstance(record, dict):
            file.write_text(json.dumps(with_checksum(record)))
    with suppress(OSError):
        os.utime(file, ns=(0, next(TIMES)))  # a record that is read once is known by its times, which cases may share


def _model_record(folder: Path) -> None:
    write_model(folder / "model.ply", blobs(ROWS))
    turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    origin = {"geometry": "a1", "kind": "weights", "embedding": "b2", "motion": turn}
    write_record(folder / "model.ply", inputs={"pair": folder / "model.ply"}, settings={"tau": 1.5}, **origin)


def _read_model_record(folder: Path) -> None:
    model = folder / "model.ply"
    _signed(record_file(model))
    assert isinstance(embedding_of(model), str)
    if (motion := motion_of(model)) is not None:  # else some other JSON has replaced the record
        assert np.allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=0.01)
        assert np.isfinite(motion).all()
    require_agreement(model, model, {"model": "a1"}, facts_of(model))
    require_kind(model, "weights")
    require_same_origin(model, model)
    settings_of(model)
    read_model(model)


def _renders(folder: Path) -> None:
    views = {f"view_{i}": [float(i), *np.eye(4).ravel()] for i in range(2)}
    for name in views:
        Image.new("RGB", (4, 3)).save(folder / f"{name}.png")
    record_views(folder, views, (0.0, 0.5, 1.0), "ewa", embedding="b2")


def _read_renders(folder: Path) -> None:
    _signed(folder / RENDERED)
    require_all_images(folder)
    for image in folder.glob("*.png"):
        read_image(image)
    assert all(0 <= channel <= 1 for channel in background_of(folder))
    assert isinstance(origin_of(folder, "embedding"), str)
    require_comparable(folder, folder, ["view_0", "view_1"])


def _read_replaced(folder: Path) -> None:
    _signed(folder / RENDERED)
    for path in (folder / RENDERED, *folder.glob("*.png")):
        assert isinstance(is_result(path, ""), bool)


def _readings(folder: Path) -> None:
    for scene, bits in (("bits", 16), ("scores", 0)):
        table = folder / "scheme" / scene / "marked" / "detections" / "mark.csv"
        write_table(table, Reading, [Reading(f"v{i}", 10.0 * i, bits) for i in range(3)])


def _read_readings(folder: Path) -> None:
    for detections in read_detections(sorted(folder.rglob("*.csv"))).values():
        assert np.isfinite([detections["mark"].level, detections["mark"].spread]).all()


def _metrics(folder: Path) -> None:
    rows = [measured(t, 20.0 + i, view=f"v{i}") for t in ("scene", "message") for i in range(3)]
    write_metrics(folder / "metrics.csv", rows)


def _read_metrics(folder: Path) -> None:
    for row in read_metrics(folder / "metrics.csv"):
        assert not np.isnan([*row.values.values()]).any()


def _table(folder: Path) -> None:
    outcomes = [attacked(name, float(i), 10.0 * i, scheme="planted") for i, name in enumerate(("unattacked", "gspure"))]
    write_results(folder / "results.csv", outcomes)


READERS = (
    Reader("stage file", _array("view.npy", _contribution), _read_stage, {"view.npy": "npy"}),
    Reader("index of stages", _index, _read_index, {"index.tsv": "text"}),
    Reader(
        "weights",
        _array("weights.npy", lambda rng: rng.random(ROWS, np.float32)),
        partial(_read_array, "weights.npy", np.float32, (ROWS,)),
        {"weights.npy": "npy"},
    ),
    Reader(
        "weights with a checksum",
        lambda f: save_array(f / "weights.npy", np.arange(ROWS, dtype=np.float32), checksum=True),
        _read_verified,
        {"weights.npy": "npy", "weights.npy.json": "json"},
    ),
    Reader(
        "features",
        _array("features.npy", lambda rng: rng.normal(size=(ROWS, 5))),
        partial(_read_array, "features.npy", np.float64, (None, 5)),
        {"features.npy": "npy"},
    ),
    Reader(
        "mask",
        _array("mask.npy", lambda rng: rng.random(ROWS) < 0.5),
        partial(_read_array, "mask.npy", np.bool_, (ROWS,)),
        {"mask.npy": "npy"},
    ),
    Reader(
        "spanning tree",
        _array("tree.npy", _path),
        _read_tree,
        {"tree.npy": "npy"},
    ),
    Reader("clusters", _clusters, _read_clusters, {"clusters.npz": "npz"}),
    Reader("labels", _labels, _read_labels, {"labels.npy": "npy"}),
    Reader(
        "records and statuses",
        _records,
        _read_table,
        {"weights.npy.json": "json", "attack.failed.json": "json", "verdict.json": "json"},
    ),
    Reader(
        "record of a model",
        _model_record,
        _read_model_record,
        {"model.ply.json": "json"},
    ),
    Reader("record of renders", _renders, _read_renders, {RENDERED: "json"}),
    Reader("renders to be replaced", _renders, _read_replaced, {RENDERED: "json"}),
    Reader(
        "rigid transform",
        lambda f: save_array(f / "transform.npy", np.diag([-1.0, -1.0, 1.0, 1.0])),
        lambda f: read_transform(f / "transform.npy"),
        {"transform.npy": "npy"},
    ),
    Reader(
        "cost",
        lambda f: Cost(1.0, 2.0).write(f / "cost.json"),
        lambda f: read_cost(f / "cost.json"),
        {"cost.json": "json"},
    ),
    Reader(
        "readings of detectors",
        _readings,
        _read_readings,
        {f"scheme/{scene}/marked/detections/mark.csv": "text" for scene in ("bits", "scores")},
    ),
    Reader("log of a job", _log, _read_log, {"attack.log": "text"}),
    Reader("note of a job", _note, _read_note, {"results/jobs/weights.json": "json"}),
    Reader(
        "outcomes of a run",
        _run,
        _read_run,
        {
            "planted/room/gspure/metrics.csv": "text",
            "planted/room/gspure/verdict.json": "json",
            "planted/room/gspure/public/prune_mask.npy": "npy",
            "planted/room/key/message_rows.npy": "npy",
            "planted/room/retrieval.csv": "text",
        },
    ),
    Reader("metrics.csv", _metrics, _read_metrics, {"metrics.csv": "text"}),
    Reader("results.csv", _table, lambda f: read_results(f / "results.csv"), {"results.csv": "text"}),
)
