#!/bin/sh
# An installed tree runs from any folder, in an empty environment, with kernels and data found.
# Usage: installed_tree.sh BUILD_FOLDER
set -eu
build=$1
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
cmake --install "$build" --prefix "$place/first" >/dev/null
mv "$place/first" "$place/moved"
cd "$place"
clean() { env -i PATH=/usr/bin:/bin HOME="$place" "$@"; }

clean moved/bin/emmetrope --version
clean moved/bin/emmetrope doctor
clean moved/bin/emmetrope eye navarro --json | grep -q '"power_D"'
clean moved/bin/emmetrope trace --eye navarro --scene letters:logmar=0.3,distance_mm=6000 --size 32x32 --samples 16 \
      -o "$place/picture" --quiet
find "$place/picture" -name '*.png' | grep -q .
# Files of unknown origin are read: what is installed is hardened (deb-hardening: position-independent, RELRO with all
# symbols bound, stack canaries, fortified calls, control-flow protection where the machine has it).
for program in moved/bin/emmetrope*; do
  lacks() { echo "$program: $1"; exit 1; }
  readelf -hW "$program" | grep -q 'Type:.*DYN' || lacks "not position-independent"
  readelf -lW "$program" | grep -q GNU_RELRO || lacks "no RELRO"
  readelf -dW "$program" | grep -q 'FLAGS.*NOW' || lacks "symbols are bound late"
  readelf -lW "$program" | grep 'GNU_STACK' | grep -q 'RW ' || lacks "stack is executable"
done
# The linker marks a program only where all that it is linked from has it, Debian's start files too: functions are looked at.
if [ "$(uname -m)" = x86_64 ]; then
  test "$(objdump -d moved/bin/emmetrope-decode | grep -c endbr64)" -gt 100 || { echo "no control-flow protection"; exit 1; }
fi
readelf -sW --dyn-syms moved/bin/emmetrope-decode | grep -q __stack_chk_fail || { echo "no stack canaries"; exit 1; }
readelf -sW --dyn-syms moved/bin/emmetrope-decode | grep -q '_chk@' || { echo "no fortified calls"; exit 1; }
grep -q '"purl": "pkg:deb/debian/libdcmtk' moved/share/emmetrope/emmetrope.cdx.json

for file in README.md SECURITY.md LICENSE docs/use/case-folder.md data_samples/sample/truth.json; do
  test -s "moved/share/emmetrope/$file" || { echo "missing: $file"; exit 1; }
done
for file in emmetrope/pipeline/cohort/Snakefile emmetrope/pipeline/cohort/sweep/Snakefile \
            emmetrope/pipeline/cohort/engine/slurm/config.yaml emmetrope/pipeline/cohort/engine/slurm/job-state \
            man/man1/emmetrope.1 man/man1/emmetrope-trace.1 bash-completion/completions/emmetrope \
            zsh/vendor-completions/_emmetrope fish/vendor_completions.d/emmetrope.fish; do
  test -s "moved/share/$file" || { echo "missing: share/$file"; exit 1; }
done
test -x moved/share/emmetrope/pipeline/cohort/engine/slurm/job-state
echo "installed tree: all found"
