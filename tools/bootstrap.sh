# shellcheck shell=bash
# Sourced by tools/pvid and tools/test: on Debian or Ubuntu it installs what is missing, keeps a virtual
# environment in build/venv and the C core in build/host, and costs next to nothing when all is there.
#
# Standard output belongs to the program; everything here speaks on standard error, one line a step, and
# leaves the full output of each step in build/log.

root=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.." && printf '%s/' "$PWD") # a newline at its end stays
root=${root%/}
build=$root/build
venv=$build/venv
python=$venv/bin/python
unset PYTHONHOME PYTHONPATH # they would reach into the environment, or replace it
# The matrices here are small: a second thread brings nothing, and spins where the other processors are busy.
export OPENBLAS_NUM_THREADS=1
trap 'exit 130' INT # also where the step that was interrupted, like pip, turns it into a failure of its own

say() { printf 'pvid: %s\n' "$*" >&2; }

die() {
    say "$*"
    exit 2
}

case $root in
*[\"\$\;\|\>:\\]* | *[[:cntrl:]]*)
    printf -v shown %q "$root"
    die "nothing can be built in $shown: CMake or venv stumble over \", \$, ;, |, >, :, \\ or a line break in a folder's name"
    ;;
esac

# logged NAME COMMAND...: runs a step; its output goes to build/log/NAME.log, the end of it to the terminal
# when the step fails.
logged() {
    local log=$build/log/${1//\//-}.log
    shift
    if ! "$@" >"$log" 2>&1 </dev/null; then
        tail -n 30 "$log" >&2
        return 1
    fi
}

# One preparation at a time; the program itself runs unlocked.
lock() {
    mkdir -p "$build/log" 2>/dev/null || die "cannot write $build: its folder belongs to $(stat -c %U "$root")"
    exec 9>"$build/.lock"
    flock -n 9 || {
        say "waiting for another run to finish its preparation"
        flock 9
    }
}

unlock() { exec 9>&-; }

# ---- Debian packages ----

# The packages of PROFILE that are missing, judged by what they bring, so that a tool installed in another way
# counts. Profiles: python (to make the environment), pvid (to run), demo (to build for the Cortex-M boards and emulate
# them besides), targets (the same for every board), test (to test, all of that and more).
missing_packages() {
    local missing=()
    need() { # need PACKAGE CHECK...
        local package=$1
        shift
        "$@" >/dev/null 2>&1 || missing+=("$package")
    }
    if ! environment_is_ready; then
        need python3 command -v python3
        local candidate
        candidate=$(system_python)
        if [[ -z $candidate ]] && command -v python3 >/dev/null; then
            die "Python 3.11 or later is needed; $(python3 --version 2>&1) is too old"
        fi
        need python3-venv "${candidate:-false}" -c 'import ensurepip, venv'
    fi
    if [[ $1 != python ]]; then
        need gcc command -v gcc
        need libc6-dev test -e /usr/include/stdio.h
        need cmake command -v cmake
        need ninja-build command -v ninja
    fi
    if [[ $1 == test || $1 == targets || $1 == demo ]]; then
        # No C library for ARM and RISC-V: firmware/ports does without.
        need gcc-arm-none-eabi command -v arm-none-eabi-gcc
        need qemu-system-arm command -v qemu-system-arm
    fi
    if [[ $1 == test || $1 == targets ]]; then
        need ccache command -v ccache
        need gcc-riscv64-unknown-elf command -v riscv64-unknown-elf-gcc
        need qemu-system-misc command -v qemu-system-riscv32
        need gcc-avr command -v avr-gcc
        need avr-libc test -e /usr/lib/avr/include/avr/io.h
        need simavr command -v simavr
        need libsimavr-dev test -e /usr/include/simavr/sim_avr.h
        need libelf-dev test -e /usr/include/libelf.h
    fi
    if [[ $1 == test ]]; then
        need binutils command -v readelf
        need chromium command -v chromium
        need chromium-driver command -v chromedriver
        need clang command -v clang
        need clang-tidy command -v clang-tidy
        need cppcheck command -v cppcheck
        need doxygen command -v doxygen
        need frama-c-base command -v frama-c
        need g++ command -v g++
        need gcc-powerpc-linux-gnu command -v powerpc-linux-gnu-gcc
        need libc6-dev-powerpc-cross test -e /usr/powerpc-linux-gnu/include/stdio.h
        need libclang-rt-dev links_with clang -fsanitize=address,undefined
        need llvm command -v opt
        need libcmocka-dev test -e /usr/include/cmocka.h
        need pkg-config command -v pkg-config
        need qemu-user command -v qemu-ppc
        need shellcheck command -v shellcheck
        need valgrind command -v valgrind
        need why3 command -v why3
        need z3 command -v z3
        if [[ $(uname -m) == x86_64 ]]; then
            # Not gcc-multilib: it excludes every cross compiler, that for PowerPC too.
            need "gcc-$(gcc -dumpversion 2>/dev/null || echo 12)-multilib" links_with gcc -m32
        fi
    fi
    printf '%s' "${missing[*]}"
}

# links_with COMPILER OPTION...: whether a program that includes a system header compiles and links.
links_with() {
    printf '#include <stdio.h>\nint main(void) { return 0; }\n' | "$@" -x c - -o /dev/null
}

as_root() {
    if ((EUID == 0)); then "$@"; else sudo -n "$@"; fi
}

apt_get() {
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -y -o DPkg::Lock::Timeout=200 "$@"
}

# apt_install PROFILE: what is missing of it; ends the shell with one sentence if it cannot be had.
apt_install() {
    local missing packages
    missing=$(missing_packages "$1")
    [[ -n $missing ]] || return 0
    read -ra packages <<<"$missing"
    if ! logged "apt-$1" apt_get install --no-install-recommends "${packages[@]}" 2>/dev/null; then
        # No lists of packages, or old ones; or an installation that was interrupted.
        say "updating the lists of Debian packages"
        as_root dpkg --configure -a >"$build/log/dpkg.log" 2>&1 </dev/null || true
        logged apt-update apt_get update || die "apt-get update failed; its output is above"
        logged "apt-$1" apt_get install --no-install-recommends "${packages[@]}" ||
            die "apt-get install failed; its output is above"
    fi
    hash -r
    missing=$(missing_packages "$1")
    [[ -z $missing ]] || die "still missing after the installation: $missing"
}

# install_packages PROFILE: those of Python at once, the others beside what the caller does next, and the core as soon as
# there is a compiler. It is never interrupted, and no exit leaves it alone.
install_packages() {
    local missing
    missing=$(missing_packages "$1")
    [[ -n $missing ]] || return 0
    command -v apt-get >/dev/null || die "missing: $missing (Debian's names); install them and try again"
    if ((EUID != 0)) && ! sudo -n true 2>/dev/null; then
        die "missing packages; run as root: apt-get install -y --no-install-recommends $missing"
    fi
    say "installing Debian packages: $missing"
    apt_install python
    trap '' INT # before the fork: set in the child it would come too late
    exec {installed}< <(
        exec 9>&- # the lock is not its own
        apt_install pvid
        build_core &
        failed=
        (apt_install "$1") || failed=yes
        wait $! && [[ -z $failed ]] && echo ready
    )
    installer=$!
    trap 'kill -0 "$installer" 2>/dev/null && say "waiting until apt-get has ended"; wait "$installer"' EXIT
    trap 'exit 130' INT
}

# await_packages: until all that `install_packages` has begun is there.
await_packages() {
    [[ -n ${installer-} ]] || return 0
    read -r <&"$installed" || { # it has printed why
        trap - EXIT
        exit 2
    }
    hash -r
}

# can_install: whether there is anybody to install packages.
can_install() {
    command -v apt-get >/dev/null && { ((EUID == 0)) || sudo -n true 2>/dev/null; }
}

# ---- the virtual environment ----

# The system's own interpreter first: one that a version manager puts in front may vanish with its settings.
system_python() {
    local candidate
    for candidate in /usr/bin/python3 python3 python3.14 python3.13 python3.12 python3.11; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            command -v "$candidate"
            return
        fi
    done
}

# What the environment hangs on: where it stands and which interpreter it was made with.
environment_identity() { printf '%s\n%s' "$root" "$(readlink -f "$python")"; }

environment_is_ready() {
    [[ -x $python && -f $venv/made && $(<"$venv/made") == "$(environment_identity)" ]]
}

# write_stamp FILE TEXT: whole or not at all.
write_stamp() {
    printf '%s' "$2" >"$1.new"
    mv "$1.new" "$1"
}

make_environment() {
    environment_is_ready && return
    local interpreter
    interpreter=$(system_python)
    [[ -n $interpreter ]] || die "Python 3.11 or later is needed; $(python3 --version 2>&1) is too old"
    say "making the virtual environment build/venv with $("$interpreter" --version)"
    rm -rf "$venv"
    logged venv "$interpreter" -m venv "$venv" || die "python3 -m venv failed; its output is above"
    write_stamp "$venv/made" "$(environment_identity)"
}

# paths: pvid itself, and tools/bench behind the installed packages, so that no module of tools/ hides one of theirs.
# Bytecode is kept in the environment, also where PYTHONDONTWRITEBYTECODE keeps it out of the sources: without it each
# process compiles some 1700 modules, which takes 4 s.
paths() {
    printf '%s\n' "$root/host/src" "$root/tools" \
        'import sys; sys.dont_write_bytecode = False; sys.pycache_prefix = sys.prefix + "/bytecode"'
}

# What the installed packages hang on.
requirements() { { cat "$root/host/pyproject.toml" "$root/tools/requirements.txt" && paths; } | sha256sum; }

requirements_are_installed() { # requirements_are_installed PROFILE
    local wanted stamp
    wanted=$(requirements)
    for stamp in "$venv/installed-test" "$venv/installed-more" "$venv/installed-$1"; do
        [[ $1 != test || $stamp == *-test ]] || continue
        [[ -f $stamp && $(<"$stamp") == "$wanted" ]] && return
    done
    return 1
}

# by_uv FILE OPTION...: installs the packages of a file, from the registry that pip is told of. Its own wheel is one of
# the lock file; where a processor has none, or uv fails, pip does it: with a tenth of the speed.
by_uv() {
    local file=$1 uv=$venv/bin/uv index
    shift
    [[ -x $uv ]] || return 1
    index=${PIP_INDEX_URL-$("$python" -m pip config get global.index-url 2>/dev/null || true)}
    [[ -z $index ]] || export UV_DEFAULT_INDEX=${UV_DEFAULT_INDEX:-$index}
    [[ -z ${PIP_FIND_LINKS-} ]] || export UV_FIND_LINKS=${UV_FIND_LINKS:-$PIP_FIND_LINKS}
    [[ -z ${PIP_CERT-} ]] || export SSL_CERT_FILE=${SSL_CERT_FILE:-$PIP_CERT}
    "$uv" pip install --python "$python" --require-hashes "$@" --requirement "$file" >"$build/log/uv.log" 2>&1 </dev/null
}

# The packages of the lock file, each with its hash: those that others are built with first, for what is fetched to
# build with is not checked. Then pvid itself.
install_requirements() { # install_requirements PROFILE
    # Modules are compiled when they are first imported: compiling all of them takes as long as the download.
    local lock=$root/tools/requirements.txt
    local pip=("$python" -m pip install --disable-pip-version-check --no-input --no-compile --require-hashes)
    requirements_are_installed "$1" && return
    say "installing Python packages: those of tools/requirements.txt"
    rm -f "$venv"/installed-*
    sed '/^# to build with$/,$d' "$lock" >"$venv/installer.txt"
    sed '/^# to use pvid$/,$d' "$lock" | sed '1,/^# to build with$/d' >"$venv/builders.txt"
    logged uv-installer "${pip[@]}" --only-binary :all: --requirement "$venv/installer.txt" 2>/dev/null || true
    if [[ $1 != test ]]; then
        local without="# for the tests alone"
        [[ $1 == more ]] || without="# for parquet, mcap and campaigns"
        sed "/^$without\$/,\$d" "$lock" >"$venv/requirements.txt"
        lock=$venv/requirements.txt
    fi
    sed '1,/^# to build with$/d' "$lock" >"$venv/wanted.txt"
    local failed="pip install failed; its output is above"
    by_uv "$venv/builders.txt" --only-binary :all: ||
        logged pip-builders "${pip[@]}" --only-binary :all: --requirement "$venv/builders.txt" || die "$failed"
    by_uv "$venv/wanted.txt" --no-build-isolation ||
        logged pip "${pip[@]}" --no-build-isolation --requirement "$venv/wanted.txt" || die "$failed"
    # 65 MB of nothing that is used here: the tests that numpy, scipy, sympy and matplotlib bring along, the C code that
    # fontTools was made from, what others were built with, and bytecode where it is not looked for (`paths`).
    local packages
    packages=$("$python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
    find "$packages"/{numpy,scipy,sympy,matplotlib} -type d -name tests -prune -exec rm -rf {} + 2>/dev/null || true
    find "$packages"/fontTools -name "*.c" -delete 2>/dev/null || true
    [[ $1 == test ]] || rm -rf "$venv"/bin/uv{,x} "$packages"/{uv,uv-*.dist-info} \
        "$packages"/{setuptools,setuptools-*.dist-info,_distutils_hack,distutils-precedence.pth}
    find "$packages" -type d -name __pycache__ -prune -exec rm -rf {} +
    paths >"$packages/pvid.pth"
    write_stamp "$venv/installed-$1" "$(requirements)"
}

# ---- the C core ----

# build_tree NAME TARGET CMAKE_OPTION...: configures build/NAME when it is new or was configured otherwise, and
# builds what has changed of TARGET.
build_tree() {
    local name=$1 tree=$build/$1 target=$2
    shift 2
    local wanted="$root $*"
    if [[ ! -f $tree/build.ninja || ! -f $tree/configured || $(<"$tree/configured") != "$wanted" ]]; then
        say "configuring build/$name"
        rm -rf "$tree"
        logged "configure-$name" cmake -S "$root" -B "$tree" -G Ninja "$@" || return 1
        write_stamp "$tree/configured" "$wanted"
    fi
    logged "build-$name" ninja -C "$tree" "$target"
}

# took_effect LIBRARY OPTIONS: the compilers' own record in it (-frecord-gcc-switches) shows, for every object,
# each of OPTIONS and the one that keeps a*b+c from being fused.
took_effect() {
    local wanted option commands reached
    read -ra wanted <<<"-ffp-contract=off $2"
    commands=$(readelf -p .GCC.command.line "$1" | grep -E '^ +\[') || true
    for option in "${wanted[@]}"; do
        reached=$(grep -c -E -e " $option( |\$)" <<<"$commands") || true
        if ((reached != $(wc -l <<<"$commands"))); then
            say "$1: $option did not reach the compiler"
            return 1
        fi
    done
}

build_core() {
    build_tree host pvid_native -DCMAKE_C_COMPILER=gcc -DPVID_BUILD_TESTS=OFF ||
        die "the C core did not build; see above"
}

# ---- another user's clone ----

# What somebody else has prepared, root for instance, is used as it is.
is_ours() {
    local part
    for part in "" /log /.lock; do
        [[ ! -e $build$part || -w $build$part ]] || return 1
    done
}

# use_as_it_is PROFILE: ends the program when something is missing or older than its sources.
use_as_it_is() {
    if ! { environment_is_ready && requirements_are_installed "$1" && core_is_built; }; then
        die "$build belongs to $(stat -c %U "$build") and is not ready: let them run tools/pvid, or use your own clone"
    fi
}

core_is_built() {
    [[ -f $build/host/build.ninja ]] &&
        ninja -C "$build/host" -n pvid_native 2>/dev/null | grep -q 'no work to do'
}

# prepare PROFILE [more]: as above; "more" adds what parquet, mcap and campaigns need.
prepare() {
    local profile=$1 python_profile=${2:-pvid}
    [[ $1 != test ]] || python_profile="test"
    if ! is_ours; then
        use_as_it_is "$python_profile"
        return
    fi
    lock
    # The demo does without a board where nobody may install one, and says so.
    if [[ $profile == demo ]] && ! can_install; then profile=pvid; fi
    install_packages "$profile"
    make_environment
    install_requirements "$python_profile"
    await_packages
    build_core
    trap - EXIT
    unlock
}
