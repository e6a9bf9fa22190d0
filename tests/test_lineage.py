"""Inputs of another model, embedding, pair, measurement or table: refused by every command, or mixed for a reason."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import record_of, save_array, write_record, write_text
from gspure.artifacts.checksums import record_file
from gspure.cameras import read_cameras, write_cameras
from gspure.cli import main, parser_of
from gspure.cli.lineage import require_related
from gspure.cli.parser import Output, Unrelated, paths_of
from gspure.errors import InputError
from gspure.schemes.registry import geometry_of
from gspure.schemes.secure_gs.public_model import AnchorModel
from tests.anchor_cases import random_public
from tests.test_cli import parsers

UNRELATED = {
    "cameras": "a model is rendered, measured and attacked in any views; records name those of a measurement",
    "off_path": "as cameras",
    "source": "of cameras: as cameras",
    "decoys": "messages of other pairs",
    "images": "of train: photographs at another resolution, or edited ones; of metrics: see other",
    "other": "images are compared one by one, and of each pair the targets, photographs and cameras",
    "stages": "the names of stages identify their content",
    "results": "searched for indices of any model",
    "link": "linked, not read",
}
"""Inputs of any origin, and why."""

SHORT = {
    "MODEL": "R/public/point_cloud.ply",
    "CAMERAS": "R/pair/cameras.json",
    "KEY": "--scheme planted --key R/key",
    "VARIANT": "R/planted/room/unattacked",
    "OTHER": "R/planted/room/random_pruning",
}

LINES = """
render R/public --cameras orbit --transform R/transform.npy --out out
extract R/public KEY --cameras orbit --photographs R/pair/message --original R/public --out out
extract R/public KEY --cameras orbit --transform R/transform.npy --out out
detect VARIANT/renders/scene KEY --out out.csv
attack gspure --model MODEL --weights R/weights.npy --prune-mask R/mask.npy --labels R/clusters.npz --out out.ply
attack gof --model MODEL --weights R/weights.npy --opacities R/opacities.npy --surface R/surface.npy --out out.ply
attack noise --model MODEL --photographs R/pair/scene --measured R/cost.json --out out.ply
contributions --model MODEL --cameras orbit --transform R/transform.npy --stages stages --index out.tsv
weights --index R/index.tsv --model MODEL --out out.npy
opacities --model MODEL --cameras orbit --transform R/transform.npy --out out.npy
hidden --model MODEL KEY --cameras orbit --weights R/weights.npy --transform R/transform.npy --out out.json
surface --model MODEL --cameras orbit --transform R/transform.npy --out out.npy
features --model MODEL --weights R/weights.npy --opacities R/opacities.npy --out out.npy
prune --clusters R/clusters.npz --weights R/weights.npy --model MODEL --out out.npy
prune --clusters R/clusters.npz --weights R/weights.npy --out out.npy
retrieve R/pair/message --extractions VARIANT/renders/message --out out.csv
figures model --model MODEL --weights R/weights.npy --clusters R/clusters.npz --hidden R/hidden.npy --out out
report --table R/results.csv --contest R/contest.csv --survival R/survival.csv --matched R/matched.csv --out out.html
report --table R/results.csv --costs R/costs.csv --figures R/outcomes.png --out out.html
report --table R/results.csv --diagnosis R/planted/room/diagnosis.json --out out.html
report --table R/results.csv --viewer R/planted/room/diagnosis.json --records R/results.csv.json --out out.html
report --table R/results.csv --records R/planted/room/diagnosis.json.json --out out.html
contest --table R/results.csv --benchmarks R/costs --out out.csv --survival s.csv --matched m.csv --markdown m.md
"""

MADE = """
pair SCENES --out R/pair --views 9 --width 48 --height 36
embed planted R/pair --set gaussians=400 --out R --seed SEED
contributions --model MODEL --cameras CAMERAS --stages R/stages --index R/index.tsv
weights --index R/index.tsv --model MODEL --out R/weights.npy
opacities --model MODEL --cameras CAMERAS --out R/opacities.npy
surface --model MODEL --cameras CAMERAS --method depth --out R/surface.npy
features --model MODEL --weights R/weights.npy --opacities R/opacities.npy --out R/features.npy
tree --features R/features.npy --out R/tree.npy
cluster --tree R/tree.npy --out R/clusters.npz
prune --clusters R/clusters.npz --weights R/weights.npy --model MODEL --out R/mask.npy \
    --diagnosis R/planted/room/diagnosis.json
hidden --model MODEL KEY --cameras CAMERAS --weights R/weights.npy --out R/hidden.json --hidden R/hidden.npy
attack rigid_transform --model MODEL --transform R/transform.npy --cost R/cost.json --out R/moved.ply
attack random_pruning --model MODEL --out OTHER/public/point_cloud.ply \
    --cost R/costs/planted/room/random_pruning/attack.cost.json
attack unattacked --model MODEL --out VARIANT/public/point_cloud.ply
render OTHER/public --cameras CAMERAS --split test --out OTHER/renders/scene
extract OTHER/public KEY --cameras CAMERAS --split test --out OTHER/renders/message
metrics R/pair OTHER/renders --reference truth --out OTHER/metrics.csv
render VARIANT/public --cameras CAMERAS --split test --out VARIANT/renders/scene
extract VARIANT/public KEY --cameras CAMERAS --split test --out VARIANT/renders/message
metrics R/pair VARIANT/renders --reference truth --out VARIANT/metrics.csv
table --metrics VARIANT/metrics.csv OTHER/metrics.csv --out R/results.csv --markdown R/results.md
contest --table R/results.csv --out R/contest.csv --survival R/survival.csv --matched R/matched.csv \
    --markdown R/contest.md --benchmarks R/costs --costs R/costs.csv
figures outcomes --table R/results.csv --name planted/room --out R/outcomes.png
"""


def words_of(lines: str, run: str = "R") -> list[list[str]]:
    """Return the words of command lines; R stands for the folder of a run."""
    for short, long in SHORT.items():
        lines = lines.replace(short, long)
    lines = lines.replace("R/", f"{run}/").replace(" R ", f" {run} ").replace("SEED", str(ord(run)))
    lines = lines.replace("SCENES", "room vault" if run == "R" else "vault room")
    return [line.split() for line in lines.replace("\\\n", "").strip().splitlines()]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two runs, R and S, with pairs that share their cameras."""
    folder = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for run in "RS":
            for words in words_of(MADE, run):
                assert main(words) == 0
    return folder


@pytest.fixture(autouse=True)
def inside(runs, monkeypatch):
    monkeypatch.chdir(runs)


def read_by(parser: argparse.ArgumentParser) -> dict[str, tuple[type, bool]]:
    """Return the type of every option that names files or folders to read, and whether it names several."""
    known = {}
    for action in parser._actions:
        parse = getattr(action, "_parse", action.type)
        try:
            path = parse("path") if callable(parse) else None
        except (ValueError, argparse.ArgumentTypeError):
            continue
        if isinstance(path, Path) and not isinstance(path, Output):
            known[action.dest] = (type(path), parse is not action.type or action.nargs in {"*", "+"})
    return known


def parsed(words: list[str]) -> tuple[str, argparse.Namespace]:
    args = parser_of(words[0]).parse_args(words[1:])
    return " ".join(words[: 2 if words[0] == "figures" else 1]), args


def inputs(args: argparse.Namespace) -> list[str]:
    return [n for n, v in vars(args).items() if any(not isinstance(p, Output | Unrelated) for p in paths_of([v]))]


def test_inputs_of_any_origin_have_a_reason():
    options = [option for parser in parsers().values() for option in read_by(parser).items()]
    assert {name for name, (kind, _) in options if kind is Unrelated} == UNRELATED.keys()


def test_all_other_inputs_of_all_commands_are_compared_below():
    """But not several files of one option, such as those of `gspure table`: they may be of many models."""
    compared: dict[str, set[str]] = {}
    for command, args in map(parsed, words_of(LINES)):
        compared.setdefault(command, set()).update(inputs(args))
    for command, parser in parsers().items():
        related = {name: several for name, (kind, several) in read_by(parser).items() if kind is not Unrelated}
        if len(related) > 1 and not all(related.values()) and command != "figures attacks":  # it compares them itself
            assert compared.get(command) == related.keys(), command


@pytest.mark.parametrize("words", words_of(LINES), ids=" ".join)
def test_inputs_of_one_run_are_accepted_and_each_of_another_run_is_refused(words):
    _, args = parsed(words)
    require_related(args)
    for name in inputs(args):
        value = getattr(args, name)
        others = [Path("S", path.relative_to("R")) for path in paths_of([value])]
        assert all(path.exists() for path in others)
        mixed = argparse.Namespace(**vars(args) | {name: others if isinstance(value, list) else others[0]})
        with pytest.raises(InputError, match=r", as in [RS]/"):
            require_related(mixed)


def test_a_command_compares_its_inputs_before_it_runs(capsys):
    (words,) = words_of("features --model MODEL --weights S/weights.npy --out out.npy")
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "S/weights.npy: embedding: expected " in line
    assert not Path("out.npy").exists()


def drawn(columns: dict[str, str], name: str = "planted/room", table: str = "R/results.csv") -> int:
    words = [f"--column={title}={folder}" for title, folder in columns.items()]
    return main(["figures", "attacks", "--table", table, "--name", name, *words, "--out", "attacks.png"])


COLUMNS = {
    "truth": "R/pair",
    "unattacked": "R/planted/room/unattacked/renders",
    "random_pruning": "R/planted/room/random_pruning/renders",
}


@pytest.mark.parametrize(
    ("title", "folder"),
    [
        ("random_pruning", "R/planted/room/unattacked/renders"),
        ("random_pruning", "S/planted/room/random_pruning/renders"),
        ("random_pruning", "R/planted/room/random_pruning/renders/scene"),
        ("unattacked", "S/planted/room/unattacked/renders"),
        ("truth", "S/pair"),
        ("truth", "R/pair/scene"),
    ],
)
def test_a_figure_shows_only_images_that_its_table_measures(title, folder, capsys):
    assert drawn(COLUMNS) == 0
    capsys.readouterr()
    assert drawn(COLUMNS | {title: folder}) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert folder in line


def test_a_figure_of_another_table_is_refused():
    assert drawn(COLUMNS, table="S/results.csv") == 2


@pytest.mark.parametrize(
    "command", ["metrics R/pair S/planted/room/unattacked/renders", "retrieve R/pair/message --out out.csv"]
)
def test_images_are_not_compared_with_photographs_of_another_pair(command, capsys):
    extractions = ["--extractions", "S/planted/room/unattacked/renders/message"]
    assert main(command.split() + extractions * command.startswith("retrieve")) == 2
    assert "not of the same" in capsys.readouterr().err


def test_images_of_two_targets_are_not_compared(capsys):
    renders = "R/planted/room/unattacked/renders"
    assert main(["metrics", f"{renders}/scene", f"{renders}/message"]) == 2
    assert "target: expected scene" in capsys.readouterr().err


def test_a_control_uses_the_key_of_another_model():
    for options in ("--control", "--wrong-key 1"):
        ((_, args),) = map(parsed, words_of(f"extract S/public KEY --cameras orbit --out out {options}"))
        require_related(args)
        args.original = Path("S/public")
        with pytest.raises(InputError, match="embedding"):
            require_related(args)


def test_files_without_records_are_of_any_origin(tmp_path):
    save_array(tmp_path / "weights.npy", np.ones(3, np.float32))
    ((_, args),) = map(parsed, words_of("features --model MODEL --weights R/weights.npy --out out.npy"))
    args.weights = tmp_path / "weights.npy"
    require_related(args)


def test_a_mask_of_clusters_without_a_record_names_the_model_of_the_weights(tmp_path):
    shutil.copy("R/clusters.npz", tmp_path)
    out = tmp_path / "mask.npy"
    model = Path("R/public/point_cloud.ply")
    prune = f"prune --clusters {tmp_path}/clusters.npz --weights R/weights.npy --model {model} --out {out}"
    assert main(prune.split()) == 0
    assert record_of(out)["geometry"] == geometry_of(model)


def test_the_folder_of_a_model_is_recorded_like_its_file(monkeypatch, tmp_path):
    shutil.copytree("R", tmp_path / "R")
    monkeypatch.chdir(tmp_path)
    file, tried = SHORT["MODEL"], set()
    for words in words_of(MADE):
        if file in words and "--out" in words:
            record = record_file(Path(words[words.index("--out") + 1]))
            before = record.read_text()
            assert main([str(Path(file).parent) if word == file else word for word in words]) == 0
            assert record.read_text() == before
            tried.add(words[0])
    assert tried >= {"weights", "opacities", "surface", "features", "prune", "hidden", "attack"}


def test_weights_of_anchors_with_other_networks_are_refused(tmp_path, monkeypatch, capsys):
    """And an index of their contributions, though rows and types are equal."""
    monkeypatch.chdir(tmp_path)
    first, second = random_public(seed=1), random_public(seed=2)
    for name, public in {"a": first, "b": AnchorModel(first.model, second.networks)}.items():
        public.write(Path(name, "model.ply"))
        measured = [
            "--model",
            f"{name}/model.ply",
            "--cameras",
            "orbit",
            "--stages",
            "stages",
            "--index",
            f"{name}/1.tsv",
        ]
        assert main(["contributions", *measured]) == 0
        assert (
            main(["weights", "--index", f"{name}/1.tsv", "--model", f"{name}/model.ply", "--out", f"{name}/w.npy"]) == 0
        )
        assert record_of(Path(name, "w.npy"))["geometry"] == geometry_of(Path(name, "model.ply"))
    for command in ("attack plain_weight --weights b/w.npy --out out.ply", "weights --index b/1.tsv --out out.npy"):
        capsys.readouterr()
        assert main([*command.split(), "--model", "a/model.ply"]) == 2
        assert "not of the same model" in capsys.readouterr().err
        assert main([*command.replace("b/", "a/").split(), "--model", "a/model.ply"]) == 0


def test_results_of_other_views_are_refused_together(monkeypatch, tmp_path, capsys):
    shutil.copytree("R", tmp_path / "R")
    monkeypatch.chdir(tmp_path)
    measure, weigh, hide = words_of(MADE)[2], words_of(MADE)[3], words_of(MADE)[10]
    assert main([*measure, "--split", "test"]) == 0
    assert main(weigh) == 0
    arrays = "--weights R/weights.npy --clusters R/clusters.npz --hidden R/hidden.npy"
    (figure,) = words_of(f"figures model --model MODEL {arrays} --out out")
    capsys.readouterr()
    assert main(figure) == 2
    assert ": views: expected" in capsys.readouterr().err
    assert main([*hide, "--split", "test"]) == 0


def test_a_table_of_several_pairs_names_none_of_them(tmp_path):
    """So the figures of each pair may stand beside it in a report."""
    for name, message in {"a": "1", "b": "2"}.items():
        for file in (tmp_path / f"{name}.csv", tmp_path / f"{name}.png"):
            write_text(file, name)
            write_record(file, inputs={}, settings={}, ancestors={"message": message, "scene": "3"})
    write_text(table := tmp_path / "both.csv", "both")
    write_record(table, inputs={name: tmp_path / f"{name}.csv" for name in "ab"}, settings={})
    assert record_of(table)["ancestors"] == {"scene": "3"}
    line = f"report --table {table} --figures {tmp_path}/a.png {tmp_path}/b.png --out out.html"
    ((_, args),) = map(parsed, [line.split()])
    require_related(args)


@pytest.mark.parametrize(
    ("photographs", "cameras", "message"),
    [
        ("message", "cameras.json", "target: expected scene, found message"),
        ("scene", "moved.json", "expected the given camera"),
        ("scene", "cameras.json", ""),
    ],
)
def test_damage_is_measured_against_the_photographs_of_the_views(tmp_path, capsys, photographs, cameras, message):
    views = read_cameras(Path("R/pair/cameras.json"))
    step = np.eye(4)
    step[0, 3] = 0.1
    write_cameras(tmp_path / "moved.json", [view.moved(step) for view in views])
    shutil.copy("R/pair/cameras.json", tmp_path / "cameras.json")
    ((words),) = words_of(f"attack random_pruning --model MODEL --photographs R/pair/{photographs} --damage 1")
    words += ["--cameras", str(tmp_path / cameras), "--out", str(tmp_path / "out.ply")]
    assert main(words) == (2 if message else 0)
    assert message in capsys.readouterr().err


@pytest.fixture(scope="module")
def strengths(runs):
    """A table of variants of several attacks and strengths."""
    attacks = {
        "weak": "random_pruning --set fraction=0.1",
        "strong": "random_pruning --set fraction=0.3",
        "reseeded": "random_pruning --set fraction=0.3 --seed 1",
        "lowest": "lowest_opacity --set fraction=0.3",
        "noise": "gaussian_noise --set sigma=0.1",
        "gspure": "gspure --prune-mask R/mask.npy",
        "tau_n_1": "gspure --prune-mask R/mask.npy",
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(runs)
        for variant, attack in attacks.items():
            folder = Path("strengths/planted/room", variant)
            (words,) = words_of(f"attack {attack} --model MODEL --out {folder}/public/point_cloud.ply")
            assert main(words) == 0
            shutil.copy("R/planted/room/random_pruning/metrics.csv", folder)
        metrics = map(str, Path("strengths").rglob("metrics.csv"))
        assert main(["table", "--metrics", *metrics, "--out", "strengths.csv", "--markdown", "strengths.md"]) == 0


CONTEST = "contest --table strengths.csv --out c.csv --survival s.csv --matched m.csv --markdown c.md --sweep x="
POINTS = "figures sweep --table strengths.csv --condition planted --out sweep.png --point gspure=4,4 --point="


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (f"{CONTEST}weak,strong", ""),
        (f"{CONTEST}gspure,tau_n_1", ""),
        (f"{CONTEST}weak,noise", "found gaussian_noise"),
        (f"{CONTEST}strong,lowest", "found lowest_opacity"),
        (f"{CONTEST}weak,reseeded", "found random_pruning seed 1"),
        (f"{CONTEST}weak,gspure", "found gspure"),
        (f"{POINTS}tau_n_1=1,4", ""),
        (f"{POINTS}weak=1,4", "found random_pruning"),
    ],
)
def test_only_variants_of_one_attack_are_strengths_of_it(strengths, capsys, words, found):
    assert main(words.split()) == (2 if found else 0)
    assert found in capsys.readouterr().err


@pytest.mark.parametrize(
    ("trained", "conditions", "message"),
    [
        ("shared,both own,both", "shared,both own,both", ""),
        ("shared,both own,both", "shared,both shared,both", "protocol: expected shared"),
        ("shared,both shared,scene", "shared,both shared,both", "initialization: expected both"),
        ("shared,both shared,both", "own,both own,both", "protocol: expected own"),
        ("shared,both shared,both", "", ""),
        ("shared,both own,both", "", "protocol: expected shared"),
        ("shared,both shared,scene", "", "initialization: expected both"),
        (" ", "shared,both own,both", ""),
    ],
)
def test_a_condition_is_that_of_the_records(tmp_path, capsys, trained, conditions, message):
    """Of the pair that a model was trained on, so that means are over models of one condition."""
    metrics, words = [], []
    for scene, known in zip("ab", trained.split(" "), strict=True):
        write_text(model := tmp_path / "sis" / scene / "public" / "point_cloud.ply", scene)
        settings = dict(zip(("protocol", "initialization"), known.split(","), strict=True)) if known else {}
        write_record(model, inputs={}, settings=settings)
        metrics.append(
            str(shutil.copytree("R/planted/room/unattacked", tmp_path / "sis" / scene / "x") / "metrics.csv")
        )
    for scene, condition in zip("ab", conditions.split(), strict=False):
        words.append(f"--condition=sis/{scene}={condition}")
    outputs = ["--out", str(tmp_path / "results.csv"), "--markdown", str(tmp_path / "results.md")]
    assert main(["table", "--metrics", *metrics, *words, *outputs]) == (2 if message else 0)
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("protocol", ["shared", "own"])
def test_the_record_of_a_model_names_the_poses_of_its_message(tmp_path, protocol):
    pair = f"pair room vault --protocol {protocol} --views 9 --width 48 --height 36 --out {tmp_path}/pair"
    assert main(pair.split()) == 0
    assert main(f"embed planted {tmp_path}/pair --set gaussians=400 --out {tmp_path}".split()) == 0
    assert record_of(tmp_path / "public" / "point_cloud.ply")["settings"]["protocol"] == protocol


def test_the_record_of_an_attacked_model_names_its_scheme_and_the_settings_of_its_decision(tmp_path):
    decide = f"prune --clusters R/clusters.npz --weights R/weights.npy --tau-c 3 --out {tmp_path}/prune_mask.npy"
    assert main(decide.split()) == 0
    attack = f"attack gspure --model R/public/point_cloud.ply --prune-mask {tmp_path}/prune_mask.npy"
    assert main(f"{attack} --out {tmp_path}/public/point_cloud.ply".split()) == 0
    record = record_of(tmp_path / "public/point_cloud.ply")
    known = {"tau_c": "3.0", "min_cluster_size": "50", "min_samples": "10", "energy": "ray", "reduction": "sum"}
    assert known.items() <= record["measured"].items()
    assert record["ancestors"]["scheme"] == "planted"


@pytest.mark.parametrize(("scheme", "source", "warned"), [("sis", "R", 1), ("sis", "S", 0), ("other", "R", 0)])
def test_a_table_warns_of_scenes_with_the_same_images(tmp_path, capsys, scheme, source, warned):
    shutil.copytree("R/planted/room/unattacked", first := tmp_path / "sis" / "a" / "unattacked")
    shutil.copytree(f"{source}/planted/room/unattacked", second := tmp_path / scheme / "b" / "unattacked")
    outputs = ["--out", str(tmp_path / "results.csv"), "--markdown", str(tmp_path / "results.md")]
    assert main(["table", "--metrics", str(first / "metrics.csv"), str(second / "metrics.csv"), *outputs]) == 0
    assert capsys.readouterr().err.count("b: the renders are identical to those of a;") == warned


def test_costs_of_another_variant_are_refused(tmp_path, capsys):
    """Though it is of the same model."""
    shutil.copytree("R/costs/planted/room/random_pruning", tmp_path / "planted/room/unattacked")
    outputs = "--out c.csv --survival s.csv --matched m.csv --markdown c.md"
    assert main(f"contest --table R/results.csv --benchmarks {tmp_path} {outputs}".split()) == 2
    assert "attack: expected unattacked" in capsys.readouterr().err


def test_costs_of_an_attack_that_is_not_in_the_table_are_not_read(tmp_path):
    """As those of an earlier configuration, and of an earlier model."""
    shutil.copytree("S/costs/planted/room/random_pruning", tmp_path / "planted/room/gone")
    outputs = (
        f"--out {tmp_path}/c.csv --survival {tmp_path}/s.csv --matched {tmp_path}/m.csv --markdown {tmp_path}/c.md"
    )
    assert main(f"contest --table R/results.csv --benchmarks {tmp_path} {outputs}".split()) == 0
