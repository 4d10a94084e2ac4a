# What the tests of render managers share; sourced. Needs GRAECO, the program, as an absolute path.
set -euo pipefail
: "${GRAECO:?the program to test}"
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
work=$(mktemp -d "${TMPDIR:-/tmp}/graeco-farm.XXXXXX")

# Six frames of two parts, each some seconds of work, so that a signal finds a task in the middle.
scene=$root/animations/newton.glb
frames=1-11:2
settings=(--size=192x108 --runs="${FARM_RUNS:-32}" --bounces=1 --aov=depth,variance)

fail() {
    echo "FAILED: $*" >&2
    exit 1
}

# The program under a name that notes who works on what: $work/tasks/FRAMES.TILE holds the process's number.
mkdir "$work/tasks"
cat >"$work/worker" <<WORKER
#!/bin/bash
frames=none part=none
for argument; do
    case \$argument in
        --frames=*) frames=\${argument#*=} ;;
        --tile=* | --run-range=*) part=\${argument#*=} ;;
    esac
done
echo \$\$ >>"$work/tasks/\$frames.\${part//\//-}"
exec "$GRAECO" "\$@"
WORKER
chmod +x "$work/worker"

# Waits until task $1 (FRAMES.TILE) has recorded a part of its work, that is until the journal of its part, the file $2,
# is larger than a header and a block of 16 x 16 pixels, then prints the number of its process.
in_the_middle() {
    local try pid
    for ((try = 0; try < 6000; try++)); do
        if [ -s "$work/tasks/$1" ] && [ -n "$(find "$2" -size +30000c 2>/dev/null)" ]; then
            pid=$(tail -n 1 "$work/tasks/$1")
            kill -0 "$pid" 2>/dev/null || fail "task $1 ended before it could be struck"
            echo "$pid"
            return
        fi
        sleep 0.01
    done
    fail "task $1 never began"
}

# One machine's frames.
single_machine() {
    "$GRAECO" render "$scene" --frames="$frames" "${settings[@]}" --output="$work/single/newton.####.exr" --quiet
}

# Every frame of the folder $1 equals the single machine's, byte for byte.
same_frames() {
    local frame count=0
    for frame in "$work"/single/*.exr; do
        cmp "$frame" "$1/$(basename "$frame")" || fail "$1/$(basename "$frame") differs"
        count=$((count + 1))
    done
    [ "$count" = 6 ] || fail "$count frames instead of 6"
    echo "6 frames equal one machine's, byte for byte"
}
