#!/usr/bin/env bash
# Installs what skylit needs to run on a CPU in a clean Debian 12 or 13 or Ubuntu 24.04, as root: the Vulkan loader and Mesa's lavapipe.
#
#   ./scripts/container/runtime.sh [VERSION]      VERSION: a version of mesa-vulkan-drivers as apt names it, to pin the driver
#
# The second stage of the Dockerfile runs it. Debian's own lavapipe (22.3.6) has the compute tracer only; bookworm-backports has one with all three tracers.
set -euo pipefail
version=${1:-}
say() { printf 'container: %s\n' "$*"; }

export DEBIAN_FRONTEND=noninteractive
# shellcheck disable=SC1091  # the file is the machine's own
. /etc/os-release
apt-get -qq update
suite=()
if [ "${VERSION_CODENAME:-}" = bookworm ]; then
  suite=(-t bookworm-backports)
  # apt expands these, not the shell
  # shellcheck disable=SC2016
  if ! apt-get indextargets --format '$(RELEASE)' | grep -qx bookworm-backports; then
    # the archive that serves bookworm serves its backports, too
    # shellcheck disable=SC2016
    site=$(apt-get indextargets --format '$(RELEASE) $(IDENTIFIER) $(SITE)' | awk '$1=="bookworm" && $2=="Packages" {print $3; exit}')
    if [ -z "$site" ]; then say "apt has no source of bookworm: add one, backports are beside it" >&2 && exit 1; fi
    printf 'Types: deb\nURIs: %s\nSuites: bookworm-backports\nComponents: main\nSigned-By: /usr/share/keyrings/debian-archive-keyring.gpg\n' \
      "$site" > /etc/apt/sources.list.d/skylit-backports.sources
    apt-get -qq update
  fi
fi
say "installing the Vulkan loader and lavapipe"
apt-get -qq install -y --no-install-recommends libvulkan1 > /dev/null
apt-get -qq install -y --no-install-recommends "${suite[@]}" "mesa-vulkan-drivers${version:+=$version}" > /dev/null
rm -rf /var/lib/apt/lists/*
say "mesa-vulkan-drivers $(dpkg-query -W -f '${Version}' mesa-vulkan-drivers)"
