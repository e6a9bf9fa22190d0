"""Attack a public model; the verdict tells what the attack changed, or why it cannot apply."""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.attacks import Measurements, NotApplicable, find_attack
from gspure.attacks.attacked import affected
from gspure.attacks.strength import Damage, scene_damage
from gspure.cameras import Camera
from gspure.files import load_array, save_array, write_json, write_provenance
from gspure.images import read_image
from gspure.method.clusters import read_labels
from gspure.opencl.device import choose_device
from gspure.public_model import PublicModel
from gspure.schemes.registry import find_scheme, read_public_model
from gspure.settings import parsed_settings
from gspure.workflow.step import run, views_of

DTYPES = {"weights": np.float32, "opacities": np.float32, "surface": np.float32, "prune_mask": np.bool_}


def attack(
    name: str,
    settings: dict[str, Any],
    model: Path,
    public: Path,
    verdict: Path,
    scheme: str | None = None,
    seed: int = 0,
    damage: float | None = None,
    split: str = "test",
    cameras: Path | None = None,
    photographs: Path | None = None,
    **measured: str,
) -> None:
    public.mkdir(exist_ok=True)
    known, before = find_attack(name), read_public_model(model, scheme).drawable(model)
    used: dict[str, Any] = parsed_settings(
        f"attack {name}", known.function, {key: str(value) for key, value in settings.items()}
    )
    measurements, views = read(before, measured), []
    if cameras and "cameras" in known.parameters:
        views = views_of(cameras, "train")
    do: dict[str, Any] = {"seed": seed, "cameras": views, "device": choose_device() if views else None}
    comments, missed = [], ""
    try:
        if damage is not None and cameras:
            measure = damage_in(before, views_of(cameras, split), photographs)
            search = known.matching(before, measurements, damage, measure, **do, **used)
            used[search.setting] = search.value
            comments = [search.comment(damage)]
            missed = f", {search.damage:z.2f} dB reached" if search.misses(damage) else ""
        attacked = known.apply(before, measurements, **do, **used)
    except NotApplicable as error:
        print(error)
        write_json(verdict, {"not applicable": str(error)})
        return
    if not len(attacked.model):
        write_json(verdict, {"not applicable": f"none of {attacked.count} rows would remain"})
        return
    after = attacked.model
    for comment in comments:
        after = after.with_comment(comment)
    before.with_model(after.with_background(before.model.background)).write(public / "point_cloud.ply")
    save_array(verdict.with_name("prune_mask.npy"), attacked.prune_mask)
    save_array(verdict.with_name("transform.npy"), np.eye(4) if attacked.transform is None else attacked.transform)
    reads = find_scheme(scheme).extractions if scheme else {}
    changed = {extraction: affected(before.model, attacked, columns) for extraction, columns in reads.items()}
    used = {**known.settings, **used}
    strength = f"{known.strength.setting}={used[known.strength.setting]:.4g}{missed}" if known.strength else ""
    write_json(verdict, {"reached": changed, "strength": strength})
    inputs = {"model": model, **{need: Path(file) for need, file in measured.items()}}
    write_provenance(public, "attack", inputs=inputs, settings={"attack": name, "seed": seed, "damage": damage, **used})
    print(f"{name}: kept {int((~attacked.prune_mask).sum())} of {attacked.count} rows, {len(attacked.model)} in all")


def damage_in(public: PublicModel, views: list[Camera], photographs: Path | None) -> Damage:
    """Return the function that measures the damage to the scene in these views."""
    files = [photographs / f"{view.name}.png" for view in views] if photographs else []
    truth = [read_image(file, background=public.model.background) for file in files]
    return scene_damage(public, views, truth or None, choose_device())


def read(public: PublicModel, measured: dict[str, str]) -> Measurements:
    """Return what the attack needs beside the model; the opacities of Gaussians are in the model."""
    found: dict[str, Any] = {"opacities": public.model.opacities} if public.rows_are_gaussians else {}
    for name, file in measured.items():
        if name == "labels":
            found[name] = read_labels(Path(file))
        else:
            found[name] = load_array(Path(file), dtype=DTYPES[name], shape=(len(public.model),), least=0)
    return Measurements(**found)


run(attack)
