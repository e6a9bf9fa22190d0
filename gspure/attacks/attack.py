"""The class of all attacks, built-in ones and those of plug-ins."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from gspure import __version__
from gspure.attacks.strength import Damage, Match, Strength, search
from gspure.cameras.camera import Camera, require_rigid
from gspure.errors import InputError
from gspure.files import Bools, Float32, Float64, Indices, Int32
from gspure.model.finite import non_finite_rows
from gspure.model.gaussians import Gaussians
from gspure.opencl.device import Device
from gspure.progress import Described
from gspure.public_model import Columns, PublicModel
from gspure.settings import SEED, Setting, defaults, require_settings

Rows = Indices
Rng = np.random.Generator


class NotApplicable(InputError):  # noqa: N818
    """An attack has nothing to act on in a model, or leaves nothing of it: an outcome, not a mistake."""

    def __init__(self, attack: str, reason: str) -> None:
        self.attack, self.reason = attack, reason
        super().__init__(f"attack {attack}", "model", expected="one that it applies to", found=reason)

    def __str__(self) -> str:
        return f"{self.source}: not applicable: {self.reason}"

    def __reduce__(self) -> tuple[Any, tuple[str, str]]:
        return type(self), (self.attack, self.reason)


@dataclass(frozen=True)
class Evidence:
    """What an attacker has measured on the public model.

    Parameters
    ----------
    weights : array [K], float32, optional
        Weights ω_k.
    prune_mask : array [K], bool, optional
        GSPure's decision, true where pruned.
    opacities : array [K], float32, optional
        Opacity of each row, 0 to 1: stored in a Gaussian, computed by the networks for an anchor.
    surface : array [K], float32, optional
        Distance of each row from the visible surface, in units of the row's scales (`gspure.surface`).
    labels : array [K], int32, optional
        GSPure's clusters 0 .. M-1; -1 is noise.

    """

    weights: Float32 | None = None
    prune_mask: Bools | None = None
    opacities: Float32 | None = None
    surface: Float32 | None = None
    labels: Int32 | None = None


EVIDENCE: Final = frozenset(field.name for field in fields(Evidence))
PUBLIC: Final = frozenset({"columns", "public", "cameras", "device"})
"""Parameters that any attack may have without a measurement: the columns that the scheme declares for each attribute
(`PublicModel.columns`), the public model with the files beside it, its cameras without photographs, and a device."""


RESERVED: Final = PUBLIC | {"attack", "damage", "decision", "evidence", "seed"}
"""Names that settings must not have: options of commands, configurations and `Attack.apply`."""

NO_EVIDENCE: Final = Evidence()


@dataclass(frozen=True, eq=False, repr=False)
class Attacked(Described):
    """An attacked model and the origin of its rows.

    Parameters
    ----------
    model : Gaussians
        K' rows.
    rows : array [K'], int
        Index of the row of the public model that each row is, or was copied from; -1 if it is new.
    count : int
        Number K of rows of the public model.
    transform : array [4,4], optional
        Rigid transform applied to the whole model; views move with it (`gspure.cameras.camera.Camera.moved`).

    """

    model: Gaussians
    rows: Rows
    count: int
    transform: Float64 | None = None

    @property
    def facts(self) -> dict[str, str]:
        """How many rows remain."""
        return {
            "rows": f"{len(self.model):,}",
            "kept": f"{self.count - int(self.prune_mask.sum()):,} of {self.count:,}",
        }

    @property
    def prune_mask(self) -> Bools:
        """True where a row of the public model [K] was removed; the order and copies of the others do not matter."""
        mask = np.ones(self.count, np.bool_)
        mask[self.rows[self.rows >= 0]] = False
        return mask

    @classmethod
    def without(cls, model: Gaussians, prune_mask: Bools) -> Self:
        """Return `model` without the rows where `prune_mask` [K] is true."""
        return cls(model[~prune_mask], np.flatnonzero(~prune_mask), len(model))

    @classmethod
    def changed(cls, model: Gaussians, values: Mapping[str, NDArray[Any]], transform: Float64 | None = None) -> Self:
        """Return `model` with new `values` (each [K]) in the named columns."""
        return cls(model.with_columns(values), np.arange(len(model)), len(model), transform)

    @classmethod
    def copied(cls, model: Gaussians, rows: Rows, values: Mapping[str, NDArray[Any]] | None = None) -> Self:
        """Return copies of the given `rows` [K'] of `model`, with new `values` (each [K']) in the named columns."""
        return cls(Gaussians(model.table[rows], model.comments).with_columns(values or {}), rows, len(model))


@dataclass(frozen=True)
class Attack:
    """An attack on the public model of any scheme.

    Parameters
    ----------
    name : str
        Unique; the name of its variant in every table.
    function : callable
        ``function(model, rng, [evidence, ...], *, setting=default, ...) -> Attacked``: pure and deterministic. Its
        positional parameters name the evidence that it needs (fields of `Evidence`, or of `PUBLIC`); its keyword-only
        parameters are its settings, numbers annotated with their bounds (`gspure.settings`).
    packages : mapping of str to str
        Optional packages that it imports, each with the requirement that pip installs.
    strength : Strength, optional
        The setting that is searched for a given damage to the scene.
    sweep : str
        Name of the attack whose sweep includes its strengths, by default its own name.

    """

    name: str
    function: Callable[..., Attacked]
    packages: Mapping[str, str] = field(default_factory=dict)
    strength: Strength | None = None
    sweep: str = ""

    def __post_init__(self) -> None:
        """Check that the strength is a setting, and that no setting has the name of something else."""
        for name in sorted(RESERVED & self.settings.keys()):
            expected = "a name that is not reserved"
            raise InputError(f"attack {self.name}", "setting", expected=expected, found=name, hint="rename it")
        if self.strength and self.strength.setting not in self.settings:
            expected = " or ".join(self.settings) or "none"
            raise InputError(f"attack {self.name}", "strength", expected=expected, found=self.strength.setting)

    @property
    def needs(self) -> frozenset[str]:
        """The measured evidence that it needs: fields of `Evidence`."""
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
        """Return what its variants in one sweep share: its name, all settings that are texts, and the random seed."""
        texts = {name: default for name, default in self.settings.items() if isinstance(default, str)}
        changed = [str(settings[name]) for name, default in texts.items() if settings.get(name, default) != default]
        return [self.sweep or self.name, *changed, *([f"seed {settings['seed']}"] if settings.get("seed") else [])]

    def apply(
        self,
        public: PublicModel | Gaussians,
        evidence: Evidence = NO_EVIDENCE,
        *,
        seed: int = 0,
        cameras: Sequence[Camera] = (),
        device: Device | None = None,
        **settings: Setting,
    ) -> Attacked:
        """Attack a public model; a comment line of the attacked model names attack, settings and seed.

        Parameters
        ----------
        public : PublicModel or Gaussians
            The public model; bare Gaussians are vanilla 3DGS.
        evidence : Evidence
            Includes at least what the attack needs.
        seed : int
            Random seed, of `numpy.random.default_rng`.
        cameras : sequence of Camera
            Public views; the attack gets them without their photographs.
        device : Device, optional
            For attacks that render.
        **settings : float, int or str
            Any of `self.settings`.

        Raises
        ------
        InputError
            A setting is unknown or out of range, evidence is missing or of another model, or finite numbers become
            infinite.
        NotApplicable
            The model has nothing that the attack acts on.

        """
        require_settings(f"attack {self.name}", self.function, settings)
        SEED.require(f"attack {self.name}", "seed", seed)
        public = public if isinstance(public, PublicModel) else PublicModel(public)
        model = public.model
        arguments: dict[str, Any] = {name: self._evidence(name, evidence, len(model)) for name in self.needs}
        public_arguments = {
            "columns": public.columns,
            "public": public,
            "cameras": [replace(camera, image=None) for camera in cameras],
            "device": device,
        }
        arguments |= {name: public_arguments[name] for name in self.parameters & PUBLIC}
        with np.errstate(all="ignore"):  # numbers that overflow are refused below
            attacked = self.function(model, np.random.default_rng(seed), **arguments, **settings)
        self._check_result(attacked, len(model))
        listed = " ".join(f"{key}={value}" for key, value in {**self.settings, **settings, "seed": seed}.items())
        self._check_table(attacked, model, listed)
        if attacked.model is model:
            return attacked
        return replace(attacked, model=attacked.model.with_comment(f"gspure {__version__} attack {self.name} {listed}"))

    def matching(
        self,
        public: PublicModel,
        evidence: Evidence,
        wanted: float,
        damage_of: Damage,
        *,
        seed: int = 0,
        cameras: Sequence[Camera] = (),
        device: Device | None = None,
        **settings: Setting,
    ) -> Match:
        """Return the strength whose damage is `wanted` dB, or the nearest to it that `search` finds.

        `damage_of` comes from `gspure.attacks.strength.scene_damage`. The other parameters are those of `apply`;
        `settings` must not include the strength.
        """
        strength = self.strength
        if strength is None:
            raise InputError(f"attack {self.name}", "damage", expected="an attack with a strength", found="none")
        if strength.setting in settings:
            raise InputError(
                f"attack {self.name}", strength.setting, expected="no value, since a damage is given", found="one"
            )

        def damage_at(value: float) -> float:
            chosen = {**settings, strength.setting: value}
            attacked = self.apply(public, evidence, seed=seed, cameras=cameras, device=device, **chosen)
            return damage_of(public.with_model(attacked.model), attacked.transform) if len(attacked.model) else np.inf

        return search(strength, damage_at, wanted)

    def _check_result(self, attacked: Any, count: int) -> None:
        """Refuse what is no `Attacked`, `rows` of a wrong type, shape or range, and a `transform` that is not rigid."""
        source = f"attack {self.name}"
        if not isinstance(attacked, Attacked):
            raise InputError(source, "result", expected=Attacked.__name__, found=type(attacked).__name__)
        for name in ("rows",) if attacked.transform is None else ("rows", "transform"):
            if not isinstance(found := getattr(attacked, name), np.ndarray):
                raise InputError(source, name, expected="a NumPy array", found=type(found).__name__)
        rows = attacked.rows
        fits = rows.dtype.kind in "iu" and rows.shape == (len(attacked.model),) and attacked.count == count
        if not (fits and ((rows >= -1) & (rows < count)).all()):
            expected = f"[{len(attacked.model)}] indices of {count} rows"
            found = f"{rows.dtype} {list(rows.shape)} of {attacked.count}"
            raise InputError(source, "rows", expected=expected, found=found)
        if attacked.transform is not None:
            if attacked.transform.shape != (4, 4):
                raise InputError(source, "transform", expected="[4, 4]", found=f"{list(attacked.transform.shape)}")
            require_rigid(source, "transform", attacked.transform)

    def _check_table(self, attacked: Attacked, before: Gaussians, listed: str) -> None:
        """Refuse columns of another type, and infinities and not-a-numbers where the model `before` has finite numbers.

        The same goes for the unchanged model, if `rows` says that its rows are others.
        """
        names, table = {*before.names} & {*attacked.model.names}, attacked.model.table
        for name in sorted(names):
            if (kind := table.dtype[name]) != (known := before.table.dtype[name]):
                raise InputError(f"attack {self.name}", name, expected=str(known), found=str(kind))
        count, own = len(before), np.arange(len(before))
        moved = attacked.rows[attacked.rows != own] if len(table) == count else attacked.rows[:0]
        if len(moved) and _alike(table, before.table) and not _alike(table, before.table[attacked.rows]):
            expected, found = "0, 1, 2, ..., since the attacked table equals the public one", "another order"
            raise InputError(f"attack {self.name}", "rows", expected=expected, found=found)
        for name, changed in non_finite_rows(attacked.model, sorted(names)).items():
            if len(rows := changed[np.isfinite(before.table[name][attacked.rows[changed]])]):
                found = f"infinity or not-a-number in {len(rows)} of {len(attacked.model)} rows, first in row {rows[0]}"
                raise InputError(f"attack {self.name}", name, expected="finite numbers", found=found, hint=listed)

    def _evidence(self, name: str, evidence: Evidence, count: int) -> NDArray[Any]:
        array: NDArray[Any] | None = getattr(evidence, name)
        if array is None:
            raise InputError(f"attack {self.name}", name, expected="an array", found="nothing")
        if array.shape != (count,):
            found = f"{list(array.shape)}"
            raise InputError(f"attack {self.name}", name, expected=f"[{count}], one per row", found=found)
        if (array.dtype == np.bool_) != (name == "prune_mask"):  # a mask of integers would index rows
            expected = "bool" if name == "prune_mask" else "numbers"
            raise InputError(f"attack {self.name}", name, expected=expected, found=str(array.dtype))
        if np.isnan(array).any():
            raise InputError(f"attack {self.name}", name, expected="numbers", found="NaN")
        return array


def _alike(table: NDArray[np.void], other: NDArray[np.void]) -> bool:
    """Return whether two tables hold the same bytes; of different ones, few columns are compared."""
    return table.dtype == other.dtype and all(table[n].tobytes() == other[n].tobytes() for n in table.dtype.names or ())


def named(functions: Mapping[Callable[..., Attacked], Strength | None]) -> tuple[Attack, ...]:
    """Return functions, each with its strength, as attacks of the same names."""
    return tuple(Attack(function.__name__, function, strength=strength) for function, strength in functions.items())


def require(attack: str, setting: str, value: object, expected: str, *, fits: bool) -> None:
    """Raise `InputError` for a setting unless it `fits` what is expected."""
    if not fits:
        raise InputError(f"attack {attack}", setting, expected=expected, found=str(value))


def require_attribute(attack: str, columns: Columns, attribute: str) -> None:
    """Refuse models whose rows do not store an attribute, such as the opacity of anchors."""
    if not columns.get(attribute):
        raise NotApplicable(attack, f"rows do not store {attribute}")


def select_columns(attack: str, columns: Columns, attributes: str, allowed: tuple[str, ...]) -> tuple[str, ...]:
    """Return the columns behind a setting such as ``colour`` or ``colour,opacity``, in that order.

    Raise `InputError` if a name is not `allowed` or given twice, `NotApplicable` if the model stores none of these
    attributes.
    """
    names = attributes.split(",")
    if not set(names) <= set(allowed) or len(set(names)) != len(names):
        expected = f"one or more of {','.join(allowed)}, separated by commas"
        raise InputError(f"attack {attack}", "attributes", expected=expected, found=repr(attributes))
    selected = tuple(column for name in names for column in columns.get(name, ()))
    if not selected:
        raise NotApplicable(attack, f"rows do not store {attributes}")
    return selected
