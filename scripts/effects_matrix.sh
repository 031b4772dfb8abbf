#!/usr/bin/env bash
# The main job in the scheme ring, which knows all effects, with every effect alone, every pair and all together: force,
# energy and health of each run as a table. Fails where a run fails or misses 2 % of the energy. Takes 10 to 25 minutes on two cores.
# effects_matrix.sh [alone|pairs|all]...   default: all three
set -euo pipefail
cd "$(dirname "$0")/.."
program=${STYLET:-target/release/stylet}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
effects=(gravity plasticity fibres viscoelastic damage friction)
failed=0

value() { sed -n "s/^  \"$1\": \(.*[^,]\),\{0,1\}\$/\1/p" "$folder/run/summary.json"; }

# insertion EFFECT...: one run beside the needle; damage brings plasticity, which it needs.
insertion() {
    local list=(mass_scaling puncture "$@") more=(--set 'outputs.pictures_at_depth_mm=[]' --set 'outputs.fields_at_depth_mm=[]')
    if [[ " $* " == *" damage "* ]]; then
        [[ " $* " == *" plasticity "* ]] || list+=(plasticity)
        # In cells of 0.6 mm the default would snap back.
        more+=(--set damage.failure_displacement_mm=0.5)
    fi
    local keys status=ok
    keys=$(printf '"%s",' "${list[@]}")
    "$program" run scenes/calibrated/muscle_biopsy.toml --force --out "$folder/run" --set "effects=[${keys%,}]" \
        "${more[@]}" >"$folder/log" 2>&1 || status=FAILED
    local imbalance
    imbalance=$(value energy_imbalance)
    awk -v i="$imbalance" 'BEGIN { exit !(i + 0 == i && i <= 0.02 && i >= -0.02) }' || status=FAILED
    printf '%-66s %7.3f %7.3f %9.4f %7d %8d  %s\n' "${*:-(needle alone)}" "$(value puncture_force_n)" \
        "$(value force_at_max_depth_n)" "$imbalance" "$(value clamped_nodes)" "$(value inverted_cells)" "$status"
    if [ "$status" != ok ]; then
        tail -n 3 "$folder/log"
        failed=1
    fi
}

printf '%-66s %7s %7s %9s %7s %8s\n' 'effects beside mass_scaling and puncture' 'peak N' '12 mm N' 'imbalance' clamped inverted
for what in "${@:-alone pairs all}"; do
    for part in $what; do
        case $part in
            alone)
                insertion
                for effect in "${effects[@]}"; do insertion "$effect"; done
                ;;
            pairs)
                for ((i = 0; i < ${#effects[@]}; i++)); do
                    for ((j = i + 1; j < ${#effects[@]}; j++)); do insertion "${effects[i]}" "${effects[j]}"; done
                done
                ;;
            all) insertion "${effects[@]}" ;;
            *)
                echo "effects_matrix: no part called $part; use alone, pairs, all" >&2
                exit 2
                ;;
        esac
    done
done
exit $failed
