"""The class of all attacks, built-in ones and those of plug-ins."""

import inspect
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from gspure import __version__
from gspure.arrays import Bools, Float32, Int32, load_array
from gspure.attacks.attacked import Attacked, Retouch, require
from gspure.attacks.strength import Damage, Match, Strength, search
from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.images import read_back
from gspure.method.clusters import read_labels
from gspure.model.finite import non_finite_rows
from gspure.model.gaussians import Gaussians
from gspure.opencl.device import Device
from gspure.progress import track
from gspure.public_model import Lesson, PublicModel
from gspure.settings import SEED, Setting, defaults, require_settings

Rng = np.random.Generator


@dataclass(frozen=True)
class Measurements:
    """An attacker's measurements of the public model, one number per row."""

    weights: Float32 | None = None  # ω_k [K]
    prune_mask: Bools | None = None  # GSPure's decision [K], true where a row is removed
    opacities: Float32 | None = None  # [K], 0 to 1: stored in Gaussians, computed by the networks for anchors
    surface: Float32 | None = None  # distances from the visible surface [K], in the row's own scales (`gspure.surface`)
    labels: Int32 | None = None  # GSPure's clusters [K], 0 .. M-1; -1 is noise

    @classmethod
    def read(cls, public: PublicModel, files: Mapping[str, Path]) -> Self:
        """Read measurements of a public model from files by name; opacities of Gaussians are in the model."""
        arrays: dict[str, Any] = {}
        if public.rows_are_gaussians:
            arrays["opacities"] = public.model.opacities
        for name, file in files.items():
            if name == "labels":
                arrays[name] = read_labels(file)
            else:
                dtype = np.bool_ if name == "prune_mask" else np.float32
                arrays[name] = load_array(file, dtype=dtype, shape=(len(public.model),), least=0)
        return cls(**arrays)


MEASUREMENTS: Final = frozenset(field.name for field in fields(Measurements))
PUBLIC: Final = frozenset({"columns", "public", "teacher"})
"""Parameters that need no measurement: `PublicModel.columns`, the columns of each attribute; its model; a `Teacher`."""

RESERVED: Final = PUBLIC | {"attack", "cameras", "damage", "decision", "device", "measurements", "public", "seed"}
"""Names that no setting may have: they are options of commands, configurations and `Attack.apply`."""

_IN_PYTHON: Final = {
    "weights": "gspure.purify(model, cameras).weights",
    "prune_mask": "gspure.purify(model, cameras).prune_mask",
    "labels": "gspure.purify(model, cameras).labels",
    "opacities": "public.opacities(cameras)",
    "surface": "gspure.surface.distances.depth_distances(public, cameras)",
}
"""How a program gets each measurement of a `PublicModel` and its Gaussians."""

LEARNED: Final = {
    "all": ("colour", "opacity", "scale", "rotation", "position"),
    "appearance": ("colour", "opacity"),
    "colour": ("colour",),
}
"""Trained attributes, by value of the setting `learn`."""


@dataclass(frozen=True)
class Teacher:
    """The renders of a public model at public cameras, to train other models on; errors name the `attack`."""

    attack: str
    public: PublicModel
    cameras: Sequence[Camera]  # without photographs
    device: Device | None
    retouch: Retouch = lambda image, _view: image

    @cached_property
    def images(self) -> list[Float32]:
        """Its renders, as 8-bit images show them, retouched."""
        if not self.cameras:
            raise InputError(f"attack {self.attack}", "cameras", expected="public views", found="none")
        scene = self.public.scene(self.device, self.public.model.background)
        cameras = track(self.cameras, "renders to learn")
        return [self.retouch(read_back(scene(camera)), camera.name) for camera in cameras]

    def train(self, student: PublicModel, rng: Rng, iterations: int, learn: str, rate_factor: float = 1.0) -> Gaussians:
        """Return the rows of `student` after training the attributes that `learn` names."""
        require(self.attack, "learn", learn, f"one of {', '.join(LEARNED)}", fits=learn in LEARNED)
        lesson = Lesson(
            self.cameras,
            self.images,
            LEARNED[learn],
            steps=iterations,
            rng=rng,
            rate_factor=rate_factor,
            device=self.device,
            background=self.public.model.background,
        )
        return student.learned(lesson).model


@dataclass(frozen=True)
class Attack:
    """An attack on the public model of any scheme.

    Parameters
    ----------
    name : str
        Unique; the name of its variant in every table.
    function : callable
        ``function(model, rng, [weights, ...], *, setting=default, ...) -> Attacked``: pure and deterministic. Its
        positional parameters name what it needs, fields of `Measurements` or of `PUBLIC`; its keyword-only parameters
        are its settings, numbers annotated with their bounds (`gspure.settings`).
    packages : mapping of str to str
        Optional packages that it imports, each with the requirement that pip installs.
    strength : Strength, optional
        The setting that is searched for a given damage to the scene.
    of_renders : bool
        Whether it attacks renders of the scene, not the model: ``function(image, rng, *, ...)`` returns an image of the
        size of `image` [H,W,3], 0 to 1.

    """

    name: str
    function: Callable[..., Any]
    packages: Mapping[str, str] = field(default_factory=dict)
    strength: Strength | None = None
    of_renders: bool = False

    def __post_init__(self) -> None:
        """Refuse settings with `RESERVED` names."""
        for name in sorted(RESERVED & self.settings.keys()):
            expected = "a name that is not reserved"
            raise InputError(f"attack {self.name}", "setting", expected=expected, found=name, hint="rename it")

    @property
    def needs(self) -> frozenset[str]:
        """The measurements that it needs: fields of `Measurements`."""
        return self.parameters - PUBLIC

    @property
    def parameters(self) -> frozenset[str]:
        """Names of the positional parameters after the model and the random numbers."""
        parameters = list(inspect.signature(self.function).parameters.values())[2:]
        return frozenset(p.name for p in parameters if p.kind is not p.KEYWORD_ONLY)

    @property
    def settings(self) -> dict[str, Setting]:
        """Its settings and their defaults."""
        return defaults(self.function)

    def kind(self, settings: Mapping[str, object]) -> list[str]:
        """Return the parts that variants of one sweep share: sweep name, changed settings that are texts, and seed."""
        texts = {name: default for name, default in self.settings.items() if isinstance(default, str)}
        changed = [str(settings[name]) for name, default in texts.items() if settings.get(name, default) != default]
        sweep = (self.strength and self.strength.sweep) or self.name
        parts = [sweep, *changed]
        if settings.get("seed"):
            parts.append(f"seed {settings['seed']}")
        return parts

    def apply(
        self,
        public: PublicModel | Gaussians,
        measurements: Measurements = Measurements(),
        *,
        seed: int = 0,
        cameras: Sequence[Camera] = (),
        device: Device | None = None,
        **settings: Setting,
    ) -> Attacked:
        """Attack a public model; a comment line of the attacked model names attack, settings and seed.

        Bare Gaussians are vanilla 3DGS. `measurements` include at least the attack's `needs`; `cameras` are public
        views.

        Raise `InputError` if a setting is unknown or out of range, a measurement is missing or of another model, or
        finite numbers become infinite; `NotApplicable` if the attack has nothing to act on in the model.
        """
        require_settings(f"attack {self.name}", self.function, settings)
        SEED.require(f"attack {self.name}", "seed", seed)
        public = public if isinstance(public, PublicModel) else PublicModel(public)
        model = public.model
        if self.of_renders:
            retouched = partial(self.retouched, seed=seed, settings=settings)
            return Attacked(model, np.arange(len(model)), len(model), retouched=retouched)
        teacher = Teacher(self.name, public, [replace(camera, image=None) for camera in cameras], device)
        available: dict[str, Any] = {"columns": public.columns, "public": public, "teacher": teacher}
        available |= {name: self._measured(name, measurements, len(model)) for name in sorted(self.needs)}
        arguments = {name: available[name] for name in self.parameters}
        with np.errstate(all="ignore"):  # numbers that overflow are refused below
            attacked: Attacked = self.function(model, np.random.default_rng(seed), **arguments, **settings)
        all_settings = {**self.settings, **settings, "seed": seed}
        description = " ".join(f"{name}={value}" for name, value in all_settings.items())
        self._require_valid(attacked, model, description)
        if attacked.model is model:
            return attacked
        comment = f"gspure {__version__} attack {self.name} {description}"
        return replace(attacked, model=attacked.model.with_comment(comment))

    def retouched(self, image: Float32, view: str, *, seed: int, settings: Mapping[str, Setting]) -> Float32:
        """Return a render [H,W,3] of a view after an attack on renders; random numbers depend on seed and view."""
        rng = np.random.default_rng([seed, zlib.crc32(view.encode())])
        return read_back(self.function(image, rng, **settings))

    def matching(
        self, public: PublicModel, measurements: Measurements, wanted: float, damage_of: Damage, **arguments: Any
    ) -> Match:
        """Return the strength whose damage is nearest to `wanted` dB, by `search`.

        `damage_of` comes from `gspure.attacks.strength.scene_damage`; `arguments` are those of `apply`, without the
        strength.
        """
        strength = self.strength
        if strength is None or strength.setting in arguments:
            expected = f"no {strength.setting}, since a damage is given" if strength else "an attack with a strength"
            raise InputError(f"attack {self.name}", "damage", expected=expected, found="one" if strength else "none")

        def damage_at(value: float) -> float:
            attacked = self.apply(public, measurements, **{**arguments, strength.setting: value})
            if not len(attacked.model):
                return np.inf
            return damage_of(public.with_model(attacked.model), attacked.transform, attacked.retouched)

        return search(strength, damage_at, wanted)

    def _require_valid(self, attacked: Attacked, before: Gaussians, settings: str) -> None:
        """Refuse indices outside the model `before`, and new infinities and not-a-numbers; name the `settings`."""
        source = f"attack {self.name}"
        after = attacked.model
        rows = attacked.rows
        if rows.shape != (len(after),) or not ((rows >= -1) & (rows < len(before))).all():
            expected = f"[{len(after)}] indices of {len(before)} rows"
            raise InputError(source, "rows", expected=expected, found=f"{list(rows.shape)} others")
        for name, changed in non_finite_rows(after, sorted({*before.names} & {*after.names})).items():
            bad = changed[np.isfinite(before.table[name][rows[changed]])]
            if len(bad):
                count = f"infinity or not-a-number in {len(bad)} of {len(rows)} rows, first in row {bad[0]}"
                raise InputError(source, name, expected="finite numbers", found=count, hint=settings)

    def _measured(self, name: str, measurements: Measurements, count: int) -> NDArray[Any]:
        """Return a measurement [K], or refuse it: a mask of integers, for example, would index rows."""
        array: NDArray[Any] | None = getattr(measurements, name)
        if array is None or array.shape != (count,) or (array.dtype == np.bool_) != (name == "prune_mask"):
            expected = f"[{count}] {'bool' if name == 'prune_mask' else 'numbers'}, one per row"
            actual = "nothing" if array is None else f"{list(array.shape)} {array.dtype}"
            raise InputError(f"attack {self.name}", name, expected=expected, found=actual, hint=_remedy(name))
        return array


def _remedy(name: str) -> str:
    """Return how to get a measurement, on the command line and in Python."""
    program = _IN_PYTHON[name]
    option = f"--{name.replace('_', '-')}"
    if program.startswith("gspure.purify"):
        command = f"run `gspure purify MODEL --cameras CAMERAS --out purified`, then pass {option} purified/{name}.npy"
    else:
        command = f"run `gspure audit MODEL`, then pass {option} and the {name}.npy below results/"
    return f"{command}; in Python, Measurements({name}={program})"


def named(functions: Mapping[Callable[..., Attacked], Strength | None]) -> tuple[Attack, ...]:
    """Return functions, each with its strength, as attacks of the same names."""
    return tuple(Attack(function.__name__, function, strength=strength) for function, strength in functions.items())
