#!/usr/bin/env bash
# A Snakemake that was killed leaves its lock on the folder behind. Remove it, unless Snakemake still runs here: then it
# holds .snakemake/gspure.lock (rules/common.smk), which the system frees when its process ends, however it ends.
# usage: setup/unlock.sh SNAKEMAKE
set -eu
[ -n "$(ls .snakemake/locks 2>/dev/null)" ] || exit 0
if ! flock --wait 2 .snakemake/gspure.lock true; then # a killed process may still be about to end
  echo "Snakemake is running in this folder already." >&2
  exit 1
fi
echo "An earlier run was killed: what it left undone is done now."
exec "$1" --unlock --quiet
