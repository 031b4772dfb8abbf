#!/usr/bin/env bash
# Brings what is missing and runs all tests. REQUIRE_GPU=1 turns skipped GPU tests into failures.
# Arguments go to `cargo test`.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
# Release: the tests run whole scenes on both engines. All of them run, whatever fails.
exec cargo test --release --locked --no-fail-fast "$@"
