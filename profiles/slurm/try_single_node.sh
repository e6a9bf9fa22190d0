#!/bin/sh
# Runs a small evaluation through profiles/slurm on a Slurm of one node that lives in a temporary folder, and takes it down.
#
#   apt-get install slurm-wlm munge
#   .venv/bin/pip install snakemake-executor-plugin-slurm
#   profiles/slurm/try_single_node.sh [PYTHON]
#
# To be run as root, which both daemons of Slurm need here. The node is this machine; it says that it has 16 processors, 128
# GB and a GPU, so that the profile can be taken as it is: jobs get no GPU of Slurm's, and find the OpenCL device that there
# is. Control groups, which containers lack, are not used.
set -eu

root=$(cd "$(dirname "$0")/../.." && pwd)
python=${1:-$root/.venv/bin/python}
for program in munged slurmctld slurmd sbatch; do
    command -v "$program" > /dev/null || { echo "$0: no $program: apt-get install slurm-wlm munge" >&2; exit 2; }
done
"$python" -c "import snakemake_executor_plugin_slurm" ||
    { echo "$0: $python -m pip install snakemake-executor-plugin-slurm" >&2; exit 2; }

folder=$(mktemp -d)
chmod 755 "$folder" # for the socket of munged, which serves every user
mkdir "$folder/state" "$folder/spool" "$folder/project" "$folder/bin"
daemons=
finish() {
    status=$?
    for daemon in $daemons; do kill "$daemon" 2> /dev/null || true; done
    for daemon in $daemons; do wait "$daemon" 2> /dev/null || true; done
    [ "$status" = 0 ] || tail -n 15 "$folder"/*.log "$folder"/project/.snakemake/slurm_logs/*/*/*.log >&2 || true
    rm -rf "$folder"
}
trap finish EXIT
trap 'exit 130' INT TERM

export SLURM_CONF="$folder/slurm.conf"
node=$(hostname -s)
cat > "$SLURM_CONF" << CONF
ClusterName=try
SlurmctldHost=$node(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
SlurmUser=root
AuthInfo=socket=$folder/munge.socket
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
MinJobAge=3600
ReturnToService=2
GresTypes=gpu
NodeName=$node NodeAddr=127.0.0.1 CPUs=16 RealMemory=128000 Gres=gpu:1
PartitionName=try Nodes=$node Default=YES MaxTime=INFINITE
CONF
echo "Name=gpu File=/dev/null" > "$folder/gres.conf"

# A job's own Snakemake forgets SLURM_CONF before it calls srun (snakemake-executor-plugin-slurm-jobstep 0.6).
printf '#!/bin/sh\nSLURM_CONF=%s exec %s "$@"\n' "$SLURM_CONF" "$(command -v srun)" > "$folder/bin/srun"
chmod +x "$folder/bin/srun"
export PATH="$folder/bin:$PATH"

head -c 1024 /dev/urandom > "$folder/munge.key"
chmod 600 "$folder/munge.key"
munged --foreground --key-file="$folder/munge.key" --socket="$folder/munge.socket" --pid-file="$folder/munged.pid" \
    --log-file="$folder/munged.log" --seed-file="$folder/munged.seed" &
daemons="$!"
sleep 1
slurmctld -D > /dev/null 2>&1 &
controller=$!
daemons="$controller $daemons"
slurmd -D > /dev/null 2>&1 &
daemons="$! $daemons"
for second in $(seq 30); do
    [ "$(sinfo --noheader --format %T 2> /dev/null)" = idle ] && break
    kill -0 "$controller" && [ "$second" -lt 30 ] || { echo "$0: the node does not come up" >&2; exit 1; }
    sleep 1
done
sinfo --Node --format "%N: %c processors, %m MB, %G, %T"

cd "$folder/project"
cat > config.yaml << CONFIG
pairs: {room: {views: 9, width: 48, height: 36}}
schemes: {splats_in_splats: {iterations: 60, max_gaussians: 600}}
method: {min_samples: 3, min_cluster_size: 5}
variants: {unattacked: {}, gspure: {}, random_matched: {}}
threads: 2
CONFIG
PYTHONPATH="$root${PYTHONPATH:+:$PYTHONPATH}" "$python" -m snakemake --snakefile "$root/Snakefile" \
    --workflow-profile "$root/profiles/slurm" --configfile config.yaml --jobs 3 \
    --slurm-status-command squeue --slurm-init-seconds-before-status-checks 2 \
    --default-resources slurm_partition=try mem_mb=1000 runtime=60

scontrol --oneliner show jobs > "$folder/jobs"
jobs=$(wc -l < "$folder/jobs")
completed=$(grep -c "JobState=COMPLETED" "$folder/jobs")
with_gpu=$(grep -c "TresPerJob=gres:gpu:1" "$folder/jobs")
echo "$completed of $jobs jobs of Slurm completed, $with_gpu of them had the GPU; $(wc -c < results/report.html) bytes of report"
[ "$completed" = "$jobs" ]
