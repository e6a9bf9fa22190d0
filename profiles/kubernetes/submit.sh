#!/bin/sh
# Starts a Kubernetes job that runs one of Snakemake's job scripts, and prints its name.
# usage: submit.sh CPUS MEGABYTES MINUTES GPUS SCRIPT
#
#   GSPURE_IMAGE    container with Python and an OpenCL driver at the places where this machine has them
#   GSPURE_CLAIM    persistent volume claim that many pods may write to (ReadWriteMany)
#   GSPURE_VOLUME   where it is mounted, here as in the pods; the checkout, its .venv, data and results lie on it
set -eu
: "${GSPURE_IMAGE:?}" "${GSPURE_CLAIM:?}" "${GSPURE_VOLUME:?}"
cpus=$1 megabytes=$2 minutes=$3 gpus=$4 script=$5
limits="{}"
[ "$gpus" = 0 ] || limits="{nvidia.com/gpu: $gpus}"
kubectl create --output name --filename - << JOB
apiVersion: batch/v1
kind: Job
metadata: {generateName: gspure-, labels: {app: gspure}}
spec:
  backoffLimit: 0
  activeDeadlineSeconds: $((minutes * 60))
  ttlSecondsAfterFinished: 86400
  template:
    spec:
      restartPolicy: Never
      containers:
        - name: job
          image: "$GSPURE_IMAGE"
          command: [sh, "$script"]
          workingDir: "$PWD"
          resources: {requests: {cpu: $cpus, memory: ${megabytes}M}, limits: $limits}
          volumeMounts: [{name: shared, mountPath: "$GSPURE_VOLUME"}]
      volumes: [{name: shared, persistentVolumeClaim: {claimName: "$GSPURE_CLAIM"}}]
JOB
