"""Splats in Splats: a hidden scene in the low bits and the opacities of a vanilla model (arXiv 2412.03121).

Embedding trains both scenes, maps the opacities, hides the colours and publishes. The paper leaves some choices open.
Ours: the loss is L(scene) + message_weight L(message), both as in 3DGS; means, quaternions and scales are shared; after
the opacity mapping is fitted, the hidden colours are trained further with the mapped opacities, which extraction uses
instead of the trained ones. The key is in two files::

    <key>/splats_in_splats.npz   the key proper: mapping, positions of the message's Gaussians, shift
    <key>/hidden.ply             all Gaussians with their exact hidden attributes: not for `message`
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from gspure.arrays import Float32, Kind, load_arrays, save_arrays
from gspure.errors import InputError
from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.model import Gaussians, read_model, write_model
from gspure.model.finite import require_computed, require_finite
from gspure.model.gaussians import CORE, LEAST_OPACITY, logit, sigmoid
from gspure.opencl.adam import LearningRates
from gspure.opencl.device import Device, choose_device
from gspure.opencl.storage import morton_order
from gspure.opencl.trainable import Parameters, TrainableModel, TrainState, TwinModel
from gspure.progress import say
from gspure.public_model import PublicModel, Rows
from gspure.schemes.hidden_weight import low_rows
from gspure.schemes.matching import adaptive_matches, exact_matches
from gspure.schemes.pair import Capture, Pair
from gspure.schemes.scheme import Key, Run, Scheme
from gspure.schemes.splats_in_splats import bits
from gspure.schemes.splats_in_splats.opacity_mapping import OpacityMapping, fit
from gspure.settings import Amount, MaxGaussians, Range, Steps
from gspure.training.densification import reset_opacities
from gspure.training.output import as_gaussians
from gspure.training.schedule import SH_DC_RATE, SH_REST_RATE, Schedule, shuffled
from gspure.training.trainer import densified, watched

ORACLE: Final = "message_oracle"

_FILE: Final = "splats_in_splats.npz"
_HIDDEN: Final = "hidden.ply"

OPACITY_THRESHOLD: Final = 0.25  # tau of the paper: the key holds the Gaussians whose opacity in the message is higher
REFINED: Final = 0.2  # iterations with the mapped opacities, as a share of those of the joint training; ours
REFINING: Final = LearningRates(0.0, 0.0, 0.0, 0.0, SH_DC_RATE, SH_REST_RATE)  # rates of `refined`: colours only
HELD_EVERY: Final = 10  # interval of the resets that keep the message off low rows, in iterations; ours


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 3000,
    message_weight: Amount = 1.0,
    max_gaussians: MaxGaussians = 30_000,
    shift: Annotated[int, Range(*bits.SHIFT_RANGE)] = bits.SHIFT,
    hardened: Amount = 0.0,
) -> tuple[PublicModel, SplatsInSplatsKey | None]:
    """Hide the pair's message in its scene; a message weight of 0 gives the scene's clean model, and no key.

    The joint training takes `iterations` steps; `message_weight` is the share of the message's loss, that of the scene
    is 1; `shift` is k of `gspure.schemes.splats_in_splats.bits`; `hardened` keeps the message off the rows that
    ``plain_weight`` removes with this tau, 0 trains as in the paper.
    """
    begin = pair.initial_gaussians(max_gaussians, seed)
    device = device or choose_device()
    if not message_weight:
        return PublicModel(pair.scene.trained(begin, iterations, max_gaussians, seed, device)), None
    run = TwinTrainer(Run(pair, iterations, message_weight, max_gaussians, seed, device, hardened), begin)
    for _ in watched(run, iterations, lambda: f"{run.model.models[0].count} Gaussians"):
        pass
    shown, hidden = (state.parameters for state in run.model.states())
    return _published(pair, shown, hidden, shift, round(REFINED * iterations), seed, device)


def _published(
    pair: Pair, shown: Parameters, hidden: Parameters, shift: int, steps: int, seed: int, device: Device
) -> tuple[PublicModel, SplatsInSplatsKey]:
    """Return the public model and its key."""
    known = np.flatnonzero(sigmoid(hidden.opacity_logits) > OPACITY_THRESHOLD)
    known = known[morton_order(hidden.means[known])]
    opacities = sigmoid(shown.opacity_logits)[known]
    mapping = fit(opacities, sigmoid(hidden.opacity_logits)[known], np.random.default_rng(seed))
    extracted = replace(hidden.rows(known), opacity_logits=logit(mapping(opacities), LEAST_OPACITY))
    colours = hidden.sh_coeffs.copy()
    colours[known] = refined(extracted, pair.message, steps, seed, device).sh_coeffs
    public = as_gaussians(replace(shown, sh_coeffs=bits.embed(shown.sh_coeffs, colours, shift)))
    say(f"{len(known)} of {len(shown)} Gaussians have an opacity above {OPACITY_THRESHOLD} in the message")
    return PublicModel(public), SplatsInSplatsKey(hidden.means[known], mapping, shift, as_gaussians(hidden))


class TwinTrainer:
    """A run; iterating over it trains and yields the loss of each iteration.

    The rules are those of 3DGS, but growth follows the gradient of the summed losses, and a Gaussian is pruned only if
    it is transparent in both scenes, so that some can serve the message alone.
    """

    def __init__(self, run: Run, begin: Parameters) -> None:
        state = TrainState.fresh(begin)
        self.model = TwinModel((state, state), run.message_weight, run.device)
        self.model.set_targets(run.pair.scene.images, run.pair.message.images)
        self._run, self._pair = run, run.pair
        self._schedule = Schedule.scaled(run.iterations)
        self._low = np.zeros(0, np.bool_)
        self._rng = np.random.default_rng(run.seed)

    def __iter__(self) -> Iterator[float]:
        iterations = range(1, self._schedule.iterations + 1)
        for iteration, batch in zip(iterations, self._pair.batches(self._rng), strict=False):
            for model in self.model.models:
                model.sh_degree_active = self._schedule.sh_degree(iteration)
            cameras = (self._pair.scene.views[batch[0]], self._pair.message.views[batch[1]])
            yield self.model.step(cameras, batch, self._schedule.rates(iteration, self._pair.extent))
            if self._schedule.densifies(iteration):
                self._densify(iteration)
            if self._run.hardened:
                self._harden(iteration)

    def _harden(self, iteration: int) -> None:
        """Take the message off the rows that `plain_weight` removes, measured at every interval of the densification.

        After it, hidden opacities that grow again are reset so often that the message moves to rows the scene needs.
        """
        measures = iteration % self._schedule.densify_every == 0 or iteration == self._schedule.iterations
        if not (measures or (iteration >= self._schedule.densify_until and iteration % HELD_EVERY == 0)):
            return
        shown, hidden = self.model.states()
        if measures:
            public = PublicModel(as_gaussians(shown.parameters))
            self._low = low_rows(public, self._pair.scene.views, self._run.hardened, self._run.device)
        self.model.replace((shown, reset_opacities(hidden, self._low)))

    def _densify(self, iteration: int) -> None:
        states = self.model.states()
        logits = np.maximum(*(state.parameters.opacity_logits for state in states))
        first, second = densified(
            *(states, self.model.models[0].statistics(), self._schedule, iteration),
            extent=self._pair.extent,
            rng=self._rng,
            max_gaussians=self._run.most_rows,
            opacities=sigmoid(logits),
        )
        self.model.replace((first, second))


def refined(parameters: Parameters, capture: Capture, steps: int, seed: int, device: Device | None) -> Parameters:
    """Return `parameters` with colours trained for their opacities; everything else is bit-identical."""
    model = TrainableModel(TrainState.fresh(parameters), device=device)
    model.set_targets(capture.images)
    order = shuffled(len(capture.views), np.random.default_rng(seed))
    for _ in range(steps):
        view = next(order)
        model.step(capture.views[view], view, REFINING)
    return replace(parameters, sh_coeffs=model.state().parameters.sh_coeffs)


@dataclass(frozen=True, eq=False)
class SplatsInSplatsKey(Key):
    """The private part of the scheme."""

    positions: Float32  # [I,3], the centres of the message's Gaussians, along a space-filling curve
    mapping: OpacityMapping  # from their public opacities, in this order, to their hidden ones
    shift: int  # k of `gspure.schemes.splats_in_splats.bits`
    hidden: Gaussians  # all, with their hidden opacity and colour

    def revealed(self, public: PublicModel, extraction: str) -> tuple[Gaussians, Rows]:
        """Return the Gaussians that show the message, and the row of each.

        ``message`` reads the model as the scheme does: colours from the bits and opacities from the mapping, for the
        Gaussians of the key. ``message_oracle`` gives each surviving Gaussian its exact hidden colour and opacity;
        ``message_adaptive`` also those that moved. All use the geometry of the model.
        """
        if extraction == ADAPTIVE:
            places = adaptive_matches(self.hidden, public.model)
        else:
            places = exact_matches(self.hidden.means if extraction == ORACLE else self.positions, public.model.means)
        rows = np.flatnonzero(places >= 0)
        survivors, places = public.model[rows], places[rows]
        if extraction == MESSAGE:
            sequence = np.zeros(len(self.positions), np.float32)  # the mapping reads opacity 0 where a row is missing
            sequence[places] = survivors.opacities
            opacities = logit(self.mapping(sequence)[places], LEAST_OPACITY)
            sh_coeffs = bits.extract(survivors.sh_coeffs_of(self.hidden.sh_degree), self.shift)
        else:
            opacities, sh_coeffs = self.hidden.table["opacity"][places], self.hidden.sh_coeffs[places]
        message = Gaussians(np.zeros(len(rows), self.hidden.table.dtype))
        message = message.with_columns({name: survivors.table[name] for name in CORE})
        message = message.with_appearance(opacities, sh_coeffs)
        require_computed(message, "key", _FILE)
        return message, rows

    def wrong(self, rng: np.random.Generator) -> SplatsInSplatsKey:
        """Return an untrained mapping and as many random Gaussians, with shuffled hidden attributes."""
        chosen = np.sort(rng.choice(len(self.hidden), len(self.positions), replace=False))
        order = rng.permutation(len(self.hidden))
        shuffled = self.hidden.with_appearance(self.hidden.table["opacity"][order], self.hidden.sh_coeffs[order])
        return SplatsInSplatsKey(self.hidden.means[chosen], OpacityMapping.fresh(rng), self.shift, shuffled)

    def write(self, folder: Path) -> None:
        """Write both files."""
        arrays = {"positions": self.positions, "shift": np.array(self.shift)}
        save_arrays(folder / _FILE, arrays | self.mapping.arrays)
        write_model(folder / _HIDDEN, self.hidden)

    @staticmethod
    def read(folder: Path) -> SplatsInSplatsKey:
        """Read a key, or raise `InputError`."""
        path, file = Path(folder) / _FILE, Path(folder) / _HIDDEN
        layers = OpacityMapping.fresh(np.random.default_rng(0)).arrays
        kinds: dict[str, Kind] = {name: (np.float32, layer.shape) for name, layer in layers.items()}
        kinds |= {"positions": (np.float32, (None, 3)), "shift": (np.integer, ())}
        arrays = load_arrays(path, kinds, "a key of Splats in Splats")
        positions, shift = arrays["positions"], int(arrays["shift"])
        Range(*bits.SHIFT_RANGE).require(path, "shift", shift)
        hidden = read_model(file)
        require_finite(hidden, file)
        if hidden.sh_degree < 0:
            raise InputError(file, "columns", expected="f_dc_0 to f_dc_2", found="no colours")
        return SplatsInSplatsKey(positions, OpacityMapping.of(arrays), shift, hidden)


GEOMETRY = ("x", "y", "z", "scale_*", "rot_*")
READS = {MESSAGE: (*GEOMETRY, "f_dc_*", "f_rest_*", "opacity"), ADAPTIVE: GEOMETRY, ORACLE: GEOMETRY}

SCHEME = Scheme("splats_in_splats", embed, PublicModel.read, SplatsInSplatsKey.read, READS)

HARDENED = replace(SCHEME, name="splats_in_splats_hardened", embed=partial(embed, hardened=2.0))
