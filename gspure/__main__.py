"""``python -m gspure`` is ``gspure``."""

from gspure.cli import main

raise SystemExit(main())
