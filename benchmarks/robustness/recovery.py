"""Measures the recovery after SIGKILL in flight.

Command: `python -m benchmarks.robustness.recovery [--crashes 5]`.

`sitl run` and `companion fly` are connected through a relay in this program. It kills the companion
during the scan, starts `companion recover` as systemd would, and measures the time until the
vehicle receives the first heartbeat and the text with the drone's state. One second of that is
SITL's clock, which waits for datagrams that were sent without a receiver.
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
    """Relays datagrams between vehicle and companion, and decodes the companion's."""

    def __init__(self) -> None:
        self.to_vehicle, self.to_companion = _udp_socket(), _udp_socket()
        probe = _udp_socket()
        self.companion_port = probe.getsockname()[1]
        probe.close()
        self.received_s: dict[str, float] = {}
        """Time of the first message of each kind since `forget`, s."""
        self.text = ""
        self.opened = threading.Event()
        """Set when the companion is ready for the first time; until then the relay waits."""
        self._vehicle: tuple[str, int] | None = None
        self._codec = make_codec(255, 190)
        for pass_on in (self._down, self._up):
            threading.Thread(target=pass_on, daemon=True).start()

    @property
    def port(self) -> int:
        """Port to which the vehicle sends."""
        port: int = self.to_vehicle.getsockname()[1]
        return port

    def forget(self) -> None:
        self.received_s, self.text = {}, ""

    def _down(self) -> None:
        while True:
            self.opened.wait()
            data, self._vehicle = self.to_vehicle.recvfrom(65535)
            with suppress(ConnectionError):  # no companion at the moment
                self.to_companion.sendto(data, ("127.0.0.1", self.companion_port))

    def _up(self) -> None:
        while True:
            try:
                data = self.to_companion.recv(65535)
            except ConnectionError:  # no companion at the moment
                continue
            for message in decode(self._codec, data):
                self.received_s.setdefault(message.get_type(), time.monotonic())
                if message.get_type() == "STATUSTEXT":
                    self.text += message.text
            if self._vehicle is not None:
                self.to_vehicle.sendto(data, self._vehicle)


def _udp_socket() -> socket.socket:
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", 0))
    return udp


def crash_once() -> tuple[float, float, str]:
    """Time from the kill to the heartbeat and to the text, s, and the text."""
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
            while "STATUSTEXT" not in wire.received_s:
                if time.monotonic() - killed_s > DEADLINE_S:
                    raise TimeoutError("no message after the recovery")
                time.sleep(POLL_S)
            received_s = wire.received_s
            return (
                received_s["HEARTBEAT"] - killed_s,
                received_s["STATUSTEXT"] - killed_s,
                wire.text,
            )
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
    raise RuntimeError(f"the process ended without printing {words!r}")


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
