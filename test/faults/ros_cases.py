"""What can go wrong around a running node: clocks, masters, subscribers, commands, ports."""

import contextlib
import os
import socket
import threading
import time

from campaign import ROOT, Broken, NotTried, case, last_time, require, summary, wait_until, write_text
from kill_cases import LONGER
from raw_ros import Master, Publisher, Rig, free_port, listening_addresses

FAKETIME = "/usr/lib/{}/faketime/libfaketimeMT.so.1"
SAMPLE_S = 0.01


def start_master(context):
    context.rig_node  # noqa: B018  # NotTried without ROS
    master = Master(context)
    master.set("/use_sim_time", True)
    return master


class Health:
    """What one subscriber sees of a rig in real time: every sample, in order, on time."""

    def __init__(self, master):
        from geometry_msgs.msg import WrenchStamped
        from rosgraph_msgs.msg import Clock
        self.wrench = master.subscribe("/load_cell/wrench", WrenchStamped)
        self.clock = master.subscribe("/clock", Clock, "/rig_node")
        self.wrench.wait_for(lambda _: True)
        self._samples, self._clocks = [], []

    def watch(self, duration_s):
        """Reads for a time and holds the rig to its promises. @return real-time factor"""
        reader = threading.Thread(target=lambda: self._clocks.extend(self.clock.read(duration_s)))
        reader.start()
        fresh = self.wrench.read(duration_s)
        reader.join()
        self._samples += fresh
        stamps = [message.header.stamp.to_sec() for _, message in self._samples]
        missed = sum(round((b - a) / SAMPLE_S) - 1 for a, b in zip(stamps, stamps[1:]))
        require(missed == 0, f"{missed} samples of the load cell were missed")
        require(len(fresh) > 1, "no samples came")
        clocks = [message.clock for _, message in self._clocks]
        require(all(a <= b for a, b in zip(clocks, clocks[1:])), "/clock went back")
        return ((fresh[-1][1].header.stamp - fresh[0][1].header.stamp).to_sec()) / (fresh[-1][0] - fresh[0][0])


def require_real_time(context, factor):
    # Not in the quick part, beside other tests. What a fault takes would be seen by far more than this.
    require(context.quick or factor > 0.9, f"real-time factor {factor:.3f}")


def manual_rig(master, **parameters):
    return Rig(master, settings="procedure.control=manual;procedure.settle_duration_s=0.2", **parameters).wait_until_up()


def twist(z_mps):
    from geometry_msgs.msg import TwistStamped
    command = TwistStamped()
    command.twist.linear.z = z_mps
    return command


@case("wall clock set forward and back by an hour under the running node (libfaketime)")
def case_wall_clock_step(context):
    library = FAKETIME.format(os.uname().machine + "-linux-gnu")
    if not os.path.exists(library):
        raise NotTried("libfaketime is not installed (apt-get install libfaketime)")
    master = start_master(context)
    offset = context.path("offset")
    write_text(offset, "+0\n")
    Rig(master, environment={"LD_PRELOAD": library, "FAKETIME_DONT_FAKE_MONOTONIC": "1", "FAKETIME_NO_CACHE": "1",
                             "FAKETIME_TIMESTAMP_FILE": offset}).wait_until_up()
    health = Health(master)
    steps = ["+1h", "-1h", "+0", "+400d", "-400d"]
    factors = []
    for step in steps:
        write_text(offset, step + "\n")
        factors.append(health.watch(context.many(2.0, 1.0)))
        require_real_time(context, factors[-1])
    from std_srvs.srv import Trigger
    require(master.service("/rig_node/pause", Trigger).success, "pause")
    return len(steps), f"no sample missed, /clock monotonic, real-time factor {min(factors):.3f} or more: the node " \
                       "is paced by the steady clock"


@case("somebody else's /clock that jumps forth and back, under use_sim_time", quick=True)
def case_clock_jump(context):
    master = start_master(context)
    manual_rig(master)
    from brash_ice_rig.msg import CraneState
    from rosgraph_msgs.msg import Clock
    import rospy
    clock = Publisher(master, "/jumping_clock", "/clock", Clock)
    driver = Publisher(master, "/driver", "/crane/cmd_vel", twist(0.0).__class__)
    try:
        clock.wait_for_connection()
        driver.wait_for_connection()
        health = Health(master)
        crane = master.subscribe("/crane/state", CraneState)
        stop, jumps = threading.Event(), [0]

        def jump():
            while not stop.is_set():
                clock.send(Clock(clock=rospy.Time(context.random.choice([0, 1, 50_000, 4_000_000_000]))))
                driver.send(twist(0.05))
                jumps[0] += 1
                time.sleep(0.02)

        thread = threading.Thread(target=jump)
        thread.start()
        factor = health.watch(context.many(8.0, 2.0))
        state = crane.read(0.3)[-1][1]
        stop.set()
        thread.join()
        require_real_time(context, factor)
        require(abs(state.velocity_mps.z - 0.05) < 1e-3, f"the crane moves at {state.velocity_mps.z:.3f} m/s")
        return jumps[0], "commands are obeyed, no sample missed, the rig's own stamps stay monotonic, real-time factor " \
                         f"{factor:.3f}"
    finally:
        clock.close()
        driver.close()


@case("ROS master killed and started anew under a running test")
def case_master_restart(context):
    master = start_master(context)
    out = context.path("out")
    rig = Rig(master, output_dir=out, settings=";".join(LONGER), exit_at_end="true", real_time_factor="1.5")
    rig.wait_until_up()
    health = Health(master)
    health.watch(0.3)
    master.process.kill9()
    health.watch(3.0)
    require("does not answer any more" in rig.process.log(), "the node does not say that the master is gone")
    master.start()
    require(wait_until(lambda: master.publishers("/load_cell/wrench"), 30.0), "the node does not register anew: "
            + rig.process.log()[-500:])
    health.watch(0.5)
    # Whoever comes now finds the rig as before.
    require(master.call("getParam", "/use_sim_time") is True, "use_sim_time is gone")
    Health(master).watch(0.3)
    from std_srvs.srv import Trigger
    require(master.service("/load_cell/tare", Trigger).success, "tare")
    code = rig.process.wait(60.0)
    require(code == 0, rig.process.log()[-400:])
    time_s = last_time(out)
    require(time_s > 20.0 - 0.02, f"force.csv ends at {time_s} s")
    require(summary(out)["status"] == "ok", summary(out)["status"])
    return 1, "the test goes on to its end; connections that stood miss no sample; the node says that the master is " \
              "gone and registers with the new one, where its topics and services are found again", \
        "what other nodes had registered (ROS 1)"


@case("a subscriber that never reads, on every large topic", quick=True)
def case_deaf_subscriber(context):
    master = start_master(context)
    rig = Rig(master).wait_until_up()
    health = Health(master)
    topics = ["/ice/points", "/load_cell/wrench", "/ground_truth/force_components", "/joint_states", "/rig/markers",
              "/sim/commands", "/clock"]
    deaf = [master.subscribe(topic) for topic in topics]
    factor = health.watch(context.many(10.0, 2.0))
    before = rig.process.resident_bytes()
    factor = min(factor, health.watch(context.many(40.0, 3.0)))
    grown = rig.process.resident_bytes() - before
    require_real_time(context, factor)
    require(grown < 10e6, f"memory grew by {grown / 1e6:.1f} MB")
    for subscription in deaf:
        subscription.close()
    return len(topics), f"queues stay bounded ({grown / 1e6:+.1f} MB); others miss no sample; real-time factor " \
                        f"{factor:.3f}", "messages for the one that does not read"


@case("20 subscribers of the ice and 20 of the load cell")
def case_twenty_subscribers(context):
    master = start_master(context)
    rig = Rig(master).wait_until_up()
    health = Health(master)
    readers = [master.subscribe(topic) for topic in ["/ice/points", "/load_cell/wrench"] * 20]
    duration_s = context.many(20.0, 3.0)
    got = [0] * len(readers)

    def drain(k):
        got[k] = len(readers[k].read(duration_s))

    threads = [threading.Thread(target=drain, args=(k,)) for k in range(len(readers))]
    for thread in threads:
        thread.start()
    factor = health.watch(duration_s)
    for thread in threads:
        thread.join()
    require_real_time(context, factor)
    require(min(got[1::2]) > 0.9 * duration_s * 100.0, f"a subscriber got {min(got[1::2])} samples")
    require(min(got[::2]) > 0.8 * duration_s * 10.0, f"a subscriber got {min(got[::2])} clouds")
    require(rig.process.alive(), "the node ended")
    return 40, f"each got its samples and clouds; no sample missed; real-time factor {factor:.3f}"


@case("velocity commands at 10 kHz", quick=True)
def case_command_flood(context):
    master = start_master(context)
    rig = manual_rig(master)
    from brash_ice_rig.msg import CraneState
    driver = Publisher(master, "/driver", "/crane/cmd_vel", twist(0.0).__class__)
    try:
        driver.wait_for_connection()
        health = Health(master)
        crane = master.subscribe("/crane/state", CraneState)
        duration_s = context.many(15.0, 2.0)
        stop = threading.Event()
        sent = [0]

        def flood():
            begin = time.monotonic()
            while not stop.is_set():
                due = int((time.monotonic() - begin) * 10_000)
                if due > sent[0]:
                    driver.send(twist(0.05), due - sent[0])
                    sent[0] = due
                time.sleep(0.001)

        thread = threading.Thread(target=flood)
        before = rig.process.resident_bytes()
        thread.start()
        factor = health.watch(duration_s)
        moving = crane.read(0.3)[-1][1]
        stop.set()
        thread.join()
        require(abs(moving.velocity_mps.z - 0.05) < 1e-3, f"the crane moves at {moving.velocity_mps.z:.3f} m/s")
        begin = time.monotonic()
        crane.wait_for(lambda state: abs(state.velocity_mps.z) < 1e-6, 5.0)
        latency_s = time.monotonic() - begin
        require(latency_s < 2.0, f"the crane stood {latency_s:.2f} s after the last command")
        grown = rig.process.resident_bytes() - before
        require(grown < 10e6, f"memory grew by {grown / 1e6:.1f} MB")
        require_real_time(context, factor)
        return sent[0], f"the crane follows, and stands {latency_s:.1f} s after the last command (watchdog 0.25 s); no " \
                        f"sample missed; real-time factor {factor:.3f}; {grown / 1e6:+.1f} MB"
    finally:
        driver.close()


@case("commands from two publishers, with opposite wishes", quick=True)
def case_two_commanders(context):
    master = start_master(context)
    manual_rig(master)
    from brash_ice_rig.msg import CraneState, SimStatus
    drivers = [Publisher(master, f"/driver_{k}", "/crane/cmd_vel", twist(0.0).__class__) for k in range(2)]
    try:
        for driver in drivers:
            driver.wait_for_connection()
        crane = master.subscribe("/crane/state", CraneState)
        status = master.subscribe("/sim/status", SimStatus)
        stop = threading.Event()

        def talk(k, speed_mps):
            while not stop.is_set():
                drivers[k].send(twist(speed_mps))
                time.sleep(0.02)

        threads = [threading.Thread(target=talk, args=arguments) for arguments in ((0, 0.05), (1, -0.05))]
        for thread in threads:
            thread.start()
        status.wait_for(lambda message: "multiple_commanders" in message.flag_names, 5.0)
        crane.wait_for(lambda state: abs(state.velocity_mps.z) < 1e-6, 5.0)
        stands = [state.velocity_mps.z for _, state in crane.read(context.many(3.0, 1.0))]
        stop.set()
        for thread in threads:
            thread.join()
        require(all(abs(speed) < 1e-6 for speed in stands), "the crane moved")
        obeyed = [False]

        def watch():
            with contextlib.suppress(Broken):
                crane.wait_for(lambda state: abs(state.velocity_mps.z - 0.05) < 1e-3, 5.0)
                obeyed[0] = True

        watcher = threading.Thread(target=watch)
        watcher.start()
        while watcher.is_alive():
            drivers[0].send(twist(0.05))
            time.sleep(0.02)
        require(obeyed[0], "one driver alone is not obeyed")
        return 1, "both refused, the crane stands, flag MULTIPLE_COMMANDERS; one alone is obeyed again after a second"
    finally:
        for driver in drivers:
            driver.close()


@case("the node without a master, which comes later", quick=True)
def case_no_master(context):
    context.rig_node  # noqa: B018
    port = free_port()
    environment = context.environment(ROS_MASTER_URI=f"http://localhost:{port}", ROS_HOSTNAME="localhost",
                                      ROS_LOG_DIR=context.path("ros_log"))
    node = context.start([context.rig_node, f"_scenario:={os.path.join(ROOT, 'test', 'ros', 'small.yaml')}"],
                         "node.txt", env=environment)
    require(wait_until(lambda: "Failed to contact master" in node.log(), 15.0), f"says nothing: {node.log()}")
    require(node.alive(), "the node ended")
    master = Master(context, port)
    require(wait_until(lambda: master.call("lookupService", "/rig_node/reset"), 20.0), "the node did not find the master")
    node.send(2)
    require(node.wait(20.0) == 0, node.log()[-300:])
    lost = context.start([context.rig_node], "alone.txt", env={**environment, "ROS_MASTER_URI":
                                                               f"http://localhost:{free_port()}"})
    time.sleep(1.0)
    lost.send(2)
    lost.wait(20.0)
    pull_up = os.path.join(context.programs, "pull_up")
    code, text = context.run([pull_up, "--lift-duration", "1"], env={
        **environment, "ROS_MASTER_URI": f"http://localhost:{free_port()}",
        "PYTHONPATH": os.pathsep.join([os.path.join(os.path.dirname(context.programs), "python3", "dist-packages"), os.environ.get("PYTHONPATH", "")])})
    require(code == 1 and "no ROS master" in text, text)
    return 3, "the node says that it cannot contact the master, waits, and comes up with it; Ctrl-C ends the wait; " \
              "`pull_up` says what to launch"


@case("the master's port is another program's, which never answers")
def case_port_in_use(context):
    context.rig_node  # noqa: B018
    if not os.path.exists("/usr/bin/roslaunch"):
        raise NotTried("no roslaunch here")
    with contextlib.closing(socket.socket()) as other:
        other.bind(("127.0.0.1", 0))
        other.listen(50)
        port = other.getsockname()[1]
        environment = context.environment(ROS_MASTER_URI=f"http://localhost:{port}", HOME=context.directory,
                                          ROS_LOG_DIR=context.path("ros_log"))
        environment.pop("ROS_HOSTNAME", None)
        code, text = context.run([os.path.join(ROOT, "scripts", "run"), "headless:=true"], 60.0, env=environment,
                                 cwd=context.directory)
        require(code == 2, f"exit code {code}: {text[-300:]}")
        require(f"port {port}" in text, f"the port is not named: {text[-300:]}")
    return 1, "`scripts/run` ends with exit code 2 and names the port"


@case("who can reach the node with ROS_HOSTNAME=localhost, and without", quick=True)
def case_loopback(context):
    if not os.path.exists("/usr/bin/ss") and not os.path.exists("/bin/ss"):
        raise NotTried("needs ss (iproute2)")
    master = start_master(context)
    fenced = Rig(master, "fenced").wait_until_up()
    open_node = Rig(master, "open", log="open.txt", environment={"ROS_HOSTNAME": "", "ROS_IP": ""}).wait_until_up()
    for what, process in (("master", master.process), ("node", fenced.process)):
        addresses = listening_addresses(process.pid)
        require(addresses, f"no socket of the {what} was found")
        outside = [f"{address}:{port}" for address, port in addresses
                   if address not in ("127.0.0.1", "[::1]") and not address.endswith("%lo")]
        require(not outside, f"the {what} listens on {', '.join(outside)}")
    require(any(address in ("0.0.0.0", "*", "[::]") for address, _ in listening_addresses(open_node.process.pid)),
            "without ROS_HOSTNAME the node should be open: is this test blind?")
    return 2, "with it, master and node listen on the loopback interface only, XML-RPC included; without, on all"
