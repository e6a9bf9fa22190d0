"""Adapters: schemes that run the programs of an author's unmodified checkout.

The programs are processes of their own and exchange files with gspure; nothing is copied or imported. ``NAME.toml``
describes the scheme NAME; examples/adapters/README.md explains its fields.
"""

from __future__ import annotations

import ctypes
import shlex
import shutil
import sys
import tomllib
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Final

import numpy as np

from gspure.arrays import Float32
from gspure.cameras.camera import Camera
from gspure.cameras.colmap import write_colmap
from gspure.errors import InputError, reading
from gspure.external import files_of, output_of, words_of
from gspure.images import read_image
from gspure.metrics.readings import Reading, as_digits, read_marks
from gspure.metrics.targets import ADAPTIVE, BITS, MESSAGE
from gspure.model import write_model
from gspure.opencl.device import Device
from gspure.public_model import PublicModel, RenderView
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import Key, Scheme
from gspure.settings import MaxGaussians, Range, Steps
from gspure.training.initialization import gaussians_at, thinned

MESSAGE_FILE: Final = "message.txt"  # in a key: the bits, as a text of 0 and 1
PROGRAMS: Final = ("embed", "extract", "detect", "wrong")
FIELDS: Final = ("checkout", "commit", "cuda", "public", *PROGRAMS)
VANILLA: Final = "splats_in_splats"  # a built-in scheme whose public files are vanilla 3DGS
VANILLA_COLUMNS: Final = ("x", "y", "z", "f_*", "opacity", "scale_*", "rot_*")
DAY: Final = 86_400.0  # seconds
_CUDA_FREE: Final = (sys.executable, "-m", "gspure", "cuda-free", "--")


@dataclass(frozen=True)
class Adapter:
    """A checkout, and the commands that run its programs."""

    source: Path
    base: Scheme  # reads public files and trains clean models; reads the key too, unless the programs do
    checkout: Path
    commit: str
    cuda: bool
    commands: Mapping[str, str]  # by program, some of `PROGRAMS`

    @property
    def reads_key(self) -> bool:
        """Whether a program reads the key, not `base`."""
        return "extract" in self.commands or "detect" in self.commands

    def words(self, program: str, **values: object) -> list[str]:
        """Return the words of a command; if it needs CUDA and there is no driver, ``gspure cuda-free`` runs it.

        Raise `InputError` if the checkout is not at the commit or has changes, or if a placeholder is unknown.
        """
        head = self._git("rev-parse", "HEAD")
        if head != self.commit:
            raise InputError(self.checkout, "commit", expected=self.commit, found=head)
        changes = self._git("status", "--porcelain", "--untracked-files=no", "--ignore-submodules=untracked")
        if changes:
            raise InputError(self.checkout, "files", expected=f"those of {self.commit}", found=f"changes: {changes}")
        placeholders = {"here": self.source.parent, **values}
        runner = _CUDA_FREE if self.cuda and not _has_driver() else ()
        try:
            return [*runner, *(word.format_map(placeholders) for word in words_of(self.commands[program]))]
        except (AttributeError, IndexError, KeyError, ValueError):
            expected = f"no placeholders but {', '.join(placeholders)}"
            raise InputError(self.source, program, expected=expected, found=self.commands[program]) from None

    def run(self, program: str, **values: object) -> None:
        """Run a program in the checkout, or raise `InputError` if it cannot run, fails or takes more than a week."""
        output_of(self.source, program, self.words(program, **values), 7 * DAY, self.checkout)

    def _git(self, *words: str) -> str:
        return output_of(self.source, "git", ["git", "-C", str(self.checkout), *words], DAY).strip()


def read_adapter(source: Path, schemes: Mapping[str, Scheme]) -> Scheme:
    """Return the scheme that a TOML file describes, or raise `InputError` for its first fault.

    Public files may be those of one of the `schemes`.
    """
    with reading(source, "the description of an adapter"):
        fields = tomllib.loads(source.read_text(encoding="utf-8"))
    _require_fields(source, fields)
    if source.stem in schemes:
        raise InputError(source, "name", expected="a name not in use", found=repr(source.stem))
    base = fields.get("public", VANILLA)
    if base not in schemes:
        raise InputError(source, "public", expected=f"one of {', '.join(schemes)}", found=repr(base))
    readers = {"extract", "detect", "public"} & fields.keys()
    if not readers or {"extract", "detect"} <= readers:
        expected = "`extract` or `detect`, or a `public` scheme that reads the key"
        raise InputError(source, "fields", expected=expected, found=" and ".join(sorted(readers)) or "none")
    source = source.resolve()
    checkout = (source.parent / Path(fields["checkout"]).expanduser()).resolve()
    commands: dict[str, str] = {program: fields[program] for program in PROGRAMS if program in fields}
    return _scheme(Adapter(source, schemes[base], checkout, fields["commit"], fields.get("cuda", False), commands))


def _has_driver() -> bool:
    """Return whether there is a driver of NVIDIA."""
    try:
        ctypes.CDLL("libcuda.so.1")
    except OSError:
        return False
    return True


def _require_fields(source: Path, fields: Mapping[str, Any]) -> None:
    """Raise `InputError` for the first field that is unknown, has another type or is missing."""
    required = ["checkout", "commit", "embed"]
    if "extract" in fields:
        required.append("wrong")
    for name in (*fields, *required):
        value = repr(fields[name]) if name in fields else "nothing"
        if name not in FIELDS:
            raise InputError(source, name, expected=f"one of {', '.join(FIELDS)}", found=value)
        if not isinstance(fields.get(name), bool if name == "cuda" else str):
            raise InputError(source, name, expected="a text, or of `cuda` true or false", found=value)


def _scheme(adapter: Adapter) -> Scheme:
    """Return the scheme of an adapter, under the name of its file."""
    base = adapter.base
    sources = [adapter.source]
    for command in adapter.commands.values():
        local_command = command.replace("{here}", str(adapter.source.parent))
        sources += map(Path, files_of(local_command, adapter.source))
    scheme = replace(
        base, name=adapter.source.stem, embed=partial(embed, adapter), signature=(), sources=tuple(sources)
    )
    if not adapter.reads_key:
        return scheme
    columns = VANILLA_COLUMNS if base.name == VANILLA else base.extractions[MESSAGE]
    targets = (BITS,) if "detect" in adapter.commands else (MESSAGE, ADAPTIVE)
    return replace(
        scheme,
        read_key=partial(FilesKey, adapter),
        extractions=dict.fromkeys(targets, columns),
        carriers=(),
        redraw=None,
        fits=False,
        reveals=False,
    )


def embed(
    adapter: Adapter,
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 3000,
    message_weight: Annotated[int, Range(0, 1)] = 1,
    max_gaussians: MaxGaussians = 30_000,
) -> tuple[PublicModel, Key | None]:
    """Let the authors' program hide the pair's message; a weight of 0 gives a clean model by gspure, and no key.

    The other settings are those of models that gspure trains.
    """
    base = adapter.base
    if not message_weight:
        settings = {"iterations": iterations, "max_gaussians": max_gaussians}
        common = {name: value for name, value in settings.items() if name in base.settings}
        return base.embed(replace(pair, initialization="scene"), seed, device, message_weight=0, **common)
    with ExitStack() as stack:
        place = Path(stack.enter_context(TemporaryDirectory(prefix="gspure-")))
        values: dict[str, Any] = {"seed": seed, "iterations": iterations}
        values |= {name: place / name for name in ("out", "scene", "message", "scene_model", "message_model")}
        adapter.words("embed", **values)  # refuses before models are trained
        out = place / "out"
        public = out / "public"
        key = out / "key"
        public.mkdir(parents=True)
        key.mkdir()
        for name, capture in {"scene": pair.scene, "message": pair.message}.items():
            points = (capture.dataset.xyz, capture.dataset.rgb)
            write_colmap(place / name, capture.views, capture.images, points)
            if f"{{{name}_model}}" in adapter.commands["embed"]:
                begin = gaussians_at(*thinned(*points, max_gaussians, seed))
                model = capture.trained(begin, iterations, max_gaussians, seed, device)
                write_model(place / f"{name}_model/point_cloud/iteration_{iterations}/point_cloud.ply", model)
        adapter.run("embed", **values)
        for pattern in ("public/point_cloud.ply", "key/*"):
            if not any(out.glob(pattern)):
                raise InputError(adapter.source, "embed", expected=f"{pattern} in {{out}}", found="no such file")
        marked = base.read_public(public)
        if adapter.reads_key:
            return marked, FilesKey(adapter, key, stack.pop_all().close)
        return marked, base.read_key(key)


class FilesKey(Key):
    """A key that only the authors' programs read: a folder of files, with `MESSAGE_FILE` if it hides bits.

    `end` is called when the key is no longer used, to remove a temporary folder.
    """

    def __init__(self, adapter: Adapter, folder: Path, end: Callable[[], None] = lambda: None) -> None:
        self._adapter = adapter
        self._folder = folder.resolve()
        weakref.finalize(self, end)
        if "detect" in adapter.commands:
            file = folder / MESSAGE_FILE
            with reading(file, "bits, as a text of 0 and 1"):
                text = file.read_text().strip()
                if not text or {*text} - {*"01"}:
                    raise ValueError(text or "nothing")
            self.bits = np.array([*text]) == "1"

    def write(self, folder: Path) -> None:
        """Copy the files."""
        shutil.copytree(self._folder, folder, dirs_exist_ok=True)

    def readings(self, images: Path) -> list[Reading]:
        """Return what the authors' program reads from each PNG file of a folder."""
        words = self._adapter.words("detect", key=self._folder)
        return read_marks(shlex.join(words), images.resolve(), as_digits(self.bits), DAY, self._adapter.checkout)

    def message(self, public: PublicModel, extraction: str, device: Device | None = None) -> RenderView:
        """Return the renderer of the message, which runs the program for each view; `images` runs it once."""
        return lambda camera: next(self.images(public, extraction, [camera], device))

    def images(
        self,
        public: PublicModel,
        extraction: str,  # noqa: ARG002
        views: Sequence[Camera],
        device: Device | None = None,  # noqa: ARG002
    ) -> Iterator[Float32]:
        """Yield the image that the authors' program renders of each view."""
        with TemporaryDirectory(prefix="gspure-") as place:
            model = Path(place, "model")
            cameras = Path(place, "cameras")
            out = Path(place, "out")
            public.write(model / "point_cloud.ply")
            black = (np.zeros((view.height, view.width, 3), np.float32) for view in views)
            write_colmap(cameras, views, black, (public.model.means[:1].astype(np.float64), np.zeros((1, 3), np.uint8)))
            out.mkdir()
            self._adapter.run("extract", model=model, key=self._folder, cameras=cameras, out=out)
            for number, view in enumerate(views):
                yield self._extracted(out / f"{number:05d}.png", view)

    def _extracted(self, file: Path, view: Camera) -> Float32:
        """Return the image of a view that the program wrote, or raise `InputError` if its size is wrong."""
        shape = (view.height, view.width, 3)
        image = read_image(file) if file.is_file() else None
        if image is None or image.shape != shape:
            actual = "no such file" if image is None else str(image.shape)
            raise InputError(self._adapter.source, f"extract: {file.name}", expected=str(shape), found=actual)
        return image

    def wrong(self, rng: np.random.Generator) -> FilesKey:
        """Return the same files with other bits, or the files that the program `wrong` makes of them."""
        with ExitStack() as stack:
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="gspure-")))
            if len(self.bits):
                self.write(folder)
                bits = rng.integers(2, size=len(self.bits))
                (folder / MESSAGE_FILE).write_text("".join(map(str, bits)))
            else:
                self._adapter.run("wrong", key=self._folder, out=folder, seed=rng.integers(1 << 31))
            return FilesKey(self._adapter, folder, stack.pop_all().close)
