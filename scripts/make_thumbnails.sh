#!/usr/bin/env bash
# Draws the pictures on the cards of the start screen, assets/thumbnails/*.png, with the program itself: the reference attempt of every task
# some frames in, the view alone. Needs a build with --features window and a display (or xvfb-run).
set -euo pipefail
cd "$(dirname "$0")/.."
program=${STYLET:-target/release/stylet}
settings=$(mktemp -d)
trap 'rm -rf "$settings"' EXIT
printf 'version = 1\nfolded = ["left", "right"]\ntheme = "dark"\n' > "$settings/settings.toml"
mkdir -p assets/thumbnails
for scene in scenes/training/*.toml scenes/anatomy/*.toml; do
    name=$(basename "$scene" .toml)
    "$program" view "$scene" --script --speed-factor 4 --frames "${FRAMES:-60}" --size 320 250 \
        --settings "$settings/settings.toml" --picture "assets/thumbnails/$name.png"
done
