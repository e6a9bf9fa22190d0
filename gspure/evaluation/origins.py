"""Whether artifacts in the folder of a variant are of this variant, as far as records tell."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from gspure.artifacts import (
    RENDERED,
    embedding_of,
    facts_of,
    file_digest,
    known_digest,
    measured_settings,
    place,
    record_of,
    recorded_inputs,
    require_agreement,
    require_same_origin,
    settings_of,
)
from gspure.cost import COSTS, cost_of
from gspure.errors import InputError
from gspure.evaluation.controls import BASELINES, CLEAN, CONTROLS, MESSAGE_FREE, OTHER_SCENE, WRONG_KEY
from gspure.evaluation.detection import DETECTIONS, KEY
from gspure.evaluation.names import GSPURE, SCHEMES, UNATTACKED, wanted_damage
from gspure.images import SHOWN, origin_of, photographs_of, require_comparable
from gspure.progress import warn

MODEL: Final = "public/point_cloud.ply"
OF_ATTACK: Final = (MODEL, "prune_mask.npy", "verdict.json", "transform.npy")  # what `gspure attack` writes
TRAINED: Final = ("protocol", "initialization")  # what a condition says of a model beside its scheme
OF_A_MODEL: Final = {"seed", "damage_reference", "part", "views", "method"}  # settings that may differ between models


def require_origins(variant: Path, tables: Iterable[Path]) -> None:
    """Raise `InputError` if an artifact in the folder of a variant is of another one.

    Files of an attack must be of one job. Images must show the attacked model, with the owner's key or, in a control,
    the wrong one. Tables must measure these images or, if there are none, all the same images.

    The folder may hold older files, as of a removed detector. So only those of the `tables` are checked that are of the
    variant, or of all variants of its model, and only the images that they measure. If one of these tables has no
    record, all images are checked, as it may measure any of them.
    """
    of_attack = (variant / name for name in OF_ATTACK)
    require_same_origin(_recorded(variant), *of_attack, cost_of(Path(COSTS, *variant.parts[-3:], "attack")))
    folders = (variant, variant / DETECTIONS, variant.parent)
    tables = [table for table in map(place, tables) if table.parent in folders]
    measured = [{p.parent.name for p in map(Path, recorded_inputs(t)) if p.name == RENDERED} for t in tables]
    for images in (record.parent for record in sorted(variant.glob(f"renders/*/{RENDERED}"))):
        if not all(measured) or any(images.name in names for names in measured):
            _require_images_of(variant, images)
    for table in tables:
        require_same_origin(tables[0], table)
        _require_measured_in(variant, table)


def require_equal_images(of_variants: Iterable[Path], of_models: Iterable[Path]) -> None:
    """Raise `InputError` if two tables of a variant measure other images of the same folder and name, by records.

    Tables are joined by the names in their paths, wherever they lie, so one of them may be of another run.
    """
    first_of: dict[tuple[str, ...], tuple[Path, set[str]]] = {}
    for table, images in [
        *((t, _images_of_variant(t)) for t in of_variants),
        *((t, _images_of_model(t)) for t in of_models),
    ]:
        measured: dict[tuple[str, ...], set[str]] = {}  # several digests: metrics also name the references
        for image, digest in images:
            measured.setdefault(image, set()).add(digest)
        for image, digests in measured.items():
            first, expected = first_of.setdefault(image, (table, digests))
            if digests.isdisjoint(expected):
                hint = f"{'/'.join(image[-2:])} differs; one of the tables is outdated or of another run: make it again"
                raise InputError(table, "images", expected=f"those measured in {first}", found="others", hint=hint)


def require_same_renders(metrics: Iterable[Path], detections: Iterable[Path]) -> None:
    """Raise `InputError` if a detector read an image that no table of its variant measures, by records.

    `metrics` measure renders of the scene, in folders of any name. An image without any measured one of its file name
    passes.
    """
    measured: dict[tuple[str, ...], tuple[Path, set[str]]] = {}
    for table in metrics:
        for (*variant, _, name), digest in _images_of_variant(table):
            measured.setdefault((*variant, name), (table, set()))[1].add(digest)
    for table in detections:
        for (*variant, folder, name), digest in _images_of_variant(table):
            first, known = measured.get((*variant, name), (table, {digest}))
            if digest not in known:
                hint = f"{folder}/{name} differs; run `gspure detect` and `gspure metrics` again, on the same renders"
                raise InputError(table, "images", expected=f"those measured in {first}", found="others", hint=hint)


def require_equal_references(metrics: Iterable[Path]) -> None:
    """Raise `InputError` if two variants of a model are compared with different images of a view, by records."""
    first_of: dict[tuple[str, ...], tuple[Path, str]] = {}
    for table in map(place, metrics):
        for image, digest in settings_of(table).get("references", {}).items():
            first, expected = first_of.setdefault((*table.parts[-4:-2], image), (table, digest))
            if digest != expected:
                name, hint = f"reference of {image}", "compare all variants of a model with the same images"
                raise InputError(table, name, expected=f"that of {first}", found="another", hint=hint)


def require_equal_renders(metrics: Iterable[Path]) -> None:
    """Raise `InputError` if two variants of a model, controls aside, have renders of other backgrounds or cameras.

    The same goes for energies. Otherwise their PSNR would differ without an attack. Renders without a record pass.
    """
    first_of: dict[tuple[str, ...], Path] = {}
    for table in (path for path in map(place, metrics) if path.parent.name not in CONTROLS):
        for target in sorted({path.parent.name for path in map(Path, recorded_inputs(table)) if path.name == RENDERED}):
            images = table.parent / "renders" / target
            first = first_of.setdefault((*table.parts[-4:-2], target), images)
            require_comparable(first, images, (path.stem for path in images.glob("*.png")))


def require_one_owner(tables: Iterable[Path]) -> None:
    """Raise `InputError` if, by the records, variants of a model are of several embeddings, or use keys of several.

    Controls may be of another embedding, and only `wrong_key` may use another key. A variant named `unattacked` or
    `gspure` must not show a model after another attack.
    """
    first_of: dict[tuple[str, ...], tuple[Path, str]] = {}
    for table in map(place, tables):
        variant = table.parents[table.parent.name == DETECTIONS]
        shown = [origin for name, origin in settings_of(table).items() if name.startswith(SHOWN)]
        for origin in (*shown, {KEY: settings_of(table).get(KEY)}):
            embeddings = [origin.get("embedding")] * (variant.name not in CONTROLS)
            embeddings += [origin.get(KEY)] * (variant.name != WRONG_KEY)
            for embedding in filter(None, embeddings):
                first, expected = first_of.setdefault(variant.parts[-3:-1], (table, embedding))
                require_agreement(first, table, {"embedding": expected}, {"embedding": embedding})
            if variant.name in CONTROLS:
                continue
            is_public = origin.get("model") == origin.get("embedding", "unknown")
            attack = origin.get("attack") or (UNATTACKED if is_public else variant.name)
            if variant.name in {UNATTACKED, GSPURE} and attack != variant.name:
                found, hint = f"images of {attack}", f"give the folder {variant.name} another name"
                raise InputError(table, "attack", expected=variant.name, found=found, hint=hint)


def require_one_origin(
    variants: Collection[Path], named_after: Collection[str], conditions: Mapping[str, tuple[str, str]]
) -> None:
    """Raise `InputError` if variants that a table compares or averages are not comparable, by their records.

    Records must name one embedding for all variants of a model except controls; one scene for a model and its clean
    model; one prune mask for its variants that are named after their attacks; one pair for all repetitions of a scene;
    one attack with its settings for all variants of a name; and one condition for all models of a scheme. A folder with
    the name of a built-in scheme must hold models of this scheme, and a variant that is named after the damage that its
    strength was searched for must have it.

    `variants` are folders ``SCHEME/SCENE/VARIANT``. `named_after` are the names that are reserved for the attack of the
    same name. `conditions` are protocol and initialization by ``{scheme}/{scene}``; all models of a scheme that are not
    in it have one condition.
    """
    variants = [variant.resolve() for variant in variants]
    attacked = [variant for variant in variants if variant.name not in CONTROLS]
    _require_named_schemes(attacked)
    _require_one_embedding(variants)
    _require_one_pair(attacked)
    _require_one_scene(variants)
    _require_one_attack(variants, named_after)
    _require_one_decision(variants)
    _require_conditions(variants, conditions)


def measured_images(tables: Iterable[Path]) -> dict[str, list[str]]:
    """Return the digests of the records of the images that tables ``SCHEME/SCENE/VARIANT/metrics.csv`` measure."""
    return {
        "/".join(table.parent.resolve().parts[-3:]): sorted(
            digest for path, digest in recorded_inputs(table).items() if Path(path).name == RENDERED
        )
        for table in tables
    }


def recorded_attacks(tables: Iterable[Path]) -> dict[str, dict[str, Any]]:
    """Return attack and settings of the variants ``SCHEME/SCENE/VARIANT`` of tables, as far as records tell."""
    variants = [table.parent.resolve() for table in tables]
    known = {"/".join(variant.parts[-3:]): settings_of(_recorded(variant)) for variant in variants}
    return {variant: settings for variant, settings in known.items() if "attack" in settings}


def recorded_models(tables: Iterable[Path]) -> dict[str, dict[str, Any]]:
    """Return the origin of the models ``SCHEME/SCENE`` of tables, as the records of their attacked variants name it."""
    variants = [table.parent.resolve() for table in tables]
    attacked = [variant for variant in variants if "attack" in settings_of(_recorded(variant))]
    origins = ("embedding", "message", "scene", "public model")
    return {
        "/".join(variant.parts[-3:-1]): {k: v for k, v in model_facts(_recorded(variant)).items() if k in origins}
        for variant in attacked
    }


def attacks_of(model: Path) -> str:
    """Return the names of the attacks that a model comes from, the first one first, as far as its record tells."""
    known = (settings_of(model).get(name, "") for name in ("after", "attack"))
    return ", ".join(str(name) for name in known if name not in {"", UNATTACKED})


def model_facts(path: Path) -> dict[str, Any]:
    """Return what the record of an artifact says of its settings, origin, and the model that it is made from."""
    model = recorded_inputs(path).get("model")
    return settings_of(path) | facts_of(path) | ({"public model": model} if model else {})


def tabulated_facts(known: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Return what a table's settings, `known`, say of the model and the variant in whose folder a path lies."""
    facts = dict[str, Any]()
    for folder in place(path).parents:
        facts = facts or known.get("attacks", {}).get("/".join(folder.parts[-3:]), {})
        if model := known.get("models", {}).get("/".join(folder.parts[-2:])):
            return {**facts, **model}
    return {}


def _recorded(variant: Path) -> Path:
    """Return the attacked model of a variant or, if it has no record, what else of the attack has one."""
    files = [variant / name for name in OF_ATTACK]
    return next(filter(record_of, files), files[0])


def _require_named_schemes(variants: Iterable[Path]) -> None:
    for variant in variants:
        expected, found = variant.parts[-3], facts_of(file := _recorded(variant)).get("scheme", "")
        if found and expected in SCHEMES and found != expected:
            hint = f"{expected} is reserved for models of this scheme; rename the folder"
            raise InputError(file, "scheme", expected=expected, found=found, hint=hint)


def _require_one_embedding(variants: Iterable[Path]) -> None:
    """Compare embeddings; warn of renders of the controls `MESSAGE_FREE` that are of the watermarked model.

    These are mistaken, or of a scheme that changes nothing in the model. Either way, the message stands out from
    nothing, and counts as not present.
    """
    first_of: dict[tuple[str, str], tuple[Path, str]] = {}
    for variant in sorted(variants, key=lambda variant: variant.name in MESSAGE_FREE):  # these last
        scheme, folder, name = variant.parts[-3:]
        if name not in CONTROLS and (embedding := embedding_of(file := _recorded(variant))):
            first, expected = first_of.setdefault((scheme, folder), (file, embedding))
            require_agreement(first, file, {"embedding": expected}, {"embedding": embedding})
        for images in sorted(variant.glob("renders/*")) if name in MESSAGE_FREE else ():
            first, marked = first_of.get((scheme, folder), (variant, ""))
            if marked and marked in (origin_of(images, "embedding"), origin_of(images, "model")):
                found = f"those of the watermarked model ({first})"
                warn(f"{images}: expected renders of a model without the message, found {found}")


def _require_one_pair(variants: Iterable[Path]) -> None:
    first_of: dict[tuple[str, str], tuple[Path, dict[str, str]]] = {}
    for file, (scheme, folder, _) in ((_recorded(variant), variant.parts[-3:]) for variant in variants):
        pair = {name: photographs for name, photographs in facts_of(file).items() if name in {"scene", "message"}}
        if pair:
            first, expected = first_of.setdefault((scheme, folder.partition("@")[0]), (file, pair))
            require_agreement(first, file, expected, pair, "SCENE@1, SCENE@2, ... must be of the pair of SCENE")


def _require_one_scene(variants: Iterable[Path]) -> None:
    """Require renders of `clean` and of the other variants of its model to show the same photographs."""
    first_of: dict[tuple[str, ...], tuple[Path, dict[str, str]]] = {}
    shown = (variant for variant in variants if variant.name == CLEAN or variant.name not in CONTROLS)
    for variant in sorted(shown, key=lambda variant: variant.name == CLEAN):  # this last, so that it is refused
        if photographs := photographs_of(images := variant / "renders" / "scene"):
            first, expected = first_of.setdefault(variant.parts[-3:-1], (images, photographs))
            require_agreement(first, images, expected, photographs, "these renders show a model of another scene")


def _require_one_attack(variants: Iterable[Path], named_after: Collection[str]) -> None:
    """Require the same settings, also of weights, clusters and prune masks, in all variants of one name.

    Those `OF_A_MODEL` may differ. If a strength was searched for a damage, so may all numbers except the damage.
    """
    hint = "variants of one name are averaged; use the same settings, or another name"
    first_of: dict[tuple[str, str, str], tuple[Path, Any]] = {}
    for file, (scheme, _, variant) in ((_recorded(variant), variant.parts[-3:]) for variant in variants):
        if "attack" not in (settings := settings_of(file)):
            continue
        rename, attack = f"give the folder {variant} another name", variant.partition("@")[0]
        if attack in named_after and settings["attack"] != attack:
            raise InputError(file, "attack", expected=attack, found=settings["attack"], hint=rename)
        if attack in named_after and settings.get("after"):
            found, hint = f"a model after {settings['after']}", f"attack the public model, or {rename}"
            raise InputError(file, "model", expected="the one before any attack", found=found, hint=hint)
        damage = settings.get("damage", "none")
        wanted = wanted_damage(variant)
        if wanted is not None and (damage == "none" or f"{wanted:g}" != f"{damage:g}"):  # as names have it
            found = "a fixed strength" if damage == "none" else f"{damage} dB"
            raise InputError(file, "damage", expected=f"{wanted:g} dB", found=found, hint=rename)
        known = {k: v for k, v in settings.items() if damage == "none" or isinstance(v, str)} | {"damage": damage}
        for name, value in (measured_settings(file) | known).items():
            if name not in OF_A_MODEL:
                first, expected = first_of.setdefault((scheme, variant, name), (file, value))
                require_agreement(first, file, {name: expected}, {name: value}, hint)


def _require_one_decision(variants: Iterable[Path]) -> None:
    """Require one prune mask for the variants of a model that are named after their attacks, such as `gspure`."""
    first_of: dict[tuple[str, ...], tuple[Path, dict[str, str]]] = {}
    for file, variant in ((_recorded(variant), variant) for variant in variants):
        mask = {name: digest for name, digest in recorded_inputs(file).items() if name == "prune_mask"}
        if mask and settings_of(file).get("attack") == variant.name:
            first, expected = first_of.setdefault(variant.parts[-3:-1], (file, mask))
            require_agreement(first, file, expected, mask, "use the same prune mask for both, or rename a variant")


def _require_conditions(variants: Iterable[Path], conditions: Mapping[str, tuple[str, str]]) -> None:
    trained: dict[tuple[str, tuple[str, str], str], tuple[Path, str]] = {}
    for folder in dict.fromkeys(variant.parent for variant in variants):
        scheme, scene = folder.parts[-2:]
        condition = conditions.get(f"{scheme}/{scene}", ("", ""))
        recorded = settings_of(model := folder / MODEL)
        known: dict[str, str] = {name: recorded[name] for name in TRAINED if name in recorded}
        named = {name: value for name, value in zip(TRAINED, condition, strict=True) if value}
        for name, value in {**known, **named}.items():
            source = Path("--condition") if name in named else model
            first, expected = trained.setdefault((scheme, condition, name), (source, value))
            hint = "correct --condition" if name in named else "name the condition of each model by --condition"
            require_agreement(first, model, {name: expected}, known, hint)


def _images_of_variant(table: Path) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield model and variant, folder and name of the images in the record of a table of a variant, with digests."""
    folder = place(table).parent
    variant = folder.parent if folder.name == DETECTIONS else folder
    for path, digest in ((Path(name), digest) for name, digest in recorded_inputs(table).items()):
        if path.suffix == ".png":
            yield (*variant.parts[-3:], *path.parts[-2:]), digest


def _images_of_model(table: Path) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield the same of a table of all variants, which the paths of its images ``VARIANT/renders/TARGET`` name."""
    for path, digest in ((Path(name), digest) for name, digest in recorded_inputs(table).items()):
        if path.suffix == ".png" and path.parts[-3:-2] == ("renders",):
            yield (*place(table).parent.parts[-2:], *path.parts[-4:-3], *path.parts[-2:]), digest


def _require_images_of(variant: Path, images: Path) -> None:
    origin = {name: origin_of(images, name) for name in ("target", "model", "key")}
    hint = f"these images are of another variant; render them again, or delete {RENDERED}"
    _require_shown(images, origin, {"target": [images.name]} | _shown_by(variant), hint)


def _shown_by(variant: Path) -> dict[str, list[str]]:
    """Return what images of a variant may show: digests of models, and embeddings of keys; nothing where unknown."""
    models = [variant / MODEL]
    if variant.name == WRONG_KEY:
        models = [variant.parent / MODEL]
    elif variant.name == OTHER_SCENE:
        models = [model for model in variant.parents[1].glob(f"*/{MODEL}") if model.parents[1] != variant.parent]
    owner = WRONG_KEY if variant.name == WRONG_KEY else embedding_of(variant.parent / "key")
    return {"model": [known_digest(model) for model in models if model.is_file()], "key": [owner] if owner else []}


def _require_shown(artifact: Path, origin: Mapping[str, str], expected: Mapping[str, list[str]], hint: str) -> None:
    for name, values in expected.items():
        if (found := origin.get(name)) and values and found not in values:
            names = " or ".join(dict.fromkeys(values))
            raise InputError(artifact, name, expected=names, found=found, hint=hint)


def _require_measured_in(variant: Path, table: Path) -> None:
    inputs, baseline = recorded_inputs(table), variant.name if variant.name in BASELINES else None
    if (measured := settings_of(table).get("baseline", baseline)) != baseline:
        names = [f"a comparison of {image or 'renders'}" for image in (baseline, measured)]
        raise InputError(table, "baseline", expected=f"{names[0]}, as for {variant.name}", found=names[1])
    reader = {KEY: settings_of(table).get(KEY, "")}
    wanted = "with a wrong key" if variant.name == WRONG_KEY else "with the key of this model"
    hint = f"run `gspure detect` {wanted} again"
    _require_shown(table, reader, {KEY: _shown_by(variant)[KEY]} if reader[KEY] else {}, hint)
    for setting, origin in settings_of(table).items():
        if setting.startswith(SHOWN) and variant.name not in BASELINES:
            hint = f"the images {setting} are of another variant, or of an earlier model; make the table again"
            _require_shown(table, origin, _shown_by(variant), hint)
    is_of_all_variants = table.parent == variant.parent
    for record, digest in ((Path(name), digest) for name, digest in inputs.items()):
        if record.name != RENDERED or (is_of_all_variants and record.parts[-4:-2] != (variant.name, "renders")):
            continue
        images, known = variant / "renders" / record.parent.name, [digest] if is_of_all_variants else inputs.values()
        if (images / RENDERED).is_file() and file_digest(images / RENDERED) not in known:
            hint = "the table is of another variant, or of earlier images; make it again"
            raise InputError(table, "images", expected=f"those of {images}", found="others", hint=hint)
