#!/bin/sh
# Opens a cost report in headless Chromium and writes what it shows as a PNG, to be looked at.
#
#   graeco study cost shot.glb -o cost/ && tests/browser/report.sh cost/report.html report.png
#
# CHROMIUM names the browser; else the first of the usual names that is installed. Fails if there is none, if the report
# asks for anything but itself, or if the picture comes out empty.
set -eu

if [ $# -ne 2 ]; then
    echo "usage: $0 REPORT.html SCREENSHOT.png" >&2
    exit 2
fi
report=$(realpath "$1")
picture=$2
browser=${CHROMIUM:-}
for name in chromium chromium-browser google-chrome chrome; do
    [ -n "$browser" ] || browser=$(command -v "$name" || true)
done
if [ -z "$browser" ]; then
    echo "no Chromium found: set CHROMIUM to its path" >&2
    exit 1
fi
if grep -Eo '(src|href)="[a-z]+://[^"]*"|@import|url\([a-z]+://' "$report"; then
    echo "$report: refers to the network (above); expected one self-contained file" >&2
    exit 1
fi
profile=$(mktemp -d)
trap 'rm -rf "$profile"' EXIT
"$browser" --headless --no-sandbox --disable-gpu --hide-scrollbars --user-data-dir="$profile" \
    --window-size="${WINDOW:-1280,4000}" --virtual-time-budget=5000 \
    --host-resolver-rules="MAP * ~NOTFOUND" --screenshot="$picture" "file://$report" 2>"$profile/log" ||
    { cat "$profile/log" >&2; exit 1; }
if [ ! -s "$picture" ]; then
    echo "$picture: nothing was written" >&2
    exit 1
fi
echo "$picture: $(wc -c <"$picture") bytes"
