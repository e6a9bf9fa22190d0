"""Public model, files beside it and key belong to one embedding; files of different ones are not mixed silently."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gspure.artifacts import (
    embedding_of,
    facts_of,
    read_json,
    record_of,
    require_agreement,
    save_array,
    write_record,
)
from gspure.artifacts.checksums import record_file
from gspure.cli import main
from gspure.cli.extract import _lesson
from gspure.cost import LOG
from gspure.errors import InputError
from gspure.evaluation.comparison import ViewMetrics, write_metrics
from gspure.evaluation.metrics import METRICS
from gspure.evaluation.outcomes import collect
from gspure.images import record_views, write_image
from gspure.model import read_model, write_model
from gspure.schemes import gs_hider, secure_gs
from gspure.schemes.gs_hider.decoder_file import DecoderFile
from gspure.schemes.gs_hider.public_model import FeatureModel
from tests.anchor_cases import random_public
from tests.test_gs_hider_files import rows


@pytest.fixture(scope="module")
def planted(pair_folder, tmp_path_factory):
    """Two embeddings in one pair, and the first one attacked."""
    folder = tmp_path_factory.mktemp("planted")
    for seed in ("1", "2"):
        options = ("--set", "gaussians=400", "--seed", seed, "--out", str(folder / seed))
        assert main(["embed", "planted", str(pair_folder), *options]) == 0
    model, attacked = folder / "1" / "public" / "point_cloud.ply", folder / "attacked.ply"
    assert main(["attack", "random_pruning", "--model", str(model), "--out", str(attacked)]) == 0
    return folder


def extract(model: Path, key: Path, pair: Path, out: Path, *options: str) -> int:
    cameras = ("--cameras", str(pair / "cameras.json"), "--split", "test")
    command = ["extract", str(model), "--scheme", "planted", "--key", str(key), *cameras, "--out", str(out)]
    return main([*command, *options])


def test_public_model_and_key_share_an_embedding_that_attacks_keep(planted):
    first, second = (embedding_of(planted / seed / "public") for seed in ("1", "2"))
    assert [embedding_of(planted / seed / "key") for seed in ("1", "2")] == [first, second]
    assert first
    assert first != second
    assert embedding_of(planted / "attacked.ply") == first


def test_an_embedding_replaces_all_of_an_earlier_one_in_its_folder(planted, pair_folder, tmp_path):
    shutil.copytree(planted / "1", out := tmp_path / "out")
    command = ["embed", "planted", str(pair_folder), "--out", str(out), "--set", "gaussians=400"]
    assert main([*command, "--set", "message_weight=0"]) == 0
    assert not any((out / "key").iterdir())
    assert embedding_of(out / "public")


def test_the_job_of_an_embedding_passes_over_corrupt_files_of_others(planted, pair_folder, tmp_path, monkeypatch):
    shutil.copytree(planted / "1", out := tmp_path / "out")
    (other := out / "key" / "other.npz").touch()
    record_file(other).write_text('{"artifact": "other.npz", "crc32": "0", "record": "corrupt"}')
    monkeypatch.setenv(LOG, str(tmp_path / "embed.log"))
    assert main(["embed", "planted", str(pair_folder), "--out", str(out), "--set", "gaussians=400"]) == 0
    assert other.exists()


def test_the_key_of_another_model_extracts_only_as_a_control(planted, pair_folder, tmp_path, capsys):
    def refused(model: str, key: str, *options: str) -> bool:
        capsys.readouterr()
        status = extract(planted / model, planted / key / "key", pair_folder, tmp_path, *options)
        return status == 2 and "embedding: expected" in capsys.readouterr().err

    assert refused("2/public", "1")
    assert refused("attacked.ply", "2")
    assert not refused("attacked.ply", "2", "--control")
    assert not refused("1/public", "1")
    assert not refused("attacked.ply", "1")
    assert not refused("attacked.ply", "2", "--wrong-key", "1")
    shutil.copy(planted / "attacked.ply", tmp_path / "unrecorded.ply")
    assert extract(tmp_path / "unrecorded.ply", planted / "2" / "key", pair_folder, tmp_path) == 0


def test_a_row_that_is_not_finite_does_not_stop_the_owner(planted, pair_folder, tmp_path, capsys):
    public = read_model(planted / "1" / "public")
    x = np.where(np.arange(len(public)) == 5, np.nan, public.means[:, 0])
    write_model(tmp_path / "model.ply", public.with_columns({"x": x}))
    assert extract(tmp_path / "model.ply", planted / "1" / "key", pair_folder, tmp_path / "out", "--control") == 0
    assert "rows are not finite and are not drawn: 5" in capsys.readouterr().err


def test_a_key_without_records_extracts_only_from_a_model_without_one(planted, pair_folder, tmp_path, capsys):
    key = shutil.copytree(planted / "2" / "key", tmp_path / "key", ignore=shutil.ignore_patterns("*.json"))
    assert extract(planted / "1" / "public", key, pair_folder, tmp_path / "out") == 2
    assert "found no record" in capsys.readouterr().err
    assert extract(planted / "1" / "public", key, pair_folder, tmp_path / "out", "--control") == 0
    unrecorded = shutil.copy(planted / "attacked.ply", tmp_path / "unrecorded.ply")
    assert extract(unrecorded, key, pair_folder, tmp_path / "out") == 0


def test_a_file_of_a_key_without_its_record_is_refused(planted, pair_folder, tmp_path, capsys):
    key = shutil.copytree(planted / "1" / "key", tmp_path / "key")
    (key / ".snakemake_timestamp").touch()
    assert extract(planted / "1" / "public", key, pair_folder, tmp_path / "out") == 0
    record_file(key / "planted.npz").unlink()
    assert extract(planted / "1" / "public", key, pair_folder, tmp_path / "out") == 2
    assert "planted.npz: embedding: expected" in capsys.readouterr().err


def test_weights_of_other_views_are_not_compared_with_those_of_the_message(planted, pair_folder, tmp_path, capsys):
    model = str(planted / "1" / "public" / "point_cloud.ply")
    views = ["--model", model, "--cameras", str(pair_folder / "cameras.json")]
    index, weights = str(tmp_path / "index.tsv"), str(tmp_path / "weights.npy")
    measure = ["contributions", *views, "--stages", str(tmp_path / "stages"), "--split", "test", "--index", index]
    assert main(measure) == 0
    assert main(["weights", "--index", index, "--model", model, "--out", weights]) == 0
    key = ["--scheme", "planted", "--key", str(planted / "1" / "key")]
    command = ["hidden", *views, *key, "--weights", weights, "--out", str(tmp_path / "hidden.json")]
    assert main(command) == 2
    assert "weights.npy: split: expected train, as in " in capsys.readouterr().err
    assert main([*command, "--split", "test"]) == 0
    views[-1] = str(tmp_path / "own.json")
    assert (
        main(
            [
                "cameras",
                "orbit",
                "--model",
                model,
                "--count",
                "2",
                "--width",
                "32",
                "--height",
                "24",
                "--out",
                views[-1],
            ]
        )
        == 0
    )
    hidden = tmp_path / "hidden.npy"
    command = ["hidden", *views, *key, "--weights", weights, "--out", str(tmp_path / "own_hidden.json")]
    assert main([*command, "--split", "test", "--hidden", str(hidden)]) == 0, "a message may have views of its own"
    require_agreement(Path(weights), hidden, facts_of(Path(weights)), facts_of(hidden))


def test_an_original_of_another_key_is_refused(planted, pair_folder, tmp_path, capsys):
    original = ("--original", str(planted / "1" / "public"))
    assert extract(planted / "attacked.ply", planted / "2" / "key", pair_folder, tmp_path, "--control", *original) == 2
    assert "embedding: expected" in capsys.readouterr().err
    assert extract(planted / "attacked.ply", planted / "1" / "key", pair_folder, tmp_path, *original) == 0
    attacked = ("--original", str(planted / "attacked.ply"))
    assert extract(planted / "attacked.ply", planted / "1" / "key", pair_folder, tmp_path, *attacked) == 2
    assert "--original: expected the published model" in capsys.readouterr().err


def test_results_of_another_variant_are_not_tabulated(planted, pair_folder, tmp_path):
    model, cameras = str(planted / "1" / "public" / "point_cloud.ply"), str(pair_folder / "cameras.json")
    folders = [tmp_path / "planted" / "room" / attack for attack in ("random_pruning", "gaussian_noise")]
    files = ("metrics.csv", "prune_mask.npy")
    paths = [[folder / name for folder in folders] for name in files]

    def measured(folder: Path) -> None:
        files = [str(pair_folder), str(folder / "renders"), "--out", str(folder / "metrics.csv")]
        assert main(["metrics", *files, "--reference", "truth"]) == 0

    for folder in folders:
        out, removed = str(folder / "public" / "point_cloud.ply"), str(folder / "prune_mask.npy")
        assert main(["attack", folder.name, "--model", model, "--out", out, "--removed", removed]) == 0
        renders = ["--split", "test", "--out", str(folder / "renders" / "scene")]
        assert main(["render", out, "--cameras", cameras, *renders]) == 0
        measured(folder)
    assert len(collect(*paths)) == 2
    for name in files:
        before = [(folders[1] / f"{name}{suffix}").read_bytes() for suffix in ("", ".json")]
        for suffix in ("", ".json"):
            shutil.copy(folders[0] / f"{name}{suffix}", folders[1])
        with pytest.raises(InputError, match=f"gaussian_noise/{name}: (model|attack): expected"):
            collect(*paths)
        for suffix, content in zip(("", ".json"), before, strict=True):
            (folders[1] / f"{name}{suffix}").write_bytes(content)
    shutil.rmtree(folders[1] / "renders")
    shutil.copytree(folders[0] / "renders", folders[1] / "renders")
    measured(folders[1])
    with pytest.raises(InputError, match=r"gaussian_noise/renders/scene: model: expected"):
        collect(*paths)


def test_a_key_learns_from_photographs_of_its_own_message_only(planted, pair_folder, tmp_path, capsys):
    public, key = planted / "1" / "public", planted / "1" / "key"
    args = SimpleNamespace(key=key, transform=None, device=None, photographs=pair_folder / "message")
    assert len(_lesson(args).images) > 0
    assert extract(public, key, pair_folder, tmp_path / "a", "--photographs", str(pair_folder / "message")) == 0
    copied = shutil.copytree(pair_folder / "message", tmp_path / "message")
    views = read_json(copied / "rendered.json")["views"]
    write_image(copied / f"{min(views)}.png", np.zeros((36, 48, 3)))
    record_views(copied, views, target="message")
    assert extract(public, key, pair_folder, tmp_path / "b", "--photographs", str(copied)) == 2
    assert "message: expected" in capsys.readouterr().err


def test_pruned_rows_are_not_compared_with_the_rows_of_the_message_of_another_model(planted, tmp_path):
    metrics, mask = (tmp_path / "planted" / "room" / "gspure" / name for name in ("metrics.csv", "prune_mask.npy"))
    truth = tmp_path / "planted" / "room" / "key" / "message_rows.npy"
    rows = 9
    write_metrics(metrics, [ViewMetrics("scene", "a", "truth", dict.fromkeys(METRICS, 1.0))])
    for path, embedding in ((mask, "run 0"), (truth, "run 1")):
        save_array(path, np.arange(rows) < 3)
        write_record(path, inputs={}, settings={}, embedding=embedding)
    with pytest.raises(InputError, match=r"message_rows.npy: embedding: expected run 0"):
        collect([metrics], [mask], truth=[truth])
    record_file(truth).unlink()
    with pytest.raises(InputError, match=r"message_rows.npy: embedding: expected run 0, found no record"):
        collect([metrics], [mask], truth=[truth])
    record_file(mask).unlink()
    (outcome,) = collect([metrics], [mask], truth=[truth])
    assert outcome.recall == 1


def test_a_key_of_files_of_two_embeddings_is_refused(planted, pair_folder, tmp_path, capsys):
    key = shutil.copytree(planted / "1" / "key", tmp_path / "key")
    for name in ("message_rows.npy", "message_rows.npy.json"):
        shutil.copy(planted / "2" / "key" / name, key / name)
    assert extract(planted / "1" / "public", key, pair_folder, tmp_path / "out") == 2
    assert "embedding: expected" in capsys.readouterr().err
    record_file(key / "message_rows.npy").unlink()
    assert embedding_of(key) == embedding_of(planted / "1" / "key")


def published(model, folder: Path, embedding: str) -> list[Path]:
    """Write a public model as `gspure embed` does."""
    written = model.write(folder / "point_cloud.ply")
    for path in written:
        write_record(path, inputs={}, settings={}, embedding=embedding)
    return written


def hider(iteration: int) -> FeatureModel:
    return FeatureModel(rows(), DecoderFile(Path(f"chkpnt{iteration}_net.pth"), bytes([iteration])))


MODELS = {"gs_hider": (hider(7), hider(9)), "secure_gs": (random_public(seed=1), random_public(seed=2))}
READERS = {"gs_hider": gs_hider.SCHEME.read_public, "secure_gs": secure_gs.SCHEME.read_public}


@pytest.mark.parametrize("scheme", MODELS)
def test_a_network_of_another_model_is_refused(tmp_path, scheme):
    models = [published(model, tmp_path / str(i), f"run {i}") for i, model in enumerate(MODELS[scheme])]
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    for path in (models[0][0], models[1][1]):
        shutil.copy(path, mixed)
        shutil.copy(record_file(path), mixed)
    with pytest.raises(InputError, match="embedding: expected run 0"):
        READERS[scheme](mixed)
    record_file(mixed / models[1][1].name).unlink()
    with pytest.raises(InputError, match="embedding: expected run 0, found no record"):
        READERS[scheme](mixed)
    record_file(mixed / models[0][0].name).unlink()
    READERS[scheme](mixed)


@pytest.mark.parametrize("scheme", MODELS)
def test_attacks_keep_the_embedding_of_networks(tmp_path, scheme):
    model, *_ = published(MODELS[scheme][0], tmp_path / "public", "run 0")
    out = tmp_path / "attacked" / "point_cloud.ply"
    assert main(["attack", "random_pruning", "--model", str(model), "--out", str(out)]) == 0
    networks = [path for path in out.parent.iterdir() if path.suffix == ".pth"]
    assert [record_of(path)["embedding"] for path in (out, *networks)] == ["run 0", "run 0"]


@pytest.mark.parametrize("recorded", [(), (0,), (1,), (0, 1)])
@pytest.mark.parametrize("scheme", MODELS)
def test_the_networks_of_other_models_are_not_replaced(tmp_path, capsys, scheme, recorded):
    models = {"gs_hider": [FeatureModel(rows(), DecoderFile(Path("chkpnt7_net.pth"), bytes([i]))) for i in range(2)]}
    paths = []
    for i, model in enumerate({**MODELS, **models}[scheme]):
        paths += [published(model, tmp_path / str(i), f"run {i}")]
        for path in paths[-1] if i not in recorded else ():
            record_file(path).unlink()
    (source, _), (other, network) = paths
    before = {path: path.read_bytes() for path in other.parent.iterdir()}
    purify = ["purify", str(source), "--cameras", "orbit", "--out", str(other.parent)]
    attack = ["attack", "random_pruning", "--model", str(source), "--out", str(other.with_name("attacked.ply"))]
    for command in (purify, attack):
        assert main(command) == 2
        assert "networks: expected none of another model" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in other.parent.iterdir()} == before
    other.unlink()
    assert main(attack) == (0 if 1 in recorded else 2)
    assert network.read_bytes() == (paths[0][1].read_bytes() if 1 in recorded else before[network])


def test_networks_of_another_writer_are_copied_byte_for_byte(tmp_path):
    model, network = published(random_public(), tmp_path / "published", "")
    record_file(network).unlink()
    with zipfile.ZipFile(network, "a") as archive:
        archive.comment = b"of another writer"
    out = tmp_path / "attacked" / "point_cloud.ply"
    assert main(["attack", "random_pruning", "--model", str(model), "--out", str(out)]) == 0
    assert out.with_name(network.name).read_bytes() == network.read_bytes()


def test_networks_of_a_model_in_the_form_of_others_stay_as_they_are(tmp_path):
    model, network = published(random_public(), tmp_path, "")
    record_file(network).unlink()
    with zipfile.ZipFile(network, "a") as archive:
        archive.comment = b"of another writer"
    before = network.read_bytes()
    assert main(["attack", "random_pruning", "--model", str(model), "--out", str(tmp_path / "attacked.ply")]) == 0
    assert main(["purify", str(model), "--cameras", "orbit", "--out", str(tmp_path)]) == 0
    assert network.read_bytes() == before
    assert not record_file(network).exists()


@pytest.mark.parametrize("scheme", MODELS)
def test_the_networks_of_a_model_are_shared_by_those_that_attacks_write_beside_it(tmp_path, scheme):
    model, network = published(MODELS[scheme][0], tmp_path, "run 0")
    before = record_of(network)
    shutil.copy(model, tmp_path / "copy.ply")
    files = ["--model", str(tmp_path / "copy.ply"), "--out", str(tmp_path / "attacked.ply")]
    assert main(["attack", "random_pruning", *files]) == 0
    assert record_of(network) == before
    READERS[scheme](model)


def test_of_several_decoders_that_of_the_model_is_used(tmp_path, capsys):
    published(hider(9), tmp_path, "run 9")
    published(hider(7), tmp_path, "run 7")
    assert FeatureModel.read(tmp_path).decoder.source.name == "chkpnt7_net.pth"
    assert capsys.readouterr().err == ""


def test_a_corrupt_network_is_found_when_it_is_read(tmp_path):
    for scheme, (model, _) in MODELS.items():
        network = published(model, tmp_path / scheme, "")[1]
        network.write_bytes(network.read_bytes()[:-1] + b"!")
        with pytest.raises(InputError, match=f"{network.name}: content: expected CRC-32"):
            READERS[scheme](tmp_path / scheme)


def test_networks_in_two_formats_are_warned_of(tmp_path, capsys):
    published(random_public(), tmp_path, "")
    (tmp_path / "color_mlp.pt").touch()
    secure_gs.SCHEME.read_public(tmp_path)
    assert "checkpoints.pth is used" in capsys.readouterr().err


def test_bits_are_not_read_from_renders_of_another_model_unless_it_is_a_control(tmp_path, capsys):
    pytest.importorskip("torch")
    from marked_clones.decoder import untrained
    from marked_clones.key import ClonesKey

    ClonesKey(np.ones(4, np.bool_), untrained(4, 0), np.ones(3, np.bool_)).write(tmp_path / "key")
    for path in sorted((tmp_path / "key").iterdir()):
        write_record(path, inputs={}, settings={}, embedding="run 0")
    write_image(tmp_path / "renders" / "view.png", np.zeros((16, 16, 3)))
    command = ["detect", str(tmp_path / "renders"), "--scheme", "marked_clones", "--key", str(tmp_path / "key")]
    for embedding, status in (("run 0", 0), ("run 1", 2), ("", 0)):
        record_views(tmp_path / "renders", {"view": []}, embedding=embedding)
        assert main([*command, "--out", str(tmp_path / "bits.csv")]) == status
        assert ("embedding: expected" in capsys.readouterr().err) == bool(status)
    record_views(tmp_path / "renders", {"view": []}, embedding="run 1")
    assert main([*command, "--control", "--out", str(tmp_path / "bits.csv")]) == 0


def test_renders_record_the_embedding_of_their_model(planted, pair_folder, tmp_path):
    cameras = ("--cameras", str(pair_folder / "cameras.json"), "--split", "test")
    assert main(["render", str(planted / "attacked.ply"), *cameras, "--out", str(tmp_path / "renders")]) == 0
    assert main(["purify", str(planted / "attacked.ply"), *cameras[:2], "--out", str(tmp_path / "purified")]) == 0
    embedding = embedding_of(planted / "1" / "key")
    assert embedding_of(tmp_path / "purified" / "purified.ply") == embedding
    for folder in ("renders", "purified/renders/purified"):
        assert read_json(tmp_path / folder / "rendered.json")["embedding"] == embedding
