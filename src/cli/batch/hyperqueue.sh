#!/bin/sh
# Submits the sweep {{name}} to HyperQueue. Run it with sh; its options go to `hq submit`.
# Tasks share what is left, whatever their number, and as many run as have room. More tasks follow those whose time is
# over until all is done; those that find nothing to do end at once.
mkdir -p {{logs}} && cd {{logs}} && exec hq submit \
    --stdout='%{JOB_ID}_%{TASK_ID}_%{INSTANCE_ID}.out' \
    --stderr='%{JOB_ID}_%{TASK_ID}_%{INSTANCE_ID}.err' \
    {{options}}"$@" -- \
    {{command}}
