#!/usr/bin/env bash
# Checks the figures of a main job against what README promises: check_main_job.sh FOLDER
set -euo pipefail
summary=$1/summary.json
value() { sed -n "s/^  \"$1\": \(.*[^,]\),\{0,1\}\$/\1/p" "$summary"; }
failed=0
# check KEY OPERATOR BOUND
check() {
    local seen
    seen=$(value "$1")
    if [ -n "$seen" ] && awk -v a="$seen" -v b="$3" "BEGIN { exit !(a + 0 == a && a $2 b) }"; then
        echo "ok      $1 = $seen ($2 $3)"
    else
        echo "FAILED  $1 = ${seen:-missing} (must be $2 $3)"
        failed=1
    fi
}
if [ "$(value status)" = '"ok"' ]; then echo 'ok      status'; else echo "FAILED  status $(value status)"; failed=1; fi
if [ "$(value engine)" = '"gpu"' ]; then echo 'ok      engine'; else echo "FAILED  engine $(value engine)"; failed=1; fi
check puncture_depth_m '>=' 0.0045
check puncture_depth_m '<=' 0.0052
check puncture_force_n '>=' 0.54
check puncture_force_n '<=' 0.59
check peak_force_n '>=' 1.08
check peak_force_n '<=' 1.2
check linear_fit_r2 '>=' 0.95
check energy_imbalance '<=' 0.002
check kinetic_to_internal '<=' 0.05
check hourglass_to_internal '<=' 0.05
check clamped_nodes '==' 0
check inverted_cells '==' 0
drop=$(awk -v a="$(value puncture_force_n)" -v b="$(value force_after_puncture_n)" 'BEGIN { print (a > 0) ? 1 - b / a : 0 }')
if awk -v d="$drop" 'BEGIN { exit !(d >= 0.2) }'; then echo "ok      drop = $drop (>= 0.2)"; else echo "FAILED  drop = $drop"; failed=1; fi
for file in force.csv energy.csv force.svg frames.pvd stress_12.00mm.png; do
    if [ -s "$1/$file" ]; then echo "ok      $file"; else echo "FAILED  $file is missing"; failed=1; fi
done
exit $failed
