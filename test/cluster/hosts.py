"""Hosts of a test cluster on one machine: network namespaces with addresses of their own on a bridge, each with a name, a
table of processes and a /dev/shm of its own. They share the file system, as hosts of a cluster share one over the net.
"""

import os
import signal
import subprocess
import time


class Unavailable(Exception):
    """This machine does not let us make hosts."""


def call(*command):
    run = subprocess.run(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    if run.returncode != 0:
        raise Unavailable(f"{' '.join(command)}: {run.stdout.strip()}")
    return run.stdout


class Host:
    def __init__(self, cluster, number):
        self.name = f"{cluster.name}h{number}"
        self.address = f"{cluster.subnet}.{number}"
        self.link = f"{self.name}v"
        self.enter = ["ip", "netns", "exec", self.name, "unshare", "--uts", "--ipc", "--mount", "--pid", "--fork",
                      "--kill-child", "--mount-proc", "sh", "-c",
                      f"hostname {self.name} && mount -t tmpfs none /dev/shm && "
                      f"mount --bind '{cluster.directory}/hosts' /etc/hosts && exec \"$@\"", "sh"]

    def start(self, command, log, **options):
        """Starts a program on this host, by itself."""
        return subprocess.Popen(self.enter + command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                                **options)

    def processes(self):
        return [int(word) for word in call("ip", "netns", "pids", self.name).split()]

    def send(self, number):
        for process in self.processes():
            try:
                os.kill(process, number)
            except ProcessLookupError:
                pass

    def die(self):
        """As if its power were cut: nothing is said to anybody."""
        call("ip", "-n", self.name, "link", "set", "eth0", "down")
        while self.processes():
            self.send(signal.SIGKILL)
            time.sleep(0.02)


class Cluster:
    """Use as `with Cluster(2, directory) as cluster:`. Raises Unavailable."""

    def __init__(self, count, directory):
        self.name = f"bi{os.getpid() % 100000}"
        self.subnet = "10.213.71"
        self.directory = directory
        self.hosts = [Host(self, number + 1) for number in range(count)]
        self.made = []

    def __enter__(self):
        if os.geteuid() != 0:
            raise Unavailable("network namespaces need root")
        try:
            self.make()
        except (Unavailable, FileNotFoundError) as error:
            self.__exit__()
            raise Unavailable(str(error)) from error
        return self

    def make(self):
        with open(os.path.join(self.directory, "hosts"), "w", encoding="utf-8") as stream:
            stream.write("127.0.0.1 localhost\n")
            stream.writelines(f"{host.address} {host.name}\n" for host in self.hosts)
        # The switch is a namespace, too: nothing appears beside the machine's own interfaces.
        switch = f"{self.name}sw"
        call("ip", "netns", "add", switch)
        self.made.append(switch)
        call("ip", "-n", switch, "link", "add", "bridge", "type", "bridge")
        call("ip", "-n", switch, "link", "set", "bridge", "up")
        for host in self.hosts:
            call("ip", "netns", "add", host.name)
            self.made.append(host.name)
            call("ip", "link", "add", "eth0", "netns", host.name, "type", "veth", "peer", "name", host.link, "netns",
                 switch)
            call("ip", "-n", switch, "link", "set", host.link, "master", "bridge", "up")
            call("ip", "-n", host.name, "addr", "add", f"{host.address}/24", "dev", "eth0")
            for link in ("lo", "eth0"):
                call("ip", "-n", host.name, "link", "set", link, "up")
            call(*host.enter, "true")
        # What ssh does on a real cluster.
        self.agent = os.path.join(self.directory, "agent")
        with open(self.agent, "w", encoding="utf-8") as stream:
            stream.write("#!/bin/sh\nhost=$1; shift\ncase $host in\n")
            for host in self.hosts:
                words = " ".join("'" + word.replace("'", "'\\''") + "'" for word in host.enter)
                stream.write(f'{host.address}) exec {words} sh -c "$*";;\n')
            stream.write("esac\necho \"$host: no such host\" >&2\nexit 255\n")
        os.chmod(self.agent, 0o755)

    def __exit__(self, *_):
        for name in reversed(self.made):
            for process in call("ip", "netns", "pids", name).split():
                try:
                    os.kill(int(process), signal.SIGKILL)
                except ProcessLookupError:
                    pass
            call("ip", "netns", "del", name)
        self.made = []

    def revive(self, host):
        call("ip", "-n", host.name, "link", "set", "eth0", "up")

    def mpirun(self, hosts, slots, *options):
        """mpirun that starts `slots` processes on each of the hosts; to be started on the first of them."""
        names = ",".join(f"{host.address}:{slots}" for host in hosts)
        return ["mpirun", "--allow-run-as-root", "--bind-to", "none", "--mca", "plm_rsh_agent", self.agent, "--mca",
                "oob_tcp_if_include", f"{self.subnet}.0/24", "--host", names, "-n", str(slots * len(hosts)),
                "--tag-output", *options]
