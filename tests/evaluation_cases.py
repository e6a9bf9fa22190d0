"""A plug-in with a scheme, its twins that hide bits, and an attack; and a folder with a model of theirs to evaluate.

*Lantern* shows the rows at centres that its owner keeps, in a colour that nobody sees in the public model.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import pytest

from gspure import Plugin
from gspure.arrays import Bools, Float32
from gspure.attacks import Attack, Attacked
from gspure.cameras import write_cameras
from gspure.cameras.camera import Camera, rigid
from gspure.evaluation.evaluate import Evaluation, evaluate, write
from gspure.evaluation.identity import ModelId
from gspure.evaluation.plan import AttackSpec, Control, Job, Owner, Views
from gspure.images import png_files, read_back, read_image, write_image
from gspure.metrics.targets import ADAPTIVE, BITS, MESSAGE, MODEL_BITS, SCENE
from gspure.model import Gaussians
from gspure.model.ply import write_point_ply
from gspure.public_model import Columns, Lesson, PublicModel, Rows
from gspure.renderer import Renderer
from gspure.schemes.scheme import Key, Scheme
from tests.models import blobs, tilted_camera
from tests.plugin_path import write_info

ROWS = 60
MESSAGE_ROWS = slice(0, 20)
SHOWN = {MESSAGE: 15, ADAPTIVE: 20}  # number of these rows that each extraction shows
NEAR = 1e-4  # distance of a row from the centre that it had
WIDTH, HEIGHT = 32, 24
TESTED = ("view_0", "view_8")  # of nine views, those that are held out
EMBEDDED = np.array([True, False, True, True])


class LanternModel(PublicModel):
    """Gaussians whose opacity no attack may change."""

    attributes: ClassVar[Columns] = {
        name: columns for name, columns in PublicModel.attributes.items() if name != "opacity"
    }


@dataclass(frozen=True, eq=False)
class LanternKey(Key):
    """The centres [M,3] of the rows that show the message, their colour [3], and the bits [N] of the twin."""

    means: Float32
    colour: Float32
    bits: Bools = field(default_factory=EMBEDDED.copy)

    def revealed(self, public: PublicModel, extraction: str) -> tuple[Gaussians, Rows]:
        known = self.means[: SHOWN[extraction]]
        distances = np.linalg.norm(public.model.means[:, None] - known, axis=2)
        rows = np.flatnonzero(distances.min(axis=1) < NEAR)
        sh_coeffs = np.zeros_like(public.model.sh_coeffs[rows])
        sh_coeffs[:, 0] = self.colour
        return public.model[rows].with_appearance(np.full(len(rows), 4.0), sh_coeffs), rows

    def fitted(self, public: PublicModel, lesson: Lesson) -> Self:
        """Learn the mean colour of the photographs."""
        return replace(self, colour=np.mean(lesson.images, axis=(0, 1, 2)))

    def read_bits(self, image: Float32) -> Bools:
        """Every image that is not black shows the embedded bits."""
        return EMBEDDED if image.any() else np.zeros_like(EMBEDDED)

    def read_model_bits(self, public: PublicModel) -> Bools:
        """Each of four rows holds a bit, inverted if its colour has changed."""
        changed: Bools = public.model.table["f_dc_0"][:4] != public_rows().table["f_dc_0"][:4]
        return EMBEDDED ^ changed

    def wrong(self, rng: np.random.Generator) -> Self:
        return replace(self, means=rng.permuted(self.means, axis=0), bits=~self.bits)

    def write(self, folder: Path) -> None:
        (folder / "lantern").touch()

    @staticmethod
    def read(folder: Path) -> "LanternKey":
        """Return the key of the tests, whatever was written."""
        return lantern_key()


def embed(pair: Any, seed: int, device: Any = None, *, message_weight: int = 1) -> tuple[PublicModel, Key | None]:
    """Return the model and the key of the tests, whatever the pair."""
    return LanternModel(public_rows()), lantern_key()


def convert(model: Gaussians, _rng: np.random.Generator) -> Attacked:
    """Store the model as another format."""
    return Attacked(model, np.arange(len(model)), len(model), removed="no key reads this format")


LANTERN = Scheme(
    "lantern",
    embed,
    LanternModel.read,
    LanternKey.read,
    {MESSAGE: ("x", "y", "z", "scale_*", "rot_*"), ADAPTIVE: ("f_dc_*",)},
    carriers=("x", "y", "z"),
    fits=True,
)
BLINKER = replace(LANTERN, name="blinker", extractions={BITS: ("f_dc_*",)}, fits=False)
ETCHED = replace(BLINKER, name="etched", extractions={MODEL_BITS: ("f_dc_0",)})
ADDED = Plugin(attacks=(Attack("convert", convert),), schemes=(LANTERN, BLINKER, ETCHED))
PLUGIN = {
    "name": "gspure-lantern",
    "version": "1.0",
    "entry-points": {"gspure": {"lantern": f"{__name__}:ADDED"}},
}


def public_rows() -> Gaussians:
    return blobs(ROWS, sh_degree=1)


def lantern_key() -> LanternKey:
    return LanternKey(public_rows().means[MESSAGE_ROWS], np.array([1.5, -1.0, 0.5], np.float32))


PUBLIC = Path("public/point_cloud.ply")
KEY = Path("key")
CAMERAS = Path("cameras.json")
PHOTOGRAPHED = Path("photographs/cameras.json")  # the same views, with photographs that are near the renders
MESSAGE_CAMERAS = Path("message/cameras.json")  # the same views of a message that is green all over
UNATTACKED = Path("results/lantern/room/unattacked/renders")


@contextmanager
def project(folder: Path) -> Iterator[Path]:
    """Install the plug-in, and make a folder with models, key and cameras the current one."""
    with pytest.MonkeyPatch.context() as patch:
        write_info(PLUGIN, folder / "installed")
        patch.syspath_prepend(str(folder / "installed"))
        patch.chdir(folder)
        LanternModel(public_rows()).write(PUBLIC)
        KEY.mkdir()
        lantern_key().write(KEY)
        write_cameras(CAMERAS, views())
        for view in views():
            write_image(photograph_of(PHOTOGRAPHED, view), photograph(view))
            write_image(photograph_of(MESSAGE_CAMERAS, view), green())
        for file in (PHOTOGRAPHED, MESSAGE_CAMERAS):
            write_cameras(file, [replace(view, image=photograph_of(file, view).absolute()) for view in views()])
        write_point_ply(MESSAGE_CAMERAS.with_name("points3D.ply"), public_rows().means, np.zeros((ROWS, 3), np.uint8))
        yield folder


def views() -> list[Camera]:
    """Nine views from places beside each other."""
    first = tilted_camera(WIDTH, HEIGHT, focal=24.0, name="view")
    shifts = [rigid(np.eye(3), np.array([i / 10, 0.0, 0.0])) for i in range(9)]
    return [replace(first.moved(shift), name=f"view_{i}") for i, shift in enumerate(shifts)]


def photograph_of(cameras: Path, view: Camera) -> Path:
    return cameras.with_name(f"{view.name}.png")


def photograph(view: Camera) -> Float32:
    """The render, with noise."""
    render = Renderer(public_rows()).image(view)
    return render + np.random.default_rng(0).normal(0, 0.05, render.shape).astype(np.float32)


def green() -> Float32:
    return np.broadcast_to(np.array([0.0, 1.0, 0.0], np.float32), (HEIGHT, WIDTH, 3))


def owner(scheme: str = "lantern", **settings: Any) -> Owner:
    bits = {"blinker": (BITS,), "etched": (MODEL_BITS,)}
    return Owner(scheme, KEY, CAMERAS, bits.get(scheme, ()), **settings)


def job(variant: str, case: AttackSpec | Control, *, targets: Sequence[str] = (SCENE, MESSAGE), **settings: Any) -> Job:
    """The evaluation of a marked model, compared with its unattacked renders, in the held-out views."""
    defaults = {
        "public": PUBLIC,
        "views": Views(CAMERAS, "test", UNATTACKED),
        "owner": owner(),
        "rendered": tuple(targets),
        "compared": tuple(targets),
    }
    return Job(ModelId("lantern", "room"), variant, case=case, **{**defaults, **settings})


def attack_job(variant: str, name: str, *, attack: Any = None, **settings: Any) -> Job:
    """The job of an attack with the settings `attack`."""
    return job(variant, AttackSpec(name, settings=attack or {}), **settings)


def run(planned: Job) -> Evaluation:
    evaluation = evaluate(planned)
    write(planned, evaluation)
    return evaluation


def renders(planned: Job, target: str) -> dict[str, Float32]:
    """The images of a target by view."""
    return {file.stem: read_image(file) for file in png_files(planned.folder / "renders" / target)}


def drawn(model: Gaussians, names: Sequence[str] = TESTED) -> dict[str, Float32]:
    """What a model shows in views, as its images hold it."""
    image = Renderer(model).image
    return {view.name: read_back(image(view)) for view in views() if view.name in names}
