#!/bin/sh
# Takes the steps of the Containerfile and of Apptainer's definition in chroots of Debian 12, and runs the sample in the
# last one. Needs root and debootstrap; half an hour, 6 GB.
# Usage: tests/end_to_end/container.sh FOLDER
set -eu
cd "$(dirname "$0")/../.."
place=$(mkdir -p "$1" && realpath "$1")
recipe=pipeline/build/Containerfile

bare() { # CHROOT
  debootstrap --variant=minbase bookworm "$1" >"$place/debootstrap.log"
  cp /etc/apt/sources.list.d/* "$1/etc/apt/sources.list.d/" 2>/dev/null || true
  [ ! -s /etc/apt/sources.list ] || cp /etc/apt/sources.list "$1/etc/apt/"
  cp /etc/resolv.conf "$1/etc/" 2>/dev/null || true
  mount -t proc proc "$1/proc"
  mount --bind /dev "$1/dev"
}
leave() { for root in "$place"/build "$place"/run "$place"/apptainer; do umount "$root/proc" "$root/dev" 2>/dev/null || true; done; }
trap leave EXIT
inside() { root=$1; shift; env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive chroot "$root" sh -c "$*"; }
# The commands of the recipe's part number N, one a line.
steps() { awk -v part="$1" '/^FROM/ { n++ } n == part && /^RUN/ { sub(/^RUN /, ""); print }' "$recipe"; }
take() { # CHROOT FOLDER_INSIDE < steps
  while read -r step; do
    echo "== $step"
    inside "$1" "cd $2 && $step" </dev/null
  done
}

bare "$place/build"
git archive --prefix=emmetrope/ HEAD | tar -x -C "$place/build"
steps 1 >"$place/steps" && take "$place/build" /emmetrope <"$place/steps"

bare "$place/run"
cp "$place"/build/packages/emmetrope_*.deb "$place/run/tmp/"
steps 2 >"$place/steps" && take "$place/run" / <"$place/steps"

bare "$place/apptainer"
cp -r "$place/build/packages" "$place/apptainer/packages"
sed -n '/^%post/,/^%runscript/{/^%/d;s/^ *//;/./p}' pipeline/build/emmetrope.def >"$place/steps"
take "$place/apptainer" / <"$place/steps"

cp -r data_samples/sample "$place/run/sample"
for command in "--version" "run /sample/dicom -o /case --quiet"; do
  echo "== emmetrope $command"
  inside "$place/run" "cd / && emmetrope $command"
done
test -s "$place/run/case/report/report.html"
test -s "$place/run/usr/share/man/man1/emmetrope-run.1.gz" || test -s "$place/run/usr/share/man/man1/emmetrope-run.1"
echo "containers: all steps taken"
