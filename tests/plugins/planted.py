"""Planted: Gaussians at the points of a message with next to no opacity; a scheme with known ground truth, for tests.

Nothing is trained. Public rows stand at the points of both captures, in random order; only opacity distinguishes those
of the message.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from gspure import Plugin
from gspure.arrays import load_array, load_arrays, save_array, save_arrays
from gspure.cameras import Camera
from gspure.metrics.targets import MESSAGE
from gspure.model import Gaussians
from gspure.model.gaussians import logit
from gspure.opencl.device import Device
from gspure.public_model import PublicModel, RenderView, Rows
from gspure.renderer import Renderer
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import Key, Scheme
from gspure.settings import Range
from gspure.training.initialization import gaussians_at, thinned

SOLID, HIDDEN = (0.9, 0.98), (0.002, 0.02)  # ranges of opacities: of the scene, and of the message in public
ROWS = "message_rows.npy"
ARRAYS = {"means": (np.float32, (None, 3)), "opacity": (np.float32, (None,)), "f_dc": (np.float32, (None, 3))}


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    message_weight: Annotated[int, Range(0, 1)] = 1,
    gaussians: Annotated[int, Range(100, 10_000_000)] = 4000,
) -> tuple[PublicModel, "PlantedKey | None"]:
    """Plant the pair's message in its scene, with at most `gaussians` rows, about half of them the message's."""
    rng = np.random.default_rng(seed)
    clouds = [(c.dataset.xyz, c.dataset.rgb) for c in (pair.scene, pair.message)]
    shown, hidden = (
        Gaussians.from_stored(**vars(gaussians_at(*thinned(*cloud, gaussians // 2, seed)))) for cloud in clouds
    )
    shown = shown.with_columns({"opacity": logit(rng.uniform(*SOLID, len(shown)))})
    if not message_weight:
        return PublicModel(Gaussians(shown.table[rng.permutation(len(shown))])), None
    colours = shown.sh_coeffs[rng.integers(len(shown), size=len(hidden))]
    disguised = hidden.with_appearance(logit(rng.uniform(*HIDDEN, len(hidden))), colours)
    order = rng.permutation(len(shown) + len(hidden))
    public = Gaussians(np.concatenate([shown.table, disguised.table])[order])
    carried = order[order >= len(shown)] - len(shown)
    private = logit(rng.uniform(*SOLID, len(hidden)))[carried].astype(np.float32)
    return PublicModel(public), PlantedKey(order >= len(shown), public.means, private, hidden.sh_coeffs[carried, 0])


@dataclass(frozen=True, eq=False)
class PlantedKey(Key):
    """What is private of the M rows that carry a message."""

    message_rows: np.ndarray  # bool [K], true where a row of the public model carries the message
    means: np.ndarray  # [K,3] of all rows, by which an attacked model is matched
    opacity: np.ndarray  # [M], the private logit
    f_dc: np.ndarray  # [M,3], the private zeroth coefficient

    def message(self, public: PublicModel, extraction: str, device: Device | None = None) -> RenderView:
        return Renderer(self.gaussians(public, None, extraction)[0], device).image

    def gaussians(self, public: PublicModel, camera: Camera | None, extraction: str) -> tuple[Gaussians, Rows]:
        """Return the rows whose position is, bit for bit, that of one that carries the message, and their indices."""
        known = {mean.tobytes(): i for i, mean in enumerate(self.means[self.message_rows])}
        places = np.array([known.get(mean.tobytes(), -1) for mean in public.model.means], np.intp)
        rows = np.flatnonzero(places >= 0)
        revealed, places = public.model[places >= 0], places[rows]
        columns = {name: np.zeros(len(rows), np.float32) for name in revealed.columns_named("f_rest_")}
        columns |= {f"f_dc_{i}": self.f_dc[places, i] for i in range(3)}
        return revealed.with_columns(columns | {"opacity": self.opacity[places]}), rows

    def wrong(self, rng: np.random.Generator) -> "PlantedKey":
        """Return a key to as many other rows, with the private values in another order."""
        order = rng.permutation(len(self.opacity))
        return PlantedKey(rng.permutation(self.message_rows), self.means, self.opacity[order], self.f_dc[order])

    def write(self, folder: Path) -> None:
        save_array(folder / ROWS, self.message_rows)
        save_arrays(folder / "planted.npz", {name: getattr(self, name) for name in ARRAYS})

    @staticmethod
    def read(folder: Path) -> "PlantedKey":
        arrays = load_arrays(Path(folder) / "planted.npz", ARRAYS, "a key to a planted message")
        message_rows = load_array(Path(folder) / ROWS, dtype=np.bool_, shape=(len(arrays["means"]),))
        return PlantedKey(message_rows, **{name: arrays[name] for name in ARRAYS})


SCHEME = Scheme("planted", embed, PublicModel.read, PlantedKey.read, {MESSAGE: ("x", "y", "z", "scale_*", "rot_*")})
PLUGIN = Plugin(schemes=(SCHEME,), detectors={"green": "python3 green.py"})
