"""What identifies a model, and what models are averaged over."""

from pathlib import Path
from typing import Annotated, Final, NamedTuple

from gspure.metrics.csv_tables import UNPREFIXED
from gspure.metrics.names import display_name, model_name

RESULTS: Final = Path("results")


class ModelId(NamedTuple):
    """A scheme's model of a scene; seeds from 1 on are repetitions with other random seeds."""

    scheme: str
    scene: str
    seed: int = 0

    @property
    def folder_name(self) -> str:
        """The name of its folder below that of the scheme: ``room``, or ``room@1`` for a repetition."""
        return f"{self.scene}@{self.seed}" if self.seed else self.scene

    @property
    def name(self) -> str:
        """Its folder below that of the results."""
        return f"{self.scheme}/{self.folder_name}"

    @property
    def folder(self) -> Path:
        """The folder of its results."""
        return RESULTS / self.name

    @property
    def title(self) -> str:
        """Its display name."""
        return model_name(self.scheme, self.scene, self.seed)


class Condition(NamedTuple):
    """What outcomes have in common that are averaged over scenes, and compared with each other."""

    scheme: str
    protocol: str = ""  # poses of the message's views, `shared` or `own`; empty for models of no pair
    initialization: str = ""  # whose points training starts from, `both` or `scene`; empty for models of no pair

    @property
    def key(self) -> str:
        """Its name in folders: ``gs_hider-own-both``."""
        return "-".join(filter(None, self))

    @property
    def title(self) -> str:
        """Its display name: ``GS-Hider, own poses``; training from all points is the default."""
        title = display_name(self.scheme)
        if self.protocol:
            title += f", {self.protocol} poses"
        if self.initialization == "scene":
            title += ", scene's points"
        return title


OfCondition = Annotated[Condition, UNPREFIXED]  # the first columns of a row
