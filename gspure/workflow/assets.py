"""The user's models of a configuration, looked up: their files, the scheme of their key."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gspure.cameras import GENERATED, read_cameras
from gspure.cameras.photographs import missing_photographs
from gspure.errors import InputError
from gspure.model.inria import point_cloud
from gspure.schemes.registry import made_by, schemes
from gspure.workflow.config import AssetConfig, Config
from gspure.workflow.inputs import distinct, key_files, model_files, photographs
from gspure.workflow.pairs import require_path


@dataclass(frozen=True)
class Asset:
    """A user's model: its entry, its file (None if it is trained first), the scheme of its key, and all its files."""

    config: AssetConfig
    model: Path | None
    scheme: str | None = None
    has_photographs: bool = False  # of all its views
    files: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Clean:
    """The clean models of another one, with their files if they are the user's."""

    public: tuple[Path, ...]
    files: tuple[Path, ...] = ()


def read_assets(config: Config, source: str) -> dict[str, Asset]:
    """Return the assets of a configuration; raise `InputError` for the first file or name that is not there."""
    assets = {}
    for name, entry in config.assets.items():
        place = f"assets.{name}"
        assets[name] = _read_asset(entry, source, place)
        unmarked = [known for known, asset in config.assets.items() if known != name and asset.clean is None]
        if entry.clean is not None:
            require_known(entry.clean, unmarked, source, f"{place}.clean")
    return assets


def _read_asset(entry: AssetConfig, source: str, place: str) -> Asset:
    """Check the paths of an asset, and find its model and its scheme."""
    for field in ("model", "cameras", "key", "message", "train"):
        path = getattr(entry, field)
        if path and not (field == "cameras" and path in GENERATED):
            require_path(path, source, f"{place}.{field}")
    if entry.train:
        photographs(entry.train)
        return Asset(entry, None)
    model = Path(entry.model or "")
    if model.is_dir():
        model = point_cloud(model)
    files = model_files(model)
    if entry.message:
        files = (*files, *photographs(entry.message))
    views = [] if not entry.cameras or entry.cameras in GENERATED else read_cameras(entry.cameras)
    has_photographs = bool(views) and not missing_photographs(views)
    if has_photographs:
        files = (*files, *(camera.image for camera in views if camera.image))
    if not entry.key:
        return Asset(entry, model, has_photographs=has_photographs, files=files)
    scheme = entry.scheme or made_by(Path(entry.key))[0]
    require_known(scheme, [*schemes()], source, f"{place}.scheme")
    return Asset(entry, model, scheme, has_photographs, distinct((*files, *key_files(entry.key))))


def require_known(name: str, known: Sequence[str], source: str, place: str) -> None:
    """Raise `InputError` unless a name is known."""
    if name not in known:
        raise InputError(source, place, expected=f"one of {', '.join(known) or 'none'}", found=repr(name))
