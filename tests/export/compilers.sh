#!/bin/sh
# Get what the tests of exported C compile and run it with beside gcc and zig: clang, tcc, and gcc
# with qemu-user for ARM of 64 and 32 bits, by the system's package manager, where that may be
# called without a question. Tests of what is missing are skipped and say so.
set -u

wanted=""
command -v clang >/dev/null || wanted="$wanted clang"
command -v tcc >/dev/null || wanted="$wanted tcc"
command -v aarch64-linux-gnu-gcc >/dev/null ||
    wanted="$wanted gcc-aarch64-linux-gnu libc6-dev-arm64-cross"
command -v arm-linux-gnueabihf-gcc >/dev/null ||
    wanted="$wanted gcc-arm-linux-gnueabihf libc6-dev-armhf-cross"
command -v qemu-aarch64 >/dev/null || wanted="$wanted qemu-user"
[ -z "$wanted" ] && exit 0

as_root=""
if [ "$(id -u)" != 0 ]; then
    as_root="sudo -n"
    $as_root true 2>/dev/null || as_root="none"
fi
if [ "$as_root" != none ] && command -v apt-get >/dev/null; then
    # shellcheck disable=SC2086
    $as_root apt-get update -qq &&
        timeout 300 $as_root apt-get install -y -qq --no-install-recommends $wanted && exit 0
fi
echo "not there:$wanted; tests of exported C that need them will be skipped;" \
    "install these packages and run make again"
