"""Print everyday.csv from answers.json, which `gspure audit config/everyday.yaml --json > answers.json` writes."""

import csv
import json
import sys
from pathlib import Path

import yaml

from gspure.metrics.names import display_name
from gspure.text import decimal

answers = json.loads(Path(sys.argv[1]).read_text())
columns = {display_name(answer["condition"]["scheme"]): answer["attacks"] for answer in answers}
variants = yaml.safe_load(Path("config/everyday.yaml").read_text())["variants"]


def cell(attacks, variant):
    """Return the owner's verdict / that of one who adapts, and the damage in dB."""
    attack = next((attack for attack in attacks if attack["variant"] == variant), None)
    if attack is None or attack["damage"] is None:
        return "not applicable"
    verdicts = "no message" if attack["left"] == "unknown" else attack["left"], attack["adaptive"]
    return f"{' / '.join(filter(None, verdicts))} ({decimal(attack['damage'], 1)})"


writer = csv.writer(sys.stdout, lineterminator="\n")
writer.writerow(["", *columns])
writer.writerows([name, *(cell(attacks, name) for attacks in columns.values())] for name in [*variants][1:])
