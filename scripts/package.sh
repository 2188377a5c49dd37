#!/usr/bin/env bash
# Makes the packages of a release: a .deb and a tarball, each with the program, its manual pages, completions of bash, zsh and fish, docs and licences.
#
#   ./scripts/package.sh          builds (profile release) and writes both into target/package
#   ./scripts/package.sh check    installs both in a clean Debian 12, as root, and renders there without a GPU; needs the packages of the first command
#
# The .deb is what [package.metadata.deb] of Cargo.toml says; `cargo deb` makes it, and is installed where it is missing.
# SKYLIT_BUILD_FLAGS  flags of `cargo build` besides, like `--features build-shaderc`
# CLEAN_ROOT          folder for the clean Debian, which is kept and used again [default: a temporary one]
set -euo pipefail
cd "$(dirname "$0")/.."
out=$PWD/target/package
say() { printf 'package: %s\n' "$*"; }
die() { printf 'package: error: %s\n' "$*" >&2; exit 1; }
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
architecture=$(uname -m)
name=skylit-$version-$architecture-linux

make_packages() {
  if ! cargo deb --version > /dev/null 2>&1; then
    say "installing cargo-deb"
    cargo install --quiet --locked cargo-deb
  fi
  say "compiling"
  # shellcheck disable=SC2086  # several flags
  cargo build --release --locked ${SKYLIT_BUILD_FLAGS:-}
  # cargo deb looks for the program below the folder of the project
  local program=${CARGO_TARGET_DIR:-target}/release/skylit
  rm -rf "$out" && mkdir -p "$out/assets/completions"
  "$program" man "$out/assets/man"
  "$program" completions bash > "$out/assets/completions/skylit.bash"
  "$program" completions zsh > "$out/assets/completions/_skylit"
  "$program" completions fish > "$out/assets/completions/skylit.fish"

  say "the .deb"
  cargo deb --quiet --no-build --locked --strip --output "$out/" > /dev/null

  say "the tarball"
  local root=$out/$name
  install -D -m 755 "$program" "$root/bin/skylit"
  strip --strip-unneeded "$root/bin/skylit"
  mkdir -p "$root/share/man/man1" "$root/share/doc/skylit/docs"
  install -m 644 "$out"/assets/man/*.1 "$root/share/man/man1"
  install -D -m 644 "$out/assets/completions/skylit.bash" "$root/share/bash-completion/completions/skylit"
  install -D -m 644 "$out/assets/completions/_skylit" "$root/share/zsh/site-functions/_skylit"
  install -D -m 644 "$out/assets/completions/skylit.fish" "$root/share/fish/vendor_completions.d/skylit.fish"
  install -m 644 README.md CHANGELOG.md SECURITY.md LICENSE-APACHE LICENSE-MIT "$root/share/doc/skylit"
  (cd docs && find . -name '*.md' -o -path './images/*' -o -path './results/gpu/*') \
    | while read -r file; do install -D -m 644 "docs/$file" "$root/share/doc/skylit/docs/$file"; done
  # the same bytes for the same files
  tar -C "$out" --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$(git log -1 --format=%ct 2> /dev/null || date +%s)" -cf - "$name" | gzip -9n > "$out/$name.tar.gz"
  rm -rf "$root"
  (cd "$out" && sha256sum ./*.deb ./*.tar.gz > SHA256SUMS && cat SHA256SUMS && du -h ./*.deb ./*.tar.gz)
}

# A clean Debian 12 in the folder $root, from the mirror of this machine's own apt sources.
make_clean_root() {
  [ -e "$root/etc/debian_version" ] && return 0
  local site tools
  # apt expands these, not the shell
  # shellcheck disable=SC2016
  site=$(apt-get indextargets --format '$(RELEASE) $(IDENTIFIER) $(SITE)' | awk '$1=="bookworm" && $2=="Packages" {print $3; exit}')
  [ -n "$site" ] || die "apt has no source of bookworm: the check needs a Debian 12"
  say "a clean Debian 12 in $root"
  if command -v debootstrap > /dev/null; then
    debootstrap --variant=minbase bookworm "$root" "$site" > "$out/debootstrap.log" || die "debootstrap failed: see $out/debootstrap.log"
  else
    # unpacked, not installed
    tools=$(mktemp -d)
    (cd "$tools" && apt-get -qq download debootstrap 2> /dev/null && dpkg-deb -x ./*.deb .) || die "could not download debootstrap"
    DEBOOTSTRAP_DIR=$tools/usr/share/debootstrap sh "$tools/usr/sbin/debootstrap" --variant=minbase bookworm "$root" "$site" > "$out/debootstrap.log" ||
      die "debootstrap failed: see $out/debootstrap.log"
    rm -rf "$tools"
  fi
}

check_packages() {
  [ "$(id -u)" = 0 ] || die "the check needs root, for chroot"
  local deb tarball
  deb=$(ls "$out"/*.deb) && tarball=$out/$name.tar.gz || die "no packages in $out: run ./scripts/package.sh first"
  root=${CLEAN_ROOT:-$(mktemp -d)/root}
  make_clean_root
  inside() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive "$@"; }
  # the machine's own sources, with their keys and proxies
  rm -f "$root/etc/apt/sources.list"
  cp -r /etc/apt/sources.list.d /etc/apt/apt.conf.d "$root/etc/apt/"
  # a chroot has no terminals
  echo 'Dpkg::Use-Pty "0";' > "$root/etc/apt/apt.conf.d/99skylit"
  [ ! -e /etc/apt/sources.list ] || cp /etc/apt/sources.list "$root/etc/apt/"
  [ ! -e /etc/resolv.conf ] || cp -L /etc/resolv.conf "$root/etc/resolv.conf"
  mkdir -p "$root/tmp/packages" && cp "$deb" "$tarball" scripts/container/runtime.sh "$root/tmp/packages/"

  say "the .deb without a driver"
  inside apt-get -qq update
  # of an earlier check in the same folder; there may be none
  inside apt-get -qq purge -y skylit mesa-vulkan-drivers > /dev/null 2>&1 || true
  inside sh -c 'apt-get -qq install -y --no-install-recommends /tmp/packages/*.deb > /dev/null'
  inside skylit --version
  local code=0
  inside skylit doctor > /dev/null 2>&1 || code=$?
  [ $code = 2 ] || die "skylit doctor without a driver: exit code $code in place of 2"

  say "the .deb with Mesa's driver, which it recommends"
  inside bash /tmp/packages/runtime.sh > /dev/null
  inside skylit doctor | tail -n 1
  inside skylit render builtin:cornell-box --size 64x48 -o /tmp/ao.png
  inside skylit render builtin:cornell-box --size 64x48 --integrator path -o /tmp/path.exr --quiet
  for file in usr/share/man/man1/skylit-render.1.gz usr/share/bash-completion/completions/skylit usr/share/doc/skylit/copyright; do
    [ -s "$root/$file" ] || die "the .deb lacks $file"
  done
  inside apt-get -qq remove -y skylit > /dev/null
  [ ! -e "$root/usr/bin/skylit" ] || die "removing the .deb leaves /usr/bin/skylit"

  say "the tarball"
  inside sh -c "mkdir -p /opt && tar -C /opt -xzf /tmp/packages/$name.tar.gz"
  inside "/opt/$name/bin/skylit" render builtin:cornell-box --size 64x48 -o /tmp/again.png --quiet
  cmp "$root/tmp/ao.png" "$root/tmp/again.png" || die "the two programs render different images"
  say "both start in a clean Debian $(cat "$root/etc/debian_version") and render the same image"
}

case ${1:-make} in
  make) make_packages ;;
  check) check_packages ;;
  *) die "unknown argument $1: leave it out, or give check" ;;
esac
