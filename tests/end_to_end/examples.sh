#!/bin/sh
# The example programs build against the installed library and run.
# Usage: examples.sh BUILD_FOLDER SOURCE_FOLDER
set -eu
build=$1 source=$2
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
cmake --install "$build" --prefix "$place/installed" >/dev/null
cmake -S "$source/examples" -B "$place/examples" -G Ninja -DCMAKE_BUILD_TYPE=Release -Wno-dev \
      -DCMAKE_PREFIX_PATH="$place/installed" >"$place/log" 2>&1 || { cat "$place/log"; exit 1; }
cmake --build "$place/examples" >"$place/log" 2>&1 || { cat "$place/log"; exit 1; }
cd "$place"
export PATH="$place/installed/bin:$PATH"
examples/eye_and_ray | grep -q '^reached'
examples/picture
test -s without.png && test -s with.png
examples/refraction | grep 'dispensed as: -4.00 DS'
emmetrope phantom -o "$place/phantom" --random 7 --snr 20 --stack head-axial:pixel_mm=0.8,slice_mm=0.8,matrix=140x60,slices=44 \
          --quiet
examples/fit_study "$place/phantom/dicom" "$place/case" 2>/dev/null | tee fitted
test "$(grep -c 'axial length' fitted)" = 2
