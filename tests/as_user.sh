#!/usr/bin/env bash
# Runs the tests of ports as an ordinary user. Needs root to switch users. Cargo gives the name of the test binary.
set -euo pipefail
cd "$(dirname "$0")/.."
binary=$(cargo test --no-run --test tests 2>&1 | sed -n 's/^ *Executable .*(\(.*\))$/\1/p')
# That user may not be able to read this folder: it gets a copy of what the tests read, and of the program.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
root=$PWD
mkdir -p "$work/root$root/target/debug"
git ls-files -z scripts tests docs README.md .ci | xargs -0 cp --parents -t "$work/root$root"
cp target/debug/motionseq "$work/root$root/target/debug/"
cp "$binary" "$work/root$root/tests-binary"
chmod -R a+rX "$work"
# The paths of the program and of the project are in the test binary, so the copy takes the place of the folder itself.
unshare --mount bash -euc '
    mount --bind "$1/root$2" "$2"
    cd "$2"
    mkdir -m 777 -p "$1/tmp"
    # Without CI, tests are skipped if this user cannot see what root has installed.
    exec setpriv --reuid=65534 --regid=65534 --clear-groups env -u CI TMPDIR="$1/tmp" HOME="$1/tmp" RUST_TEST_THREADS=4 \
        ./tests-binary ports:: tap:: host:: play:: robots_played:: faults:: record:: desk:: gates_played:: maestro:: text_boards:: families_cli::
' - "$work" "$root"
