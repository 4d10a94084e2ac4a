# A Slurm cluster of one node on loopback, without systemd, cgroups or a database; sourced by slurm.sh.
#
#   cluster_start FOLDER     exports SLURM_CONF
#   cluster_stop

cluster_pids=()

# A TCP port that nothing listens on.
free_port() {
    python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'
}

cluster_start() {
    local folder user
    folder=$(realpath -m "$1")
    user=$(id -un)
    mkdir -p "$folder"/{state,spool,munge}
    # munged refuses folders that others may write to.
    chmod 755 "$folder" "$folder/munge"
    (umask 077 && dd if=/dev/urandom of="$folder/munge/key" bs=128 count=1 status=none)
    "$(command -v munged || echo /usr/sbin/munged)" --foreground --force --num-threads=1 --key-file="$folder/munge/key" \
        --socket="$folder/munge/socket" --pid-file="$folder/munge/pid" --log-file="$folder/munge/log" \
        --seed-file="$folder/munge/seed" >"$folder/munged.log" 2>&1 &
    cluster_pids+=($!)
    {
        cat <<CONF
ClusterName=graeco
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
# A requeued job waits until its credential has expired: 5 s is the least, 120 s the default.
AuthInfo=socket=$folder/munge/socket,cred_expire=5
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_interval=1,batch_sched_delay=0,sched_min_interval=0
ReturnToService=2
KillWait=5
PlugStackConfig=/dev/null
CONF
        # The node as slurmd sees it, reachable on loopback alone.
        slurmd -C | head -1 | sed 's/$/ NodeAddr=127.0.0.1 State=UNKNOWN/'
        echo "PartitionName=all Nodes=ALL Default=YES State=UP"
    } >"$folder/slurm.conf"
    export SLURM_CONF=$folder/slurm.conf
    slurmctld -D -c >"$folder/slurmctld.log" 2>&1 &
    cluster_pids+=($!)
    slurmd -D >"$folder/slurmd.log" 2>&1 &
    cluster_pids+=($!)
    local try
    for ((try = 0; try < 240; try++)); do
        [ "$(sinfo --noheader --format=%T 2>/dev/null)" = idle ] && return
        sleep 0.25
    done
    echo "the cluster does not start:" >&2
    tail -n 20 "$folder"/*.log >&2
    return 1
}

cluster_stop() {
    local i
    # The last that was started first.
    for ((i = ${#cluster_pids[@]} - 1; i >= 0; i--)); do
        kill "${cluster_pids[i]}" 2>/dev/null || true
        wait "${cluster_pids[i]}" 2>/dev/null || true
    done
    cluster_pids=()
}
