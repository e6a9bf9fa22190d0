"""What this package adds to gspure."""

from gspure import Plugin
from marked_clones import SCHEME
from marked_clones.rendered_bits import SCHEME as RENDERED_BITS

PLUGIN = Plugin(schemes=(SCHEME, RENDERED_BITS))
