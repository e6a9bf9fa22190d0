"""All schemes by name: built-in ones, those of installed plug-ins, and adapters."""

import os
from pathlib import Path

from gspure.errors import InputError, reading
from gspure.files import read_json
from gspure.model import Gaussians, read_model
from gspure.model.finite import FILTER, listed
from gspure.model.summary import doubts
from gspure.plugins import registered
from gspure.progress import warn
from gspure.provenance import PROVENANCE
from gspure.public_model import PublicModel
from gspure.schemes import keyed_pattern, splats_in_splats
from gspure.schemes.adapter import read_adapter
from gspure.schemes.scheme import Scheme

BUILT_IN = (splats_in_splats.SCHEME, splats_in_splats.HARDENED, keyed_pattern.SCHEME)
ADAPTERS = "GSPURE_ADAPTERS"  # the environment variable that names the folder of adapters


def schemes() -> dict[str, Scheme]:
    """Return every scheme by name, or raise `InputError` if an adapter or plug-in is none or has a name in use."""
    installed = registered("schemes", Scheme, BUILT_IN, lambda *_: None)
    folder = os.environ.get(ADAPTERS)
    files = sorted(Path(folder).glob("*.toml")) if folder else []
    return installed | {file.stem: read_adapter(file, installed) for file in files}


def find_scheme(name: str) -> Scheme:
    """Return the scheme of this name, or raise `InputError` with a list of all names.

    >>> [*gspure.find_scheme("splats_in_splats").extractions]
    ['message', 'message_adaptive']
    """
    by_name = schemes()
    if name not in by_name:
        raise InputError("scheme", "name", expected=f"one of {', '.join(by_name)}", found=repr(name))
    return by_name[name]


def read_public_model(path: str | Path, scheme: str | None = None) -> PublicModel:
    """Read a model's file as that of the named scheme, else of the scheme with its columns, else as vanilla 3DGS.

    Warn of implausible values, and of reasons why other programs may draw another image.

    >>> gspure.read_public_model("model.ply").scene()(cameras[0]).shape
    (36, 48, 3)
    """
    public = _read_public(Path(path), scheme)
    for doubt in doubts(public.model):
        warn(f"{path}: {doubt}")
    if unused := public.unused_columns:
        warn(f"{path}: columns that are kept, but have no effect on renders: {listed(unused)}")
    if FILTER in public.model.names and public.model.table[FILTER].any():
        warn(f"{path}: gspure applies the 3-D filter ({FILTER}); programs that ignore this column draw another image")
    if mode := public.model.render_mode:
        warn(f"{path}: trained in render mode {mode}, which gspure does not apply: renders differ from its trainer's")
    return public


def _read_public(path: Path, scheme: str | None) -> PublicModel:
    if scheme:
        return find_scheme(scheme).read_public(path)
    model = read_model(path)
    by_columns = recognized(model)
    return by_columns.read_public(path) if by_columns else PublicModel(model)


def recognized(model: Gaussians) -> Scheme | None:
    """Return the scheme whose signature is among a model's columns, built-in ones first; None for vanilla 3DGS."""
    signed = (scheme for scheme in schemes().values() if scheme.signature)
    return next((scheme for scheme in signed if {*scheme.signature} <= {*model.names}), None)


def made_by(key: Path) -> tuple[str, Path]:
    """Return the scheme and the pair of a key, or raise `InputError` if `gspure embed` did not write the key.

    The pair's path may be relative to the folder where that command ran. Here, it is looked for in the current folder
    and in those above the key.
    """
    file = key / PROVENANCE
    if not file.is_file():
        hint = "`gspure embed --out DIR` writes DIR/key"
        raise InputError(key, "key", expected="a key of gspure", found=f"no {PROVENANCE} in it", hint=hint)
    with reading(file, "the provenance of a key"):
        record = read_json(file)
        scheme = str(record["settings"]["scheme"])
        pair = Path(record["inputs"]["pair"]["path"])
    places = [folder / pair for folder in (Path(), *key.resolve().parents)]
    return scheme, next((place for place in places if place.is_dir()), pair)
