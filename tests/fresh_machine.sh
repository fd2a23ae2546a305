#!/usr/bin/env bash
# Run `make demo` and `make test` on fresh Debian installations.
#
# Each suite is bootstrapped into a temporary folder with nothing but Python, venv,
# make and git, and gets a clone of HEAD. Mirror, pip settings and certificates are
# those of this machine. Needs root, debootstrap, the network, and 4 GB below TMPDIR.
set -euo pipefail

readonly PACKAGES=python3,python3-venv,make,git,ca-certificates
readonly CERTIFICATES=/etc/ssl/certs/ca-certificates.crt
# Variables that say how a registry is reached.
readonly NETWORK='^(PIP_[A-Z_]*|SSL_CERT_FILE|REQUESTS_CA_BUNDLE|CURL_CA_BUNDLE)='
# What make demo must leave: a film, a curve, a report, and a small environment.
# shellcheck disable=SC2016 # the shell in the clone expands it
readonly CHECKS='set -e; set -- runs/demo-*; test $# -eq 1
head -c 6 "$1/best.gif" | grep -q GIF89a
head -c 4 "$1/fitness.png" | grep -q PNG
grep -q "</html>" "$1/report/report.html"
test "$(du -sm .venv | cut -f 1)" -le 1050; du -sm .venv'
readonly PROXIES='^((http|https|no|all)_proxy|(HTTP|HTTPS|NO|ALL)_PROXY)='

usage() {
    cat << 'END'
usage: tests/fresh_machine.sh [--demo-only | --pytest WORDS] [SUITE ...]

  SUITE           release of Debian (default: bookworm, the oldest supported Python,
                  and sid, the newest)
  --demo-only     run only make demo
  --pytest WORDS  after make demo run pytest with these words instead of make test

MIRROR=ADDRESS names the mirror of Debian (default: that of apt on this machine).
END
}

# The address of the first archive of Debian that apt knows.
mirror() {
    # shellcheck disable=SC2016 # apt-get fills in the fields, not the shell
    apt-get indextargets --format '$(COMPONENT) $(REPO_URI)' 'Created-By: Packages' \
        2> /dev/null | sed -n '/-security/d; s/^main //p' | head -n 1
}

# One line of what is missing on this machine; nothing if all is there.
missing() {
    local tool
    {
        [ "$(id -u)" -eq 0 ] || echo 'root'
        for tool in debootstrap unshare git; do
            command -v "$tool" > /dev/null || echo "the command $tool"
        done
        [ -n "${MIRROR:-$(mirror)}" ] || echo 'a mirror of Debian (MIRROR=ADDRESS)'
    } | paste -s -d ,
}

# Files of pip's settings, as far as they are there.
pip_files() {
    ls 2> /dev/null /etc/pip.conf /etc/xdg/pip/pip.conf "$HOME/.pip/pip.conf" \
        "${XDG_CONFIG_HOME:-$HOME/.config}/pip/pip.conf" "${PIP_CONFIG_FILE:-}" || true
}

# Files and folders that these settings and variables name, such as certificates.
named_files() {
    { env | grep -E "$NETWORK"; pip_files | xargs -r -d '\n' cat; } \
        | sed -n 's|^[^=]*= *\(/[^ ]*\)$|\1|p' || true
}

# Copy the settings of the network into a root folder, each to the same path.
copy_settings() {
    local root=$1 path
    mkdir -p "$root$HOME"
    { echo /etc/resolv.conf; echo /etc/hosts; echo "$CERTIFICATES"; pip_files; named_files; } \
        | sort -u | while read -r path; do
            [ -e "$path" ] || continue
            mkdir -p "$root$(dirname "$path")"
            # A link in the root folder would lead out of it.
            cp -RLT --remove-destination "$path" "$root$path"
        done
}

# What programs need of a running system. The caller has mounts of its own.
mount_system() {
    mount -t proc proc "$1/proc"
    mount -t sysfs -o ro sysfs "$1/sys"
    mkdir -p "$1/dev/pts" "$1/dev/shm"
    mount -t devpts -o newinstance,ptmxmode=0666,mode=0620 devpts "$1/dev/pts"
    mount -t tmpfs -o mode=1777 tmpfs "$1/dev/shm"
}

# Run a command in the clone within a root folder, with a fresh environment.
within() {
    local root=$1 settings
    shift
    mapfile -t settings < <(env | grep -E "$NETWORK|$PROXIES")
    env -i "${settings[@]}" HOME="$HOME" LANG=C.UTF-8 \
        PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        chroot "$root" sh -c 'cd /revolve-islands && exec "$@"' sh "$@" < /dev/null
}

# Add a line to the report: suite, result, duration, what was run.
report() {
    printf '%-10s %-12s %5d s  %s\n' "$@" >> "$place/report"
}

# Run a command within a root folder and report its result.
step() {
    local suite=$1 root=$2 result=passed start=$SECONDS
    shift 2
    printf '\n== %s: %s\n' "$suite" "$*"
    within "$root" "$@" || result="FAILED ($?)"
    report "$suite" "$result" $((SECONDS - start)) "$*"
    [ "$result" = passed ]
}

# Install a suite into a folder.
bootstrap() {
    local suite=$1 root=$2 proxy=''
    eval "$(apt-config shell proxy Acquire::http::Proxy 2> /dev/null)"
    [ -z "$proxy" ] || local -x http_proxy=$proxy
    debootstrap --variant=minbase --include="$PACKAGES" "$suite" "$root" \
        "${MIRROR:-$(mirror)}" > "$place/log" 2>&1 || { tail -n 20 "$place/log"; return 1; }
}

# Bootstrap a suite, clone the project into it, and run its commands there.
try_suite() {
    local suite=$1 root=$place/$1 clone=$place/$1/revolve-islands result=0
    printf '\n== %s: bootstrap\n' "$suite"
    bootstrap "$suite" "$root"
    copy_settings "$root"
    mount_system "$root"
    git clone --quiet --no-hardlinks "$project" "$clone"
    git -C "$clone" checkout --quiet --detach "$commit"
    printf '%-10s %s, glibc %s, commit %.8s\n' "$suite" "$(within "$root" python3 -V)" \
        "$(within "$root" ldd --version | sed -n '1s/.* //p')" "$commit" \
        | tee -a "$place/report"

    step "$suite" "$root" make demo || result=1
    step "$suite" "$root" sh -c "$CHECKS" || result=1
    if [ -n "$pytest" ]; then
        # make demo installs no pytest.
        step "$suite" "$root" sh -c \
            "make compiled && .venv/bin/python -m pytest $pytest" || result=1
    elif [ -z "$demo_only" ]; then
        step "$suite" "$root" make test || result=1
    fi
    return "$result"
}

if [ "${1:-}" = --inside ]; then # with mounts and processes of its own, see below
    try_suite "$2"
    exit
fi

demo_only='' pytest='' suites=()
while [ $# -gt 0 ]; do
    case $1 in
        --demo-only) demo_only=yes ;;
        --pytest) pytest=${2:?--pytest needs words}; shift ;;
        -h | --help) usage; exit ;;
        -*) usage >&2; exit 2 ;;
        *) suites+=("$1") ;;
    esac
    shift
done
[ ${#suites[@]} -gt 0 ] || suites=(bookworm sid)

export PATH=$PATH:/usr/sbin:/sbin
lacks=$(missing)
if [ -n "$lacks" ]; then
    echo "fresh_machine.sh: missing: $lacks" >&2
    exit 2
fi

project=$(cd "$(dirname "$0")/.." && pwd)
commit=$(git -C "$project" rev-parse HEAD)
[ -z "$(git -C "$project" status --porcelain)" ] \
    || echo 'fresh_machine.sh: changes that are not committed are left out' >&2
place=$(mktemp -d)
export place project commit demo_only pytest

# Processes that were just killed may still write.
discard() {
    rm -rf --one-file-system "$@" 2> /dev/null \
        || { sleep 2; rm -rf --one-file-system "$@"; }
}

# shellcheck disable=SC2329 # the trap below calls it
finish() {
    printf '\n'
    cat "$place/report"
    discard "$place"
}

child=''
touch "$place/report"
trap finish EXIT
trap '[ -z "$child" ] || kill -KILL "$child"; exit 130' INT TERM

status=0
for suite in "${suites[@]}"; do
    start=$SECONDS result=passed
    # Mounts and processes of a suite end with unshare, whatever that ends by.
    unshare --mount --pid --fork --kill-child bash "$0" --inside "$suite" &
    child=$!
    wait "$child" || { result=FAILED; status=1; }
    child=''
    report "$suite" "$result" $((SECONDS - start)) 'all, with the bootstrap'
    discard "${place:?}/$suite"
done
exit "$status"
