#!/usr/bin/env bash
# A Snakemake that was killed leaves its lock on the folder behind. Remove it, unless Snakemake still runs here.
# usage: setup/unlock.sh SNAKEMAKE
set -eu
[ -n "$(ls .snakemake/locks 2>/dev/null)" ] || exit 0
for process in /proc/[0-9]*; do
  if [ "$(readlink "$process/cwd")" = "$PWD" ] && grep -q snakemake "$process/cmdline" 2>/dev/null; then
    [ "$process" != "/proc/$$" ] || continue
    echo "Snakemake is running in this folder already (process ${process#/proc/})." >&2
    exit 1
  fi
done
echo "An earlier run was killed: what it left undone is done now."
exec "$1" --unlock --quiet
