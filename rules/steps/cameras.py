"""Prepare the views of a model: read or generate, then scale them; those of the message are the owner's."""

from collections.abc import Callable, Mapping
from pathlib import Path

from gspure.cameras import GENERATED, Camera, read_cameras, scaled, write_cameras
from gspure.cameras.worlds import around_offset, in_world_of
from gspure.evaluation.plan import CameraSource
from gspure.metrics.targets import MESSAGE, SCENE
from gspure.model import read_model
from gspure.workflow.step import run


def prepare(
    model: Path, sources: Mapping[str, CameraSource], cameras: Path, message_cameras: Path | None = None
) -> None:
    write_cameras(cameras, views(model, sources[SCENE], in_world_of))
    if message_cameras:
        write_cameras(message_cameras, views(model, sources[MESSAGE], around_offset))  # no render is like the message


def views(
    model: Path, source: CameraSource, placed: Callable[[Path, list[Camera], Path], list[Camera]]
) -> list[Camera]:
    """Return the views of a source, `placed` in the world of the model, at its resolution."""
    if source.source in GENERATED:
        generated = GENERATED[source.source](read_model(model), **source.generated)
        return scaled(generated, source.resolution)
    cameras = placed(model, read_cameras(source.source), Path(source.source))
    return scaled(cameras, source.resolution)


run(prepare)
