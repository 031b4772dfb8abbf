#!/usr/bin/env bash
# All that a machine with a GPU should be asked, in a few minutes, into one folder: gpu_report.sh [FOLDER]
# Every step keeps its output there, whatever becomes of the others; report.md puts the figures side by side for docs/performance.md.
# The adapter is the best one (WGPU_ADAPTER_NAME chooses). GPU_REPORT_SOFTWARE=1 takes a software adapter too, to try the script.
set -uo pipefail
cd "$(dirname "$0")/.."
folder=${1:-gpu-report}
program=target/release/stylet
[ -x "$program" ] || cargo build --release --locked || exit 1
mkdir -p "$folder" || exit 1
"$program" adapters >"$folder/adapters.txt" 2>&1
first=$(sed -n 's/^\* //p' "$folder/adapters.txt" | head -n 1)
if [ -z "$first" ] || { [[ $first == *", Cpu]"* ]] && [ "${GPU_REPORT_SOFTWARE:-0}" != 1 ]; }; then
    echo "no hardware adapter: ${first:-none at all} (GPU_REPORT_SOFTWARE=1 takes a software one)" >&2
    exit 2
fi
echo "$first"
failed=0
# step NAME SECONDS COMMAND...: its output, how it ended and how long it took
step() {
    local name=$1 limit=$2 begin=$SECONDS code
    shift 2
    timeout "$limit" "$@" >"$folder/$name.txt" 2>"$folder/$name.log"
    code=$?
    [ "$code" = 0 ] || failed=1
    printf '| %s | %s | %s s | `%s` |\n' "$name" "$([ "$code" = 0 ] && echo ok || echo "FAILED, exit $code")" $((SECONDS - begin)) "$*" |
        tee -a "$folder/steps.md"
}
: >"$folder/steps.md"
step main_job 60 "$program" run --engine gpu --out "$folder/main_job" --force
step opening 60 "$program" run scenes/opening.toml --engine gpu --out "$folder/opening" --force
step compare 90 "$program" compare-adapters --set motion.phase.0.depth_mm=4.0
step bench 150 "$program" bench --engine gpu --max-cells 2000000
step bench_processor 60 "$program" bench --engine cpu --max-cells 25000
step stages 60 "$program" bench --stages --engine gpu
step roofline 60 "$program" bench --roofline --engine gpu
step effects 120 "$program" bench --effects --engine gpu
step stability 120 "$program" stability --short --engine gpu --out "$folder/stability"
{
    echo "# $first, $(date -u +%Y-%m-%d)"
    echo
    echo "stylet $("$program" --version | cut -d' ' -f2), commit $(git rev-parse --short HEAD 2>/dev/null || echo unknown)"
    printf '\n| step | ended | took | command |\n|---|---|---|---|\n'
    cat "$folder/steps.md"
    for name in adapters main_job opening compare bench bench_processor stages roofline effects stability; do
        printf '\n## %s\n\n```text\n' "$name"
        cat "$folder/$name.txt"
        echo '```'
    done
} >"$folder/report.md"
echo "$folder/report.md; pictures in $folder/main_job and $folder/opening"
exit "$failed"
