#!/usr/bin/env bash
# Brings what is missing and runs the main job: a needle goes 12 mm into a block of muscle and comes out again.
# Arguments go to `stylet run`.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
exec cargo run --release --locked -- run "$@"
