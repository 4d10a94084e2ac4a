#!/bin/bash
# `graeco farm slurm` on a cluster of one node: six frames of two tiles as an array job. One task is killed, another one
# is told to stop, each in the middle; both requeue themselves. The merged frames must equal those of one machine.
# Then a merge of parts one of which is missing must name it.
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
. "$(dirname "${BASH_SOURCE[0]}")/cluster.sh"
cleanup() {
    scancel --user="$(id -un)" 2>/dev/null || true
    cluster_stop
    rm -rf "$work"
}
trap cleanup EXIT
cd "$work"

cluster_start "$work/cluster"
single_machine
export GRAECO_PROGRAM=$GRAECO
GRAECO=$work/worker "$GRAECO_PROGRAM" farm slurm "$scene" --frames="$frames" "${settings[@]}" --parts=2 --frames-per-task=1 --measure=0 --memory=256 \
    --threads=1 --throttle=4 --array-size=8 --pictures=out/newton.####.exr --output=job.sh --submit | tee submitted
# The numbers of the array jobs, and of the merge: 12 tasks are an array of 8 and one of 4.
arrays=$(sed -n 's/^render: //p' submitted)
merge=$(sed -n 's/^merge: //p' submitted)
[[ $arrays == *:* ]] || fail "12 tasks were not cut into arrays of 8"
first=${arrays%%:*}

# Task 1 is frame 1, tile 2 of 2; task 6, which begins later, is frame 7, tile 1.
kill -KILL "$(in_the_middle 1.2-2 out/parts/newton.0001.2.part.partial)"
echo "task 1 was killed in the middle"
in_the_middle 7.1-2 out/parts/newton.0007.1.part.partial >/dev/null
scancel --signal=TERM --full "${first}_6"
echo "task 6 was told to stop in the middle"

finished() {
    local try
    for ((try = 0; try < 600; try++)); do
        [ -z "$(squeue --noheader)" ] && return
        sleep 0.2
    done
    squeue >&2
    fail "jobs do not end"
}
finished
cat slurm-"${first}"_1.out slurm-"${first}"_6.out
grep -q "exit code 137: requeued" slurm-"${first}"_1.out || fail "the killed task did not requeue itself"
grep -q "exit code \(75\|143\): requeued" slurm-"${first}"_6.out || fail "the stopped task did not requeue itself"
for part in 0001.2 0007.1; do
    grep -q "$part.part: [0-9]* of [0-9]* blocks were done before" slurm-"$first"_[16].out || fail "$part began anew"
done
cat slurm-"${merge}"_0.out
same_frames out

# A part is missing: the merge says which, and merges nothing.
rm out/*.exr
part=$(find out/parts -name "*.part" | sort | sed -n 3p)
rm "$part"
GRAECO=$work/worker bash job.sh merge | tee again
finished
log=slurm-$(sed -n 's/^merge: //p' again)_0.out
cat "$log"
grep -q "frame 3 lacks" "$log" || fail "the missing part is not named"
[ ! -e out/newton.0001.exr ] || fail "merged although a part is missing"
echo "the missing part is named"
