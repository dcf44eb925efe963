"""ROS 1 spoken by hand: one process can talk to many masters, read nothing of what it subscribed to, and say things
that no client library would. Message classes are those of the packages."""

import contextlib
import io
import os
import select
import socket
import socketserver
import struct
import subprocess
import threading
import time
import xmlrpc.client
import xmlrpc.server

from campaign import Broken, NotTried, require, wait_until


def free_port():
    with contextlib.closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class _Timeout(xmlrpc.client.Transport):
    def make_connection(self, host):
        connection = super().make_connection(host)
        connection.timeout = 5.0
        return connection


def _proxy(uri):
    return xmlrpc.client.ServerProxy(uri, transport=_Timeout())


def _pack_header(fields):
    content = b"".join(struct.pack("<I", len(item)) + item
                       for item in (f"{key}={value}".encode() for key, value in fields.items()))
    return struct.pack("<I", len(content)) + content


def _receive(connection, count):
    parts = bytearray()
    while len(parts) < count:
        part = connection.recv(count - len(parts))
        if not part:
            raise ConnectionError("closed by the other side")
        parts += part
    return bytes(parts)


def _receive_block(connection):
    return _receive(connection, struct.unpack("<I", _receive(connection, 4))[0])


class Master:
    """A ROS master on a port of its own."""

    def __init__(self, context, port=None):
        self.context = context
        self.port = port or free_port()
        self.uri = f"http://localhost:{self.port}"
        self.process = None
        self.start()

    def environment(self, **changes):
        return self.context.environment(**{"ROS_MASTER_URI": self.uri, "ROS_HOSTNAME": "localhost",
                                           "ROS_LOG_DIR": self.context.path("ros_log"), **changes})

    def start(self):
        if not os.path.exists("/usr/bin/rosmaster"):
            raise NotTried("no ROS master here")
        self.process = self.context.start(["/usr/bin/rosmaster", "--core", "-p", str(self.port)],
                                          f"master_{self.port}.txt", env=self.environment())
        require(wait_until(self.answers), f"the ROS master did not start: {self.process.log()[-300:]}")

    def answers(self):
        try:
            return self.call("getUri") is not None
        except (OSError, xmlrpc.client.Error):
            return False

    def call(self, method, *arguments):
        """@return the value of an answer; None if the master says no"""
        code, _, value = getattr(_proxy(self.uri), method)("/fault_campaign", *arguments)
        return value if code == 1 else None

    def set(self, name, value):
        self.call("setParam", name, value)

    def publishers(self, topic):
        for name, nodes in self.call("getSystemState")[0]:
            if name == topic:
                return nodes
        return []

    def subscribe(self, topic, message=None, node=None):
        """A connection to a publisher of a topic, made without telling the master."""
        require(wait_until(lambda: self.publishers(topic)), f"nobody publishes {topic}")
        return Subscription(self.call("lookupNode", node or self.publishers(topic)[0]), topic, message)

    def service(self, name, service, **fields):
        """Calls a service. @return its response"""
        require(wait_until(lambda: self.call("lookupService", name)), f"no service {name}")
        host, port = self.call("lookupService", name).removeprefix("rosrpc://").rsplit(":", 1)
        with contextlib.closing(socket.create_connection((host, int(port.strip("/"))), 30.0)) as connection:
            connection.sendall(_pack_header({"callerid": "/fault_campaign", "md5sum": "*", "service": name}))
            _receive_block(connection)
            request = io.BytesIO()
            service._request_class(**fields).serialize(request)
            connection.sendall(struct.pack("<I", len(request.getvalue())) + request.getvalue())
            good = _receive(connection, 1)
            body = _receive_block(connection)
            if good == b"\0":
                raise Broken(f"service {name} failed: {body.decode('utf-8', 'replace')}")
            response = service._response_class()
            response.deserialize(body)
            return response


class Subscription:
    """A TCPROS connection from a publisher. Without read() it is a subscriber that never reads."""

    def __init__(self, node_uri, topic, message=None):
        self.message = message
        code, text, protocol = _proxy(node_uri).requestTopic("/fault_campaign", topic, [["TCPROS"]])
        require(code == 1, f"{topic}: {text}")
        self.socket = socket.create_connection((protocol[1], protocol[2]), 10.0)
        self.socket.sendall(_pack_header({"callerid": "/fault_campaign", "topic": topic, "md5sum": "*", "type": "*"}))
        self._buffer = bytearray()
        self._awaits_header = True

    def close(self):
        self.socket.close()

    def read(self, duration_s):
        """@return the messages that come within a time, each with its time of arrival by the steady clock"""
        end = time.monotonic() + duration_s
        messages = []
        while True:
            left = end - time.monotonic()
            if left <= 0.0 or not select.select([self.socket], [], [], left)[0]:
                return messages
            part = self.socket.recv(1 << 16)
            if not part:
                raise ConnectionError("closed by the publisher")
            self._buffer += part
            now = time.monotonic()
            while len(self._buffer) >= 4:
                size = struct.unpack_from("<I", self._buffer)[0]
                if len(self._buffer) < 4 + size:
                    break
                body = bytes(self._buffer[4:4 + size])
                del self._buffer[:4 + size]
                if self._awaits_header:
                    self._awaits_header = False
                    continue
                if self.message is not None:
                    value = self.message()
                    value.deserialize(body)
                    body = value
                messages.append((now, body))

    def wait_for(self, condition, timeout_s=20.0):
        """@return the first message that fulfils the condition"""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            for _, message in self.read(0.1):
                if condition(message):
                    return message
        raise Broken("the awaited message did not come")


class Publisher:
    """A node of one topic that sends as fast as it is told to."""

    def __init__(self, master, name, topic, message):
        self.message = message
        self.connections = []
        self._topics = socketserver.ThreadingTCPServer(("127.0.0.1", 0), None, bind_and_activate=True)
        self._topics.process_request = self._take_connection
        self._slave = xmlrpc.server.SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False, allow_none=True)
        port = self._topics.server_address[1]
        self._slave.register_function(lambda *_: [1, "", ["TCPROS", "localhost", port]], "requestTopic")
        self._slave.register_function(lambda *_: [1, "", os.getpid()], "getPid")
        self._slave.register_function(lambda *_: [1, "", 0], "publisherUpdate")
        self._header = {"callerid": name, "topic": topic, "md5sum": message._md5sum, "type": message._type,
                        "latching": "0", "message_definition": ""}
        for server in (self._topics, self._slave):
            threading.Thread(target=server.serve_forever, daemon=True).start()
        self._unregister = (master, topic, f"http://localhost:{self._slave.server_address[1]}", name)
        _proxy(master.uri).registerPublisher(name, topic, message._type, self._unregister[2])

    def _take_connection(self, connection, _):
        _receive_block(connection)
        connection.sendall(_pack_header(self._header))
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.connections.append(connection)

    def wait_for_connection(self):
        require(wait_until(lambda: self.connections), f"nobody subscribed to {self._header['topic']}")

    def send(self, message, times=1):
        body = io.BytesIO()
        message.serialize(body)
        content = (struct.pack("<I", len(body.getvalue())) + body.getvalue()) * times
        for connection in self.connections:
            connection.sendall(content)

    def close(self):
        master, topic, uri, name = self._unregister
        with contextlib.suppress(OSError, xmlrpc.client.Error):
            _proxy(master.uri).unregisterPublisher(name, topic, uri)
        for connection in self.connections:
            connection.close()
        for server in (self._topics, self._slave):
            server.shutdown()
            server.server_close()


class Rig:
    """rig_node under a master."""

    def __init__(self, master, name="rig_node", log="node.txt", environment=None, **parameters):
        self.master = master
        self.name = "/" + name
        parameters = {"scenario": os.path.join(os.path.dirname(__file__), "..", "ros", "small.yaml"), **parameters}
        arguments = [f"_{key}:={value}" for key, value in parameters.items()]
        self.process = master.context.start([master.context.rig_node, f"__name:={name}", *arguments], log,
                                            env=master.environment(**(environment or {})))

    def wait_until_up(self):
        require(wait_until(lambda: self.process.alive() and self.master.call("lookupService", self.name + "/reset")
                           is not None or not self.process.alive()), "the node did not come up")
        require(self.process.alive(), "the node ended: " + self.process.log()[-400:])
        return self

    def stop(self, timeout_s=20.0):
        """Ctrl-C. @return its exit code"""
        self.process.send(2)
        return self.process.wait(timeout_s)


def listening_addresses(pid):
    """(address, port) of each TCP socket on which a process listens."""
    text = subprocess.run(["ss", "-ltnpH"], capture_output=True, text=True, check=True).stdout
    found = []
    for line in text.splitlines():
        if f"pid={pid}," in line:
            address, port = line.split()[3].rsplit(":", 1)
            found.append((address, int(port)))
    return found
