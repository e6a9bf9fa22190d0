"""Print everyday.csv from answers.json, which `gspure audit config/everyday.yaml --json > answers.json` writes."""

import csv
import json
import sys
from pathlib import Path

from gspure.evaluation.names import condition_name

answers = json.loads(Path(sys.argv[1]).read_text())
columns = {condition_name(*answer["condition"]).partition(",")[0]: answer["attacks"] for answer in answers}
variants = dict.fromkeys(attack["variant"] for attacks in columns.values() for attack in attacks)


def cell(attacks, variant):
    """Return the owner's verdict / that of one who adapts, and the damage in dB."""
    attack = next((attack for attack in attacks if attack["variant"] == variant), None)
    if attack is None or attack["damage"] is None:
        return "not applicable"
    return " / ".join(filter(None, (attack["left"], attack["adaptive"]))) + f" ({attack['damage']:.1f})"


writer = csv.writer(sys.stdout, lineterminator="\n")
writer.writerow(["", *columns])
writer.writerows([variant, *(cell(attacks, variant) for attacks in columns.values())] for variant in variants)
