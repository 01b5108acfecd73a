"""From SIGKILL in flight to being heard again: `python -m benchmarks.recovery [--crashes 5]`.

`sitl run` and `companion fly` meet through a wire on which this program listens. It kills the
companion while it scans, starts `companion recover` as systemd would, and notes when the vehicle
gets its first heartbeat and the text that says where the drone is. A second of that is SITL's
clock, which waits in vain for the datagrams that were sent while nobody was there.
"""

import argparse
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress

from companion.link.transports.transport import decode, make_codec

DEADLINE_S = 60.0
POLL_S = 0.2


class Wire:
    """Passes datagrams on between the vehicle and whoever flies it; hears the latter."""

    def __init__(self) -> None:
        self.to_vehicle, self.to_companion = _udp_socket(), _udp_socket()
        probe = _udp_socket()
        self.companion_port = probe.getsockname()[1]
        probe.close()
        self.heard_s: dict[str, float] = {}
        """When a kind of message was first heard since `forget`."""
        self.text = ""
        self.opened = threading.Event()
        """The companion is there for the first time; until then everything waits."""
        self._vehicle: tuple[str, int] | None = None
        self._codec = make_codec(255, 190)
        for pass_on in (self._down, self._up):
            threading.Thread(target=pass_on, daemon=True).start()

    @property
    def port(self) -> int:
        """Where the vehicle speaks to."""
        port: int = self.to_vehicle.getsockname()[1]
        return port

    def forget(self) -> None:
        self.heard_s, self.text = {}, ""

    def _down(self) -> None:
        while True:
            self.opened.wait()
            data, self._vehicle = self.to_vehicle.recvfrom(65535)
            with suppress(ConnectionError):  # nobody there just now
                self.to_companion.sendto(data, ("127.0.0.1", self.companion_port))

    def _up(self) -> None:
        while True:
            try:
                data = self.to_companion.recv(65535)
            except ConnectionError:  # nobody there just now
                continue
            for message in decode(self._codec, data):
                self.heard_s.setdefault(message.get_type(), time.monotonic())
                if message.get_type() == "STATUSTEXT":
                    self.text += message.text
            if self._vehicle is not None:
                self.to_vehicle.sendto(data, self._vehicle)


def _udp_socket() -> socket.socket:
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", 0))
    return udp


def crash_once() -> tuple[float, float, str]:
    """Seconds from the kill to the heartbeat and to the text, and the text."""
    wire = Wire()
    with tempfile.TemporaryDirectory() as out:
        serve = ("--mavlink", f"udpout:127.0.0.1:{wire.port}", "--bus-port", "0")
        vehicle = _start("sitl", "run", "room_100", *serve)
        bus = re.findall(r"sitl://\S+", _read_until(vehicle, "sitl://"))[-1]
        link = ("--link", f"udpin:127.0.0.1:{wire.companion_port}", "--bus", bus, "--out", out)
        pilot = _start("companion", "fly", *link)
        try:
            _read_until(pilot, "autopilot at")
            wire.opened.set()
            _read_until(pilot, "scanning parallel")
            pilot.kill()
            pilot.wait()
            killed_s = time.monotonic()
            wire.forget()
            pilot = _start("companion", "recover", *link)
            while "STATUSTEXT" not in wire.heard_s:
                if time.monotonic() - killed_s > DEADLINE_S:
                    raise TimeoutError("not heard again")
                time.sleep(POLL_S)
            heard_s = wire.heard_s
            return heard_s["HEARTBEAT"] - killed_s, heard_s["STATUSTEXT"] - killed_s, wire.text
        finally:
            for process in (pilot, vehicle):
                process.kill()
                process.wait()


def _start(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def _read_until(process: subprocess.Popen[str], words: str) -> str:
    assert process.stdout is not None
    for line in process.stdout:
        if words in line:
            return line
    raise RuntimeError(f"it ended without saying {words!r}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--crashes", type=int, default=5)
    crashes = []
    for _ in range(parser.parse_args().crashes):
        heartbeat_s, text_s, text = crash_once()
        crashes.append((heartbeat_s, text_s))
        print(f"heartbeat after {heartbeat_s:.2f} s, after {text_s:.2f} s: {text}", flush=True)
    print(
        f"{len(crashes)} crashes: heartbeat within {max(c[0] for c in crashes):.2f} s, "
        f"text within {max(c[1] for c in crashes):.2f} s"
    )


if __name__ == "__main__":
    main()
