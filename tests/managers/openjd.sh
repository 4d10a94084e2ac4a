#!/bin/bash
# `graeco farm openjd` with `openjd run`: six frames of two tiles. One task is killed, another one is told to stop, each
# in the middle; the job is run again each time. The merged frames must equal those of one machine.
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
openjd=${OPENJD:-openjd}
cleanup() { rm -rf "$work"; }
trap cleanup EXIT
cd "$work"

single_machine
"$GRAECO" farm openjd "$scene" --frames="$frames" "${settings[@]}" --parts=2 --frames-per-task=1 --measure=0 --memory=256 \
    --pictures="$work/out/newton.####.exr" --output=job.yaml
"$openjd" check job.yaml
job=("$openjd" run job.yaml --step Merge --run-dependencies -p Graeco="$work/worker" -p Scene="$scene")

# Runs the job and strikes the task $2, which makes the file $3, with the signal $1; the run must fail.
struck_run() {
    "${job[@]}" >"run-$1.log" 2>&1 &
    local run=$! pid
    pid=$(in_the_middle "$2" "$3.partial")
    kill "-$1" "$pid"
    if wait "$run"; then fail "the run succeeded although $2 was struck by $1"; fi
    grep -q "openjd_progress" "run-$1.log" || fail "no progress was reported"
    [ ! -e out/newton.0001.exr ] || fail "merged too early"
    echo "task $2 was struck by $1 in the middle"
}

struck_run KILL 3.2-2 out/parts/newton.0003.2.part
struck_run TERM 7.1-2 out/parts/newton.0007.1.part
grep -q "exited with code: 75" run-TERM.log || fail "a request to stop does not end with exit code 75"
"${job[@]}" >run.log 2>&1 || { tail -n 40 run.log >&2; fail "the last run failed"; }
same_frames out
grep -q "0003.2.part: [0-9]* of [0-9]* blocks were done before" run-TERM.log || fail "the killed task began anew"
grep -q "0007.1.part: [0-9]* of [0-9]* blocks were done before" run.log || fail "the stopped task began anew"
grep -q "0005.1.part: finished before, kept" run.log || fail "a finished task was rendered again"

# Frames that stop when they are accurate enough, whole and in tiles: each equals that of one machine.
accurate=(--frames=1-3:2 --size=64x36 --most-runs=256)
"$GRAECO" render "$scene" "${accurate[@]}" --error=10% --output="$work/accurate/newton.####.exr" --quiet
for parts in 1 2; do
    "$GRAECO" farm openjd "$scene" "${accurate[@]}" --error=10% --parts=$parts --frames-per-task=1 --measure=0.1 \
        --memory=256 --pictures="$work/stopped-$parts/newton.####.exr" --output="stopped-$parts.yaml"
    last=$([ $parts = 1 ] && echo Check || echo Merge)
    "$openjd" run "stopped-$parts.yaml" --step "$last" --run-dependencies -p Graeco="$GRAECO" -p Scene="$scene" \
        >stopped.log 2>&1 || { tail -n 40 stopped.log >&2; fail "frames that stop by themselves were not rendered"; }
    for frame in 0001 0003; do
        cmp "accurate/newton.$frame.exr" "stopped-$parts/newton.$frame.exr" ||
            fail "frame $frame, stopped by itself in $parts parts, differs"
    done
done
echo "2 frames that stop by themselves equal one machine's, byte for byte, whole and in 2 tiles"

# refused SUBJECT FLAGS: a job that cannot be is refused in one sentence that begins with its subject.
refused() {
    if "$GRAECO" farm openjd "$scene" "${accurate[@]}" "${@:2}" --output=refused.yaml 2>refused.log; then
        fail "${*:2} was not refused"
    fi
    grep -q "^graeco: $1: " refused.log || fail "the refusal of ${*:2} does not begin with $1"
}
refused "--until with a part of a frame" --until=5% --parts=2
refused "--split runs" --error=10% --split=runs
