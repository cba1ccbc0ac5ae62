#!/usr/bin/env bash
# Packs the benches and the tests that compare the GPU with the CPU into a folder that runs without cargo, on a machine
# that need have nothing but a Vulkan driver: scripts/pack.sh FOLDER; there FOLDER/run.sh [RESULTS] [--quick].
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
if [ $# -ne 1 ]; then
    echo "usage: scripts/pack.sh FOLDER" >&2
    exit 2
fi
folder=$1
mkdir -p "$folder/tests" "$folder/benches"

# Executables as cargo names them, without the hash behind the name.
executables() {
    cargo "$@" --no-run --message-format=json | sed -n 's/.*"executable":"\([^"]*\)".*/\1/p'
}

executables test --release --tests | while read -r path; do
    name=$(basename "$path" | sed 's/-[0-9a-f]*$//')
    case $name in
    parity_* | primitives | contacts | draw | world_broadphase | world_capacity | world_determinism | queries*) cp "$path" "$folder/tests/$name" ;;
    esac
done
executables bench --features box3d | while read -r path; do
    name=$(basename "$path" | sed 's/-[0-9a-f]*$//')
    cp "$path" "$folder/benches/$name"
done
# A bench that is no more, or the library's own empty one, has no place here.
for bench in "$folder"/benches/*; do
    name=$(basename "$bench")
    [ -e "benches/$name.rs" ] || [ -e "benches/$name/main.rs" ] || rm "$bench"
done

# What debuggers want is most of their size.
if command -v strip >/dev/null; then
    strip --strip-debug "$folder"/tests/* "$folder"/benches/*
fi

cat >"$folder/run.sh" <<'RUN'
#!/usr/bin/env bash
# Runs what is packed here: every test, then every bench; tables, pictures and the report go to RESULTS (at first:
# results). PYTHON=FILE names an interpreter with the wheels of nexus and MuJoCo, for speed_vs_error.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
TUMBLE_COMMIT=$(cat commit)
export TUMBLE_COMMIT
results=${1:-results}
shift || true
mkdir -p "$results"
failed=0
for test in tests/*; do
    echo "== $test"
    "$test" >"$results/$(basename "$test").log" 2>&1 || { failed=1; echo "FAILED, see $results/$(basename "$test").log"; }
done
for bench in benches/*; do
    echo "== $bench"
    peers=()
    if [ "$bench" = benches/speed_vs_error ] && [ -n "${PYTHON:-}" ]; then
        peers=(--python "$PYTHON")
    fi
    "$bench" --out "$results" "${peers[@]}" "$@" 2>&1 | tee "$results/$(basename "$bench").txt" || failed=1
done
exit $failed
RUN
chmod +x "$folder/run.sh"
# What the tables tell they were measured at: there is no git where they are made.
commit=$(git rev-parse --short=10 HEAD)
[ -z "$(git status --porcelain --untracked-files=no)" ] || commit=$commit+
echo "$commit" >"$folder/commit"
echo "packed: $(ls "$folder/tests" "$folder/benches" | tr '\n' ' ')"
