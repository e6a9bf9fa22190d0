#!/usr/bin/env bash
# The `ld` of a PoCL that was unpacked without root. PoCL links each kernel as a C compiler does, against the libraries of
# -dev packages; this script replaces them by the shared libraries, which every machine has.
set -eu
root=$(realpath "$(dirname "$0")/..")
arguments=()
for argument; do
  case $argument in
    -lc) arguments+=(-l:libc.so.6) ;;
    -lm) arguments+=(-l:libm.so.6) ;;
    -lgcc_s) arguments+=(-l:libgcc_s.so.1) ;;
    -lgcc) ;;
    *) arguments+=("$argument") ;;
  esac
done
LD_LIBRARY_PATH=$(echo "$root"/usr/lib/*-linux-gnu*) exec "$root/usr/bin/ld" "${arguments[@]}"
