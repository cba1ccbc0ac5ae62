#!/usr/bin/env bash
# Runs the tests of the hard cases and makes one table of what they measured, hard_cases.csv and hard_cases.md, in OUT:
# scripts/hard_cases.sh OUT, for instance docs/results/amd-epyc-2-cores. A failing test is told, and its rows stand in the
# table as far as it came. What the tests record lies in a folder that is removed, or, to be kept and added to, in the one
# that the variable HARD_CASES names.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
if [ $# -ne 1 ]; then
    echo "usage: scripts/hard_cases.sh OUT" >&2
    exit 2
fi
mkdir -p "$1"
if [ -z "${HARD_CASES:-}" ]; then
    HARD_CASES=$(mktemp -d)
    trap 'rm -r "$HARD_CASES"' EXIT
fi
mkdir -p "$HARD_CASES"
export HARD_CASES
tests=(hard_cases materials structures versus_rapier extremes joints_axes joints_beside joints_exact joints_random)
failed=0
cargo test --release --no-fail-fast "${tests[@]/#/--test=}" || failed=1
cargo run --quiet --release -p tumble-bench --example hard_cases -- "$HARD_CASES" "$1"
exit $failed
