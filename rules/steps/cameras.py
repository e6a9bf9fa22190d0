"""Prepare the views of a model: read or generate, then scale them; those of the message are the owner's."""

from pathlib import Path
from typing import Any

from gspure.cameras import GENERATED, read_cameras, scaled, write_cameras
from gspure.cameras.worlds import in_world_of
from gspure.model import read_model
from gspure.workflow.step import run


def prepare(
    model: Path, views: dict[str, str], settings: dict[str, Any], cameras: Path, message_cameras: Path | None = None
) -> None:
    for name, source, target in zip(views, views.values(), filter(None, (cameras, message_cameras)), strict=True):
        if source in GENERATED:
            generated = {key: value for key, value in settings["generated"].items() if value is not None}
            generated["fov_degrees"] = generated.pop("fov")
            found = GENERATED[source](read_model(model), **generated)
        else:
            found = in_world_of(model, read_cameras(source), Path(source))
        write_cameras(target, scaled(found, settings.get(f"{name}_resolution", settings["resolution"])))


run(prepare)
