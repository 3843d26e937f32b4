#!/usr/bin/env bash
# Reads logs with the official tools for MCAP: the readers for Python and TypeScript, and `mcap doctor` where it is installed (no
# package registry has it). Run by .ci/nightly after `cargo build --release`; needs npm and `pip install mcap==1.6.0`.
set -euo pipefail
cd "$(dirname "$0")/.."
motionseq=$PWD/target/release/motionseq
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/logs"

for script in scripts/*.motion; do
    # A script whose `expect` or gate fails has a log, too. Each `wait go` gets a line.
    "$motionseq" play "$script" --speed 4 --log "$work/logs/" --go stdin -q < <(yes go) || (($? == 7))
done
"$motionseq" play scripts/greeting.motion --loop forever --log "$work/logs/killed.mcap" --no-guard -q &
player=$!
until [[ $(stat -c %s "$work/logs/killed.mcap" 2>/dev/null || echo 0) -gt 20000 ]]; do sleep 0.1; done
kill -KILL "$player"
wait "$player" || true

python3 tests/clients/doctor.py "$work"/logs/*.mcap
npm install --silent --no-audit --no-fund --prefix "$work/npm" @mcap/core@2.2.2 >/dev/null
NODE_PATH=$work/npm/node_modules node tests/clients/read_mcap.cjs "$work"/logs/*.mcap
if command -v mcap >/dev/null; then
    for log in "$work"/logs/*.mcap; do
        # It prints warnings and errors, or nothing.
        found=$(mcap doctor --strict-message-order "$log" 2>&1)
        if [[ -n $found ]]; then
            echo "$log: $found"
            exit 1
        fi
    done
    echo "mcap doctor finds nothing in $(ls "$work/logs" | wc -l) logs"
else
    echo "skipped: there is no mcap command"
fi
