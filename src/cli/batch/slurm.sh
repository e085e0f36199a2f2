#!/bin/sh
# Submits the sweep {{name}} to Slurm. Run it with sh; its options go to sbatch.
mkdir -p {{logs}} && exec sbatch "$@" <<'EOF'
#!/bin/sh
#SBATCH --requeue
#SBATCH --open-mode=append
{{options}}# Elements share what is left, whatever their number; any of them may be missing or come twice. More elements than
# workers, such as --array=1-200%40, keep 40 at work until all is done; those that find nothing to do end at once.
# Threads are those of --cpus-per-task. Stops before --time is over, and on USR1 and TERM, with what is done kept.
exec {{command}}
EOF
