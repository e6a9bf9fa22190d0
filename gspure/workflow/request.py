"""What to audit, and the configuration that it becomes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, count
from pathlib import Path
from typing import Final, Self

from gspure.evaluation.identity import RESULTS
from gspure.files import Json
from gspure.progress import say

AUDIT_FILE: Final = RESULTS / "audit.yaml"
SUITE: Final = "small-1"  # of a model with a key
EVERYDAY: Final = "everyday-1"


@dataclass(frozen=True)
class AuditRequest:
    """What to audit: a configuration, or a model with its views and what its owner has."""

    source: Path
    key: Path | None
    message: Path | None
    cameras: Path | str | None
    up: Sequence[float] | None
    suite: str | None
    everyday: bool
    out: Path | None

    @property
    def is_configuration(self) -> bool:
        """Whether the source is a configuration of the workflow."""
        return self.source.suffix in {".yaml", ".yml"}

    @property
    def scene(self) -> str:
        """The name of a model's folder of results: that of its file or, for general names, of its folder."""
        from gspure.model.inria import UNPACKED_SOG

        source = self.source.resolve()
        named = source.parent if self.source.name in {UNPACKED_SOG, "public"} else source
        return re.sub("[^A-Za-z0-9_-]+", "_", named.stem).lstrip("-")[:100] or "model"

    @property
    def suite_name(self) -> str:
        """The suite; empty for the attacks of a run that names none."""
        if self.everyday:
            return EVERYDAY
        return self.suite or (SUITE if self.key else "")

    def resolved(self) -> Self:
        """Return the same with absolute paths, for a run in another folder."""
        return replace(
            self,
            source=self.source.resolve(),
            key=self.key and self.key.resolve(),
            message=self.message and self.message.resolve(),
            cameras=self.cameras.resolve() if isinstance(self.cameras, Path) else self.cameras,
        )


def own_place(wanted: AuditRequest) -> Path:
    """Return this folder if its results are of the same model and suite, or it has none; else a folder below it."""
    from gspure.model import model_file

    this = (model_file(wanted.source).resolve(), wanted.suite_name)
    name = "-".join(filter(None, ("audit", wanted.scene, wanted.suite_name)))
    numbered = (Path(f"{name}-{number}") for number in count(2))
    return next(place for place in chain([Path(), Path(name)], numbered) if audited_in(place) in {None, this})


def audited_in(place: Path) -> tuple[Path, str] | None:
    """Return the model and the suite of the audit whose results a folder has; None if it has no results.

    Results of a configuration are of no model: the folder stands for it.
    """
    from gspure.evaluation.plan import PLAN_FILE
    from gspure.workflow.config_reading import load_yaml

    if not (place / AUDIT_FILE).is_file():
        return (place.resolve(), "") if (place / RESULTS / PLAN_FILE).is_file() else None
    content = load_yaml(place / AUDIT_FILE)
    models = [place / str(asset.get("model", "")) for asset in content.get("assets", {}).values()]
    first = next(iter(models), place)
    return first.resolve(), str(content.get("suite", ""))


def write_configuration(wanted: AuditRequest, target: Path, *, draws: bool) -> Path:
    """Write the configuration of a model, and return its path; warn of doubtful views, or draw unsure ones."""
    import yaml

    from gspure.cameras import GENERATED, read_cameras
    from gspure.cameras.worlds import in_world_of
    from gspure.files import write_text
    from gspure.model import model_file
    from gspure.schemes.registry import made_by, read_public_model, recognized

    model = model_file(wanted.source)
    owners_scheme = None
    pairs = []
    if wanted.key:
        owners_scheme, pair = made_by(wanted.key)
        pairs = [pair]
    public = read_public_model(model, owners_scheme)
    asset = _asset(wanted, model, pairs)
    if asset["cameras"] not in GENERATED:
        source = Path(asset["cameras"])
        in_world_of(model, read_cameras(source), source)  # for its warnings, before the workflow runs
    elif draws:
        from gspure.figures.panels import mention_up

        shown = public.drawable(model)
        if shown.visible:
            scene = shown.scene(background=shown.model.background)
            mention_up(shown.model, scene, wanted.up, RESULTS)
    content: Json = {"assets": {wanted.scene: asset}}
    scheme = recognized(public.model)
    if scheme:
        content["method"] = {"tau_c": scheme.tau_c, "tau_n": scheme.tau_n}
    if wanted.suite_name:
        content["suite"] = wanted.suite_name
    write_text(target, yaml.safe_dump(content))
    return target


def _asset(wanted: AuditRequest, model: Path, pairs: Sequence[Path]) -> Json:
    """Return the model's entry: with its views and, for its owner, the key and the photographs of the message."""
    from gspure.cameras.reading import default_cameras, place_in
    from gspure.schemes.pair import message_folder

    message = wanted.message or next(filter(place_in, map(message_folder, pairs)), None)
    cameras = wanted.cameras or default_cameras(model, *pairs)
    owner = f", key {wanted.key}, message {message or 'as before the attacks'}" if wanted.key else ""
    say(f"{model}: views {cameras}{owner}")
    paths = {"model": model, "cameras": cameras, "key": wanted.key, "message": message}
    asset: Json = {name: str(path) for name, path in paths.items() if path}
    if wanted.up:
        asset["generated"] = {"up": [*wanted.up]}
    return asset
