#!/usr/bin/env bash
# Uses the viewer's window on a display without a screen (Xvfb) as a person would, by real events of mouse and keys (xdotool), and fails if something goes wrong.
#
#   ./scripts/viewer.sh PROGRAM [FOLDER]     PROGRAM: target/release/skylit; FOLDER: where images go [default: a temporary one]
#
# Needs Xvfb and xdotool, which scripts/setup.sh installs. Where xwd is installed (x11-apps), pictures of the window are kept as FOLDER/*.xwd.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${1:?"the program to test, like target/release/skylit"}
folder=${2:-$(mktemp -d)}
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
say() { printf 'viewer: %s\n' "$*"; }
die() { printf 'viewer: error: %s\n' "$*" >&2; cat "$folder/log" >&2 || true; exit 1; }
for tool in Xvfb xdotool; do command -v "$tool" >/dev/null || die "$tool is missing: run ./scripts/setup.sh"; done

viewer='' server=''
trap 'kill $viewer $server 2>/dev/null || true' EXIT
# Xvfb chooses the number of the display
mkfifo "$folder/number" 2>/dev/null || true
Xvfb -displayfd 3 -screen 0 1280x800x24 -nolisten tcp 3<> "$folder/number" 2> "$folder/xvfb" &
server=$!
read -r -t 30 number < "$folder/number" || die "Xvfb does not start: $(cat "$folder/xvfb")"
rm -f "$folder/number"
export DISPLAY=:$number
unset WAYLAND_DISPLAY
# a stand-in for the system's file dialog, which chooses what it is told
mkdir -p "$folder/bin"
printf '#!/bin/sh\ncat "%s"\n' "$folder/chosen" > "$folder/bin/zenity"
chmod +x "$folder/bin/zenity"
export PATH=$folder/bin:$PATH DBUS_SESSION_BUS_ADDRESS=unix:path=/nonexistent

# open_viewer SCENE OPTION...: starts the viewer and waits for its window
open_viewer() {
  "$program" view "$@" > "$folder/log" 2>&1 &
  viewer=$!
  window=
  for _ in $(seq 300); do
    kill -0 "$viewer" 2>/dev/null || die "the viewer has ended"
    window=$(xdotool search --onlyvisible --pid "$viewer" 2>/dev/null | tail -1) && [ -n "$window" ] && break
    sleep 0.1
  done
  [ -n "$window" ] || die "the viewer has no window"
  # there is no window manager to give it the keys
  xdotool windowfocus --sync "$window"
}
alive() { kill -0 "$viewer" 2>/dev/null || die "the viewer has ended after: $1"; }
wait_for() { # wait_for SECONDS WHAT TEST...
  local seconds=$1 what=$2
  shift 2
  for _ in $(seq "$((10 * seconds))"); do
    "$@" && return 0
    alive "$what"
    sleep 0.1
  done
  die "waited $seconds s for $what"
}
picture() { if command -v xwd >/dev/null; then xwd -silent -id "$window" -out "$folder/$1.xwd"; fi; }
titled() { [[ "$(xdotool getwindowname "$window")" == *"$1"* ]]; }
key() { xdotool key --clearmodifiers "$@" && sleep 0.3 && alive "key $*"; }
drag() { # drag BUTTON X Y TO_X TO_Y
  xdotool mousemove --window "$window" "$2" "$3" mousedown "$1"
  for k in 1 2 3 4 5 6 7 8; do
    xdotool mousemove --window "$window" $(($2 + ($4 - $2) * k / 8)) $(($3 + ($5 - $3) * k / 8))
    sleep 0.06
  done
  xdotool mouseup "$1" && sleep 0.2 && alive "a drag with button $1"
}
# save NAME: saves the image by the dialog and waits for the file
save() {
  xdotool key --clearmodifiers ctrl+s && sleep 0.7
  xdotool key --clearmodifiers ctrl+a && sleep 0.2
  xdotool type --clearmodifiers --delay 30 "$folder/$1" && sleep 0.2
  xdotool key --clearmodifiers Return
  wait_for 60 "$1" test -s "$folder/$1"
}

say "a scene, orbited, in a window of 1000x640"
open_viewer builtin:stairs --size 1000x640
wait_for 60 "the scene" titled stairs
sleep 2
save first.png
picture first
drag 1 300 300 450 330
drag 2 300 300 330 280
drag 3 300 300 320 290
xdotool mousemove --window "$window" 300 300 click --repeat 3 4 && sleep 0.3
xdotool mousemove --window "$window" 300 300 click 1 && sleep 0.3
xdotool mousemove --window "$window" 300 300 click --repeat 2 --delay 80 1 && sleep 0.5
xdotool keydown w && sleep 0.5 && xdotool keyup w
save orbited.png
picture orbited
cmp -s "$folder/first.png" "$folder/orbited.png" && die "the camera has not moved"
for k in 1 3 4 5 x space space t question Escape n n b u u f 2; do key "$k"; done
say "other sizes"
for size in "1280 760" "640 400" "1000 640"; do
  # shellcheck disable=SC2086 # two numbers
  xdotool windowsize --sync "$window" $size && sleep 0.5 && alive "size $size"
done
save resized.png
picture resized
say "minimised, and back; larger text"
xdotool windowunmap --sync "$window" && sleep 1 && alive "a window that is gone"
xdotool windowmap --sync "$window" && xdotool windowfocus --sync "$window" && sleep 0.5
for _ in 1 2 3 4 5; do key ctrl+plus; done
save large-text.png
picture large-text
key ctrl+0
say "another scene, by its name"
key ctrl+o
xdotool type --clearmodifiers --delay 30 "builtin:parade" && key Return
wait_for 60 "the other scene" titled parade
sleep 1
key p && sleep 1.5 && key p
save parade.exr
say "a scene, by the dialog of the system"
echo "$PWD/scenes/courtyard.gltf" > "$folder/chosen"
key ctrl+o
key Tab && key Tab && key Return
wait_for 60 "the scene from the dialog" titled courtyard
say "the end"
xdotool key --clearmodifiers ctrl+q
for _ in $(seq 100); do kill -0 "$viewer" 2>/dev/null || break; sleep 0.1; done
kill -0 "$viewer" 2>/dev/null && die "Ctrl+Q does not end it"
wait "$viewer" || die "the viewer has failed"
[ -s "$folder/log" ] && die "the viewer has printed something"

say "drawn by Vulkan at twice the pixels a point: a swapchain for each size of the window"
WINIT_X11_SCALE_FACTOR=2 open_viewer builtin:cornell-box --size 400x300 --painter vulkan
wait_for 60 "the scene" titled cornell-box
sleep 2
for size in "900 700" "640 400" "1000 640"; do
  # shellcheck disable=SC2086 # two numbers
  xdotool windowsize --sync "$window" $size && sleep 0.5 && alive "size $size, drawn by Vulkan"
done
xdotool windowunmap --sync "$window" && sleep 1 && alive "a window that is gone, drawn by Vulkan"
xdotool windowmap --sync "$window" && xdotool windowfocus --sync "$window" && sleep 0.5
drag 1 300 300 400 330
save vulkan.png
picture vulkan
xdotool key --clearmodifiers ctrl+q
for _ in $(seq 100); do kill -0 "$viewer" 2>/dev/null || break; sleep 0.1; done
kill -0 "$viewer" 2>/dev/null && die "Ctrl+Q does not end it, drawn by Vulkan"
wait "$viewer" || die "the viewer has failed, drawn by Vulkan"
[ -s "$folder/log" ] && die "the viewer has printed something"
say "done: $folder"
