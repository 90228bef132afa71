#!/bin/sh
# Get a Chromium for the viewer's tests: one that is installed, else playwright's own, else the
# system's by its package manager, where that may be called without a question. $1: the playwright
# command.
set -u

for name in chromium chromium-browser google-chrome google-chrome-stable; do
    command -v "$name" && exit 0
done
"$1" install chromium && exit 0

as_root=""
if [ "$(id -u)" != 0 ]; then
    as_root="sudo -n"
    $as_root true 2>/dev/null || as_root="none"
fi
if [ "$as_root" != none ]; then
    if command -v apt-get >/dev/null; then
        $as_root apt-get update -qq &&
            $as_root apt-get install -y -qq --no-install-recommends chromium && exit 0
    elif command -v dnf >/dev/null; then
        $as_root dnf install -y -q chromium && exit 0
    elif command -v pacman >/dev/null; then
        $as_root pacman -S --noconfirm --quiet chromium && exit 0
    elif command -v apk >/dev/null; then
        $as_root apk add --quiet chromium && exit 0
    fi
fi
echo "no Chromium: the viewer's tests in the browser will be skipped;" \
    "install the package 'chromium' and run make again"
