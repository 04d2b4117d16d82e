#!/usr/bin/env bash
# Makes the virtual robot's parts in build/vm: kernel, initial ramdisk, root file system, and /opt/canbase as an image.
#   COMPILED=1: the wheel whose deciding modules are compiled by mypyc.
#   root needed: yes (mmdebstrap).  network: a Debian mirror and PyPI.  Each part is made again only when its recipe changed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
here=virtual_bus_tests/vm out=build/vm
mkdir -p "$out"
export DEBIAN_FRONTEND=noninteractive
export -n AMENT_PREFIX_PATH PYTHONPATH LD_LIBRARY_PATH

packages=systemd,systemd-sysv,udev,dbus,kmod,iproute2,can-utils,python3,procps
guest_modules="nfit nd_pmem virtio_pci 9p 9pnet_virtio can-raw vcan slcan kvaser_pci i6300esb overlay loop"
boot_modules="nfit nd_pmem ext4"

say() { printf 'vm: %s\n' "$*" >&2; }

# Exit code 3: not on this computer, and why.
able() {
  local missing
  missing=$("$here/missing")
  [[ -z $missing ]] || { say "install first: sudo apt-get install $missing"; exit 3; }
  grep -qs '^VERSION_CODENAME=bookworm' /etc/os-release || { say "the guest is a Debian 12, made on one: its kernel, its Python"; exit 3; }
  python -c 'import sys; exit(sys.version_info[:2] != (3, 11))' || { say ".venv must be of Python 3.11, the guest's"; exit 3; }
}

# The distribution's kernel, unpacked from its package: no boot loader, no initramfs-tools.
kernel() {
  local name
  name=$(apt-cache depends linux-image-amd64 | awk '/Depends: linux-image-6/ {print $2; exit}')
  (cd "$work" && timeout 300 apt-get download -q "$name" >/dev/null)
  mkdir "$work/kernel"
  dpkg-deb --fsys-tarfile "$work/${name}"_*.deb | tar -x -C "$work/kernel" --wildcards './boot/*' './lib/modules/*'
  version=${name#linux-image-}
  depmod -b "$work/kernel" "$version"
  python3 - "$work/kernel/boot/vmlinuz-$version" "$out/vmlinux" <<'PYTHON'
import lzma, struct, sys
image = open(sys.argv[1], "rb").read()
offset, length = struct.unpack_from("<II", image, 0x248)      # payload_offset, payload_length: Documentation/arch/x86/boot.rst
start = ((image[0x1F1] or 4) + 1) * 512 + offset
open(sys.argv[2], "wb").write(lzma.LZMADecompressor().decompress(image[start : start + length]))
PYTHON
}

modules() { # the files of these modules and of what they need, each once
  local module
  for module in "$@"; do modprobe -d "$work/kernel" -S "$version" --show-depends "$module" | awk '$1 == "insmod" {print $2}'; done | awk '!seen[$0]++'
}

ramdisk() {
  mkdir -p "$work/initrd"/{bin,modules}
  cp "$(command -v busybox)" "$work/initrd/bin/busybox"
  # shellcheck disable=SC2086  # one word a module
  modules $boot_modules | grep -v crc32c-intel | while read -r file; do
    cp "$file" "$work/initrd/modules/"
    basename "$file" >>"$work/initrd/modules/order"
  done
  install -m 755 "$here/guest/init" "$work/initrd/init"
  (cd "$work/initrd" && find . | cpio -o -H newc --quiet --owner=0:0 | gzip -1) >"$out/initrd.gz"
}

root() {
  local tree=$work/root unit file
  TMPDIR=$work timeout 500 mmdebstrap --variant=minbase --include="$packages" --aptopt='Acquire::Languages "none"' \
    --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/doc/*' \
    --dpkgopt='path-exclude=/usr/share/locale/*' bookworm "$tree" >"$out/mmdebstrap.log" 2>&1
  # shellcheck disable=SC2086
  modules $guest_modules $boot_modules | while read -r file; do
    install -D -m 644 "$file" "$tree/lib/modules/$version/${file#*/modules/"$version"/}"
  done
  cp "$work/kernel/lib/modules/$version"/modules.{builtin,builtin.modinfo,order} "$tree/lib/modules/$version/"
  depmod -b "$tree" "$version"
  for unit in getty@tty1.service serial-getty@ttyS0.service apt-daily.timer apt-daily-upgrade.timer dpkg-db-backup.timer \
    e2scrub_all.timer e2scrub_reap.service fstrim.timer systemd-update-utmp.service systemd-machine-id-commit.service \
    systemd-pcrphase.service systemd-firstboot.service dev-hugepages.mount sys-kernel-debug.mount \
    sys-kernel-tracing.mount systemd-binfmt.service; do
    ln -sf /dev/null "$tree/etc/systemd/system/$unit"
  done
  ln -sf /lib/systemd/system/multi-user.target "$tree/etc/systemd/system/default.target"
  echo robot >"$tree/etc/hostname"
  echo '127.0.0.1 localhost robot' >"$tree/etc/hosts"
  echo 00112233445566778899aabbccddeeff >"$tree/etc/machine-id"
  echo '/dev/pmem1 /opt/canbase ext4 ro 0 0' >"$tree/etc/fstab"
  mkdir -p "$tree/opt/canbase"
  rm -f "$out/root.ext4"
  mke2fs -q -t ext4 -b 4096 -O ^metadata_csum -d "$tree" "$out/root.ext4" 640M >/dev/null
}

# A virtual environment as docs/install.md makes it, by the guest's own Python version, moved to where the guest has it:
# first all that canbase needs, then canbase.
libraries() {
  rm -rf "$out/venv"
  /usr/bin/python3 -m venv "$out/venv"
  python -c "$requirements" >"$out/requirements.txt"
  "$out/venv/bin/pip" install --quiet --requirement "$out/requirements.txt"
  grep -rlI --exclude='*.pyc' "$PWD/$out/venv" "$out/venv/bin" "$out/venv/pyvenv.cfg" | xargs sed -i "s#$PWD/$out/venv#/opt/canbase#g"
}

requirements='
from pip._vendor import tomli
project = tomli.load(open("pyproject.toml", "rb"))["project"]
print(*project["dependencies"], *project["optional-dependencies"]["ros"], sep="\n")'

wheel() {
  if [[ -n ${COMPILED:-} ]]; then
    PYTHONPATH=virtual_bus_tests python -m compiled.wheel --dest "$out/wheel"
  else
    python -m pip wheel --quiet --no-deps --no-build-isolation --config-settings "build-dir=$out/cmake" --wheel-dir "$out/wheel" .
  fi
}

canbase() {
  rm -rf "$out/wheel"
  wheel
  python -m pip --python "$out/venv/bin/python3" install --quiet --no-deps --force-reinstall "$out"/wheel/canbase-*.whl
  "$out/venv/bin/python3" -m compileall -q "$out/venv/lib" >/dev/null || true
  rm -f "$out/venv.ext4"
  mke2fs -q -t ext4 -b 4096 -N $(($(find "$out/venv" | wc -l) + 2000)) -O ^has_journal,^metadata_csum -m 0 -d "$out/venv" \
    "$out/venv.ext4" $(($(du -sm "$out/venv" | cut -f1) * 115 / 100 / 128 * 128 + 256))M >/dev/null
}

key() { sha256sum | cut -c1-16; }
made() { [[ -f $out/$1.key && $(cat "$out/$1.key") == "$2" ]]; }

PATH=$PATH:/usr/sbin:/sbin
PATH=$PWD/.venv/bin:$PATH
able
system_key=$(cat "$here/build.sh" "$here/guest/init" | key)
if ! made system "$system_key"; then
  ((EUID == 0)) || { say "the guest's root file system is made as root: sudo $0"; exit 3; }
  timeout 120 apt-get update -qq || { say "no Debian mirror in reach"; exit 3; }
  work=$(mktemp -d)
  chmod 755 "$work"
  trap 'rm -rf "$work"' EXIT
  kernel && ramdisk && root
  echo "$system_key" >"$out/system.key"
  say "guest system made: $(du -m "$out/root.ext4" | cut -f1) MB, kernel $version"
fi
libraries_key=$(cat "$here/build.sh" pyproject.toml | key)
if ! made libraries "$libraries_key"; then
  libraries
  echo "$libraries_key" >"$out/libraries.key"
fi
sources=(can_config runtime driver velocity_mux watchdog action_server commissioning doctor web cli deploy interfaces virtual_bus_tests/canbase_sim pyproject.toml CMakeLists.txt package.xml)
canbase_key=$( (echo "$libraries_key ${COMPILED:-}"; find "${sources[@]}" -type f ! -name '*.pyc' -print0 | sort -z | xargs -0 sha256sum) | key)
if ! made canbase "$canbase_key"; then
  canbase
  echo "$canbase_key" >"$out/canbase.key"
  say "/opt/canbase made: $(du -sm "$out/venv" | cut -f1) MB"
fi
