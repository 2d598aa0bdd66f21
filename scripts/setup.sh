#!/usr/bin/env bash
# Make .venv with everything Prelight and its tests need, from a bare Debian or Ubuntu. Safe to run again.
# With --browser also Debian's Chromium, which the tests of the studio's page use; without it they are skipped.
set -euo pipefail
cd "$(dirname "$0")/.."
PATH="${PATH:-/usr/bin:/bin}:/usr/sbin:/sbin" # ldconfig lives in sbin
export PATH PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1
[ -n "${HOME:-}" ] || export PIP_NO_CACHE_DIR=1

say() { printf 'setup: %s\n' "$*" >&2; }
stop() { say "$*"; exit 1; }

find_python() { # the first interpreter that is new enough; prints its full path
    local name
    for name in python3 python3.13 python3.12 python3.11 python3.14; do
        "$name" -c 'import sys; sys.version_info >= (3, 11) or sys.exit(1); print(sys.executable)' 2>/dev/null && return
    done
    return 1
}

newest_llvm() { # major version of the newest LLVM the loader knows, or 0
    sed -nE 's/^[[:space:]]*libLLVM(-|\.so\.)([0-9]+).*/\2/p' <<<"$libraries" | sort -n | tail -n 1 | grep . || echo 0
}

newest_llvm_package() { # the LLVM package of this distribution: 19 if there is one, else the next
    local version
    for version in 19 20 21 22; do
        if [ -n "$(apt-cache policy "libllvm$version" 2>/dev/null | sed -n 's/^ *Candidate: *\([0-9].*\)/\1/p')" ]; then
            echo "libllvm$version"
            return
        fi
    done
    echo libllvm19
}

missing_packages() { # names of the system packages that are not there yet
    "$python" -c 'import ensurepip, venv' 2>/dev/null ||
        "$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])'
    [ "$(uname -s)" = Linux ] || return 0
    local library libraries
    libraries=$(ldconfig -p 2>/dev/null || true)
    [ "$(newest_llvm)" -ge 19 ] || newest_llvm_package
    for library in libgomp libatomic; do # Numba's threads; Dr.Jit
        [[ $libraries == *"$library.so.1 "* ]] || echo "${library}1"
    done
}

install_packages() { # with apt, if we may; otherwise say in one line what to run
    local as_root=()
    if [ "$(id -u)" != 0 ]; then
        sudo -n true 2>/dev/null || stop "please run, then try again:  sudo apt-get install -y $*"
        as_root=(sudo -n)
    fi
    say "installing $*"
    local log
    log=$("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "$@" 2>&1) ||
        stop "apt-get could not install $*: ${log##*$'\n'}"
}

has_browser() { command -v chromium chromium-browser google-chrome >/dev/null 2>&1; }

install_browser() { # where the distribution has it as a package and we may; it is never needed to use Prelight
    [[ $(apt-cache policy chromium 2>/dev/null) =~ Candidate:\ *[0-9] ]] || return 1
    if [ "$(id -u)" != 0 ] && ! sudo -n true 2>/dev/null; then return 1; fi
    (install_packages chromium)
}

python=$(find_python) ||
    stop "Python 3.11 or newer is needed and was not found; install python3.11 (or newer) and its -venv package"

if [ -n "$(missing_packages)" ]; then
    command -v apt-get >/dev/null ||
        stop "please install with your package manager: LLVM 19 or newer, libgomp, libatomic, and Python's venv module"
    if [ "$(id -u)" = 0 ]; then apt-get update -qq || true; else sudo -n apt-get update -qq 2>/dev/null || true; fi
    # Asked again: only after the update does apt know which LLVM this distribution has.
    # shellcheck disable=SC2046
    install_packages $(missing_packages)
fi

if [ "${1:-}" = --browser ] && ! has_browser; then
    if [ "$(id -u)" = 0 ]; then apt-get update -qq 2>/dev/null || true; fi
    install_browser || say "no chromium here: tests of the studio's page will be skipped (sudo apt-get install -y chromium)"
fi

# What .venv was made from: another lock, interpreter or place means making it anew.
stamp="$(cat requirements.lock pyproject.toml | sha256sum | cut -d' ' -f1) $python $PWD"
if [ "$(cat .venv/made-from 2>/dev/null)" != "$stamp" ]; then
    say "making .venv with $("$python" --version) (a few minutes the first time, 0.8 GB)"
    "$python" -m venv --clear .venv
    .venv/bin/python -m pip install -qq --require-hashes --only-binary :all: -r requirements.lock
    .venv/bin/python -m pip install -qq --no-deps --no-build-isolation --editable .
    printf '%s\n' "$stamp" >.venv/made-from
fi
