#!/usr/bin/env bash
# A batch of photos as a SLURM array: one task for each shard. Give the files in the environment, and as many shards as the array
# has tasks:
#
#   export SCAN=scan.ply QUERIES=queries.json RESULTS=results.json SHARDS=20
#   job=$(sbatch --parsable --array=1-$SHARDS slurm.sh)
#   sbatch --dependency=afterany:$job --wrap "${GSSMC:-blender --command gssmc} merge --out $RESULTS"
#
# A task that was killed, or is submitted again with --array=7, goes on where it stopped. Further options of the command batch
# stand behind the script's name.
#SBATCH --job-name=gssmc
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=4
#SBATCH --output=gssmc-%A-%a.log
#SBATCH --requeue
set -euo pipefail
: "${SCAN:?the splat file}" "${QUERIES:?the camera JSON or data set folder with the photos}" "${RESULTS:?the JSON to be written}"
: "${SHARDS:?as many as the array has tasks}" "${SLURM_ARRAY_TASK_ID:?start this with sbatch --array=1-$SHARDS}"
read -ra program <<< "${GSSMC:-blender --command gssmc}"  # "python -m core" in a checkout works as well
exec "${program[@]}" batch "$SCAN" "$QUERIES" --out "$RESULTS" --shard "$SLURM_ARRAY_TASK_ID/$SHARDS" \
  --workers "${SLURM_CPUS_PER_TASK:-1}" --exit-zero "$@"
