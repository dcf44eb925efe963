# Sourced by setup, run and test: where the package lies, and an environment in which ROS works on a bare machine.
# After ros_environment: ros_flavour is "debian", "noetic" or "".

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# A Python from elsewhere on PATH lacks the modules of the ROS packages.
export PATH=/usr/bin:/bin:/usr/sbin:/sbin:$PATH
export HOME=${HOME:-/tmp}

ros_flavour=
if [ -r /opt/ros/noetic/setup.bash ]; then
  ros_flavour=noetic
elif (. /etc/os-release && [ "${ID:-}" = debian ] && [ "${VERSION_ID:-}" = 12 ]) 2>/dev/null; then
  ros_flavour=debian
fi

# Reads a setup file of ROS; these files use variables that are not set.
source_ros() {
  set +u
  # shellcheck disable=SC1090
  source "$1"
  set -u
}

# The hostname of a bare machine often does not resolve; localhost does. A machine that is told where its master is
# knows its own name.
use_localhost() {
  if [ -z "${ROS_HOSTNAME:-}${ROS_IP:-}${ROS_MASTER_URI:-}" ]; then
    export ROS_HOSTNAME=localhost
  fi
  if ! getent hosts localhost >/dev/null; then
    echo "localhost does not resolve, and ROS needs it: add the line '127.0.0.1 localhost' to /etc/hosts." >&2
    return 1
  fi
}

# What answers on the master's port must be a master: roslaunch would wait for another program without end.
require_master_or_free_port() {
  local uri=${ROS_MASTER_URI:-http://localhost:11311}
  if ! python3 - "$uri" <<'PYTHON'; then
import socket, sys, urllib.parse, xmlrpc.client
uri = urllib.parse.urlparse(sys.argv[1])
try:
    socket.create_connection((uri.hostname, uri.port or 80), 3.0).close()
except OSError:
    sys.exit(0)  # nobody is there
socket.setdefaulttimeout(5.0)
try:
    xmlrpc.client.ServerProxy(sys.argv[1]).getUri("/scripts_run")
except Exception:
    sys.exit(1)
PYTHON
    local port=${uri##*:}
    echo "port ${port%/} ($uri) is in use by a program that is no ROS master: end it, or set ROS_MASTER_URI to another" \
      "port of this computer, e.g. http://localhost:11411." >&2
    return 1
  fi
}

# build DIRECTORY TARGETS [cmake arguments...]: configures and builds, quietly unless something goes wrong.
# TARGETS: names with blanks between them.
build() {
  local directory=$1
  local -a targets
  read -ra targets <<<"$2"
  shift 2
  if [ "$ros_flavour" = noetic ]; then
    source_ros /opt/ros/noetic/setup.bash
  fi
  mkdir -p "$directory"
  local log=$directory/build.log
  echo "building in $directory (what the compiler says: $log)"
  if ! { cmake -S "$root" -B "$directory" "$@" &&
    cmake --build "$directory" -j "$(nproc)" --target "${targets[@]}"; } >"$log" 2>&1; then
    tail -n 60 "$log" >&2
    echo "The build failed; the end of $log is above." >&2
    return 1
  fi
}
