#!/bin/sh
# The wheel is made, installed into an environment of its own, and answers there.
# Usage: wheel.sh BUILD_FOLDER PYTHON
set -eu
cmake --build "$1" --target wheel
environment=$(mktemp -d)
trap 'rm -rf "$environment"' EXIT
"$2" -m venv --system-site-packages --without-pip "$environment"
"$environment/bin/python" - "$1"/wheel/emmetrope-*.whl "$environment" <<'PYTHON'
import sys
import sysconfig
from wheel.wheelfile import WheelFile
with WheelFile(sys.argv[1]) as wheel:  # checks every file against the record
    wheel.extractall(sysconfig.get_paths(vars={"base": sys.argv[2], "platbase": sys.argv[2]})["platlib"])
PYTHON
cd "$environment"
"$environment/bin/python" -c "
import emmetrope, os
assert emmetrope.__file__.startswith(os.getcwd()), emmetrope.__file__
assert abs(emmetrope.Eye('navarro').cardinal_points().power_D - 60.4) < 0.1"
