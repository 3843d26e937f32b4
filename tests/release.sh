#!/usr/bin/env bash
# Tries the programs of a release, made by dist/build: the one for this machine plays a script, and both architectures render every
# script to the same bytes (aarch64 under qemu-user). Usage: tests/release.sh FOLDER
set -euo pipefail
folder=$1
x86=$(echo "$folder"/motionseq-*-x86_64) arm=$(echo "$folder"/motionseq-*-aarch64)
for program in "$x86" "$arm"; do
    if ! readelf -l "$program" | grep -q 'LOAD' || readelf -l "$program" | grep -q 'INTERP'; then
        echo "$program is not a static program" >&2
        exit 1
    fi
    if grep -qaF -e "$PWD" -e "$HOME/.cargo" -e "$HOME/.rustup" "$program"; then
        echo "$program contains folders of this machine" >&2
        exit 1
    fi
done
"$x86" play scripts/hello.motion
count=0
for script in scripts/*.motion; do
    for format in bin listing; do
        if ! cmp <("$x86" render --format "$format" "$script") <(qemu-aarch64-static "$arm" render --format "$format" "$script"); then
            echo "$script: aarch64 renders something else" >&2
            exit 1
        fi
    done
    count=$((count + 1))
done
((count >= 10))
echo "both programs are static, and render $count scripts to the same bytes"
