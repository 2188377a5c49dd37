#!/usr/bin/env bash
# Uses the HTML report of `skylit compare` in a browser without a window, as a person would, and fails if something goes wrong: a message in the console, a value
# that is not the file's, a control without a name, a page that is wider than the screen.
#
#   ./scripts/report.sh PROGRAM [FOLDER] [PAGE...]     PROGRAM: target/release/skylit; FOLDER: where reports and screenshots go [default: a temporary one];
#                                                      PAGE: the index.html of other reports, of which is tested what all reports have in common
#
# The browser is Chromium, which is installed here and nowhere else: it is large. SKYLIT_CHROMIUM names another program.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${1:?"the program to test, like target/release/skylit"}
folder=${2:-$(mktemp -d)}
shift "$(($# < 2 ? $# : 2))"
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
say() { printf 'report: %s\n' "$*"; }
die() { printf 'report: error: %s\n' "$*" >&2; exit 1; }

chromium=${SKYLIT_CHROMIUM:-$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)}
if [ -z "$chromium" ]; then
  command -v apt-get >/dev/null || die "no Chromium: install it, or name it in SKYLIT_CHROMIUM"
  if [ "$(id -u)" = 0 ]; then sudo=(); else sudo=(sudo); fi
  say "installing Chromium"
  "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=120 install -y --no-install-recommends chromium fonts-dejavu-core >/dev/null
  chromium=$(command -v chromium) || die "Chromium was installed and is not there"
fi

say "a report of images, and one of renders"
size=320x180
"$program" render builtin:stairs --quiet --spp 8 --size $size -o "$folder/ao.exr"
"$program" compare "$folder/ao.exr" --scene builtin:stairs --b "ao --spp 64 --seed 1" --c "ao --spp 64 --ao-radius 0.5" --size $size \
  --save "$folder/renders" --difference "$folder/difference.png" --flip "$folder/flip.png" --html "$folder/grey"
"$program" compare --scene builtin:cornell-box --a "direct --spp 4" --b "path --spp 8" --size 160x120 --save "$folder/colours" --html "$folder/colour" --quiet
say "in $chromium"
python3 scripts/report/browse.py --chromium "$chromium" --screenshots "$folder/screenshots" \
  --images "$folder/grey/index.html" "$folder/ao.exr" "$folder/renders/b.exr" "$folder/renders/c.exr" \
  --images "$folder/colour/index.html" "$folder/colours/a.exr" "$folder/colours/b.exr" -- "$@"
say "done: $folder"
