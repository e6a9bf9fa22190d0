"""The record of a decision: its clusters, suspicious rows, and a scan of the model before and after pruning."""

from gspure.arrays import Bools
from gspure.files import Json
from gspure.method.diagnosis import Diagnosis
from gspure.model import Gaussians
from gspure.model.summary import suspicious_rows
from gspure.scan.verdict import judge


def diagnosis_record(diagnosis: Diagnosis, model: Gaussians, prune_mask: Bools) -> Json:
    """Return the content of ``diagnosis.json`` for a model with K rows, of which a mask [K] prunes some."""
    suspicious = {reason: rows.tolist() for reason, rows in suspicious_rows(model).items()}
    scanned = {"before": model, "after": model[~prune_mask]}
    scan = {when: judge(rows).word for when, rows in scanned.items() if len(rows)}
    return diagnosis.to_json() | {"suspicious": suspicious, "scan": scan}
