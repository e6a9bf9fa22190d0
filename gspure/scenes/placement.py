"""Positions of the surfaces of a message relative to those of the scene.

They decide how well the message can be separated from the scene.
"""

from dataclasses import dataclass

from gspure.scenes.solids import BACK, BOTTOM, LEFT, RIGHT, Room
from gspure.scenes.textures import Texture

HALF_WIDTH = 3.0
WALL_HEIGHT = 3.7


@dataclass(frozen=True)
class Placement:
    """How far a room's surfaces stand before those of an unmoved one.

    The floor lies `floor` metres higher, the walls come `inset` metres nearer, and only some `faces` of the room exist.
    """

    floor: float = 0.0
    inset: float = 0.0
    faces: tuple[int, ...] = (LEFT, RIGHT, BACK, BOTTOM)

    def room(self, *, walls: Texture, back: Texture, floor: Texture) -> Room:
        """Return the room, with the textures of its side walls, back wall and floor."""
        width = 2.0 * (HALF_WIDTH - self.inset)
        height = WALL_HEIGHT - self.floor
        textures = (walls, walls, walls, back, floor, walls)
        return Room((0.0, 0.0, self.floor + height / 2.0), (width, width, height), textures, faces=self.faces)


PLACEMENTS = {
    "coincident": Placement(),
    "raised": Placement(floor=0.35, inset=0.25),
    "front": Placement(floor=0.6, inset=0.5, faces=(BOTTOM,)),
    "behind": Placement(floor=-0.5, inset=-0.7),
}
"""By name. ``front`` has a floor only and nothing behind it."""
