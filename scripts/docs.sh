#!/usr/bin/env bash
# Builds the site of the documentation into target/docs; a broken link or anchor is a failure. Brings MkDocs Material with pip into
# target/docs-python, in the version below; Debian needs python3-venv for that.
set -euo pipefail
cd "$(dirname "$0")/.."
wanted='mkdocs==1.6.1 mkdocs-material==9.8.1'
tools=target/docs-python
if [ "$(cat "$tools/wanted" 2>/dev/null)" != "$wanted" ]; then
    python3 -m venv --clear "$tools"
    # shellcheck disable=SC2086 # two words
    "$tools/bin/pip" install --quiet --disable-pip-version-check $wanted
    echo "$wanted" >"$tools/wanted"
fi
# The theme prints an advertisement for its successor otherwise.
NO_MKDOCS_2_WARNING=1 "$tools/bin/mkdocs" build --strict --quiet
echo "target/docs/index.html"
