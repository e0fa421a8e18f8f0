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
for file in README.md LICENSE docs/use/case-folder.md data_samples/sample/truth.json; do
  test -s "moved/share/emmetrope/$file" || { echo "missing: $file"; exit 1; }
done
echo "installed tree: all found"
