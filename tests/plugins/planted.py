"""Planted: Gaussians at the points of a message with next to no opacity; a scheme with known ground truth, for tests.

Nothing is trained. Public rows stand at the points of both captures, in random order; only opacity distinguishes those
of the message.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from gspure.evaluation.collecting import MESSAGE_ROWS
from gspure.files import Kind, load_array, load_arrays, save_array, save_arrays
from gspure.model import Gaussians
from gspure.model.activations import logit
from gspure.public_model import PublicModel
from gspure.renderer import Renderer
from gspure.schemes.scheme import MESSAGE, Key, Scheme
from gspure.settings import Range
from gspure.training.initialization import gaussians_at, thinned

SOLID: Final = (0.9, 0.98)  # range of the opacity of the scene's rows, and of the message's for the owner
FAINT: Final = (0.01, 0.4)  # of a few rows of the scene
FAINT_SHARE: Final = 0.05
HIDDEN: Final = (0.002, 0.02)  # of the message's rows, even in the logarithm

_FILE: Final = "planted.npz"
_ARRAYS: Final[dict[str, Kind]] = {
    "positions": (np.float32, (None, 3)),
    "opacity": (np.float32, (None,)),
    "f_dc": (np.float32, (None, 3)),
}


def embed(
    pair,
    seed,
    device=None,
    *,
    message_weight: Annotated[int, Range(0, 1)] = 1,
    gaussians: Annotated[int, Range(100, 10_000_000)] = 4000,
):
    """Plant the pair's message in its scene, with at most `gaussians` rows, about half of them the message's."""
    rng = np.random.default_rng(seed)
    clouds = [(c.dataset.xyz, c.dataset.rgb) for c in (pair.scene, pair.message)]
    shown, hidden = (
        Gaussians.from_stored(**vars(gaussians_at(*thinned(*cloud, gaussians // 2, seed)))) for cloud in clouds
    )
    opacities = np.where(
        rng.random(len(shown)) < FAINT_SHARE, _even(FAINT, shown, rng), rng.uniform(*SOLID, len(shown))
    )
    shown = shown.with_columns({"opacity": logit(opacities)})
    if not message_weight:
        return PublicModel(Gaussians(shown.table[rng.permutation(len(shown))])), None
    colours = shown.sh_coeffs[rng.integers(len(shown), size=len(hidden))]
    disguised = hidden.with_appearance(logit(_even(HIDDEN, hidden, rng)), colours)
    order = rng.permutation(len(shown) + len(hidden))
    public = Gaussians(np.concatenate([shown.table, disguised.table])[order]).with_comment("planted message: a fixture")
    carried = order[order >= len(shown)] - len(shown)
    private = logit(rng.uniform(*SOLID, len(hidden)))[carried].astype(np.float32)
    return PublicModel(public), PlantedKey(order >= len(shown), public.means, private, hidden.sh_coeffs[carried, 0])


def _even(bounds, rows, rng):
    low, high = bounds
    return low * (high / low) ** rng.random(len(rows))


@dataclass(frozen=True, eq=False)
class PlantedKey(Key):
    """What is private of the M rows that carry a message."""

    message_rows: np.ndarray  # bool [K], true where a row of the public model carries the message
    positions: np.ndarray  # [K,3] of all rows, by which an attacked model is matched
    opacity: np.ndarray  # [M], the private logit
    f_dc: np.ndarray  # [M,3], the private zeroth coefficient

    def message(self, public, extraction, device=None):
        return Renderer(self._revealed(public)[0], device).image

    def gaussians(self, public, camera, extraction):
        return self._revealed(public)

    def wrong(self, rng):
        """Return a key to as many other rows, with the private values in another order."""
        order = rng.permutation(len(self.opacity))
        return PlantedKey(rng.permutation(self.message_rows), self.positions, self.opacity[order], self.f_dc[order])

    def write(self, folder):
        save_array(folder / MESSAGE_ROWS, self.message_rows)
        save_arrays(folder / _FILE, {name: getattr(self, name) for name in _ARRAYS})

    @staticmethod
    def read(folder):
        arrays = load_arrays(Path(folder) / _FILE, _ARRAYS, "a key to a planted message")
        message_rows = load_array(Path(folder) / MESSAGE_ROWS, dtype=np.bool_, shape=(len(arrays["positions"]),))
        return PlantedKey(message_rows, **{name: arrays[name] for name in _ARRAYS})

    def _revealed(self, public):
        """Return the rows whose position is, bit for bit, that of one that carries the message, and their indices."""
        known = {position.tobytes(): i for i, position in enumerate(self.positions[self.message_rows])}
        places = np.array([known.get(position.tobytes(), -1) for position in public.model.means], np.intp)
        rows = np.flatnonzero(places >= 0)
        survivors, places = public.model[places >= 0], places[rows]
        columns = {name: np.zeros(len(rows), np.float32) for name in survivors.columns_named("f_rest_")}
        columns |= {f"f_dc_{i}": self.f_dc[places, i] for i in range(3)}
        return survivors.with_columns(columns | {"opacity": self.opacity[places]}), rows


SCHEME = Scheme("planted", embed, PublicModel.read, PlantedKey.read, {MESSAGE: ("x", "y", "z", "scale_*", "rot_*")})
