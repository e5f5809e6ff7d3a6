#!/bin/sh
# Takes a bracket with the DSLR on USB, for a session's [source] kind = "command".
# usage: dslr.sh FILE SHUTTERSPEED...    leaves FILE-1.png, FILE-2.png, … of raw counts
set -eu
file=$1
shift
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
n=0
for speed in "$@"; do
    n=$((n + 1))
    gphoto2 --quiet --set-config shutterspeed="$speed" \
        --capture-image-and-download --force-overwrite --filename "$work/$n.raw"
    # -D: counts as the sensor gave them; -4: 16 bits, linear; -t 0: not turned as the camera was held
    dcraw -c -D -4 -t 0 "$work/$n.raw" >"$work/$n.pgm"
    pnmtopng "$work/$n.pgm" >"$work/$n.png"
done
# All or none: what is missing is taken again as a whole.
i=0
while [ "$i" -lt "$n" ]; do
    i=$((i + 1))
    mv "$work/$i.png" "$file-$i.png"
done
