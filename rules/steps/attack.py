"""Attack a public model; the verdict tells what the attack changed, or why it cannot apply."""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.attacks import Measurements, NotApplicable, find_attack
from gspure.attacks.attacked import affected
from gspure.attacks.strength import scene_damage
from gspure.files import save_array, write_json, write_provenance
from gspure.opencl.device import choose_device
from gspure.schemes.registry import find_scheme, read_public_model
from gspure.settings import parsed_settings
from gspure.training.dataset import read_photographs
from gspure.workflow.step import run, views_of


def attack(name: str, settings: dict[str, Any], model: Path, public: Path, verdict: Path, **how: Any) -> None:
    public.mkdir(exist_ok=True)
    known, before = find_attack(name), read_public_model(model, how["scheme"]).drawable(model)
    texts = {key: str(value) for key, value in settings.items()}
    used: dict[str, Any] = parsed_settings(f"attack {name}", known.function, texts)
    measurements = Measurements.read(before, {need: Path(how[need]) for need in known.needs})
    learns = "teacher" in known.parameters
    views = views_of(Path(how["cameras"]), "train") if learns else []
    do: dict[str, Any] = {"seed": how["seed"], "cameras": views, "device": choose_device() if learns else None}
    search = None
    try:
        if "damage" in how:
            shown = views_of(Path(how["cameras"]), how["split"])
            truth = read_photographs(shown, before.model.background) if how["photographed"] else None
            measure = scene_damage(before, shown, truth, choose_device())
            search = known.matching(before, measurements, how["damage"], measure, **do, **used)
            used[search.setting] = search.value
        attacked = known.apply(before, measurements, **do, **used)
        if not len(attacked.model):
            raise NotApplicable(name, f"none of {attacked.count} rows would remain")  # noqa: TRY301
    except NotApplicable as error:
        print(error)
        write_json(verdict, {"not applicable": error.reason})
        return
    comment = search.comment(how["damage"]) if search else ""
    attacked.published(before, comment).write(public / "point_cloud.ply")
    save_array(verdict.with_name("prune_mask.npy"), attacked.prune_mask)
    save_array(verdict.with_name("transform.npy"), np.eye(4) if attacked.transform is None else attacked.transform)
    reads = find_scheme(how["scheme"]).extractions if how["scheme"] else {}
    changed = {extraction: affected(before.model, attacked, columns) for extraction, columns in reads.items()}
    used = {**known.settings, **used}
    strength = f"{known.strength.setting}={used[known.strength.setting]:.4g}" if known.strength else ""
    if search and search.misses(how["damage"]):
        strength += f", {search.damage:z.2f} dB reached"
    write_json(verdict, {"reached": changed, "strength": strength, "removed": attacked.removed})
    write_provenance(public, "attack", inputs={"model": model}, settings={"attack": name, **used, **how})
    print(f"{name}: kept {int((~attacked.prune_mask).sum())} of {attacked.count} rows, {len(attacked.model)} in all")


run(attack)
