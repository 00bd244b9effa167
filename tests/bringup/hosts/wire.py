"""A wire between two network namespaces that delays and loses, where the kernel has no netem: two TAP devices.

    python wire.py NAMESPACE NAMESPACE DELAY_S LOSS SEED

It makes the namespaces (10.99.0.1 and 10.99.0.2), prints a line, and passes Ethernet frames on until it is told to end.
"""

import fcntl
import heapq
import os
import random
import select
import signal
import struct
import subprocess
import sys
import time

TUNSETIFF = 0x400454CA
TAP_WITHOUT_HEADER = 0x0002 | 0x1000
LONGEST_FRAME = 2048


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


def end_of_wire(namespace: str, address: str) -> int:
    """Make a namespace with one device in it; the file whose frames are the device's."""
    ip("netns", "add", namespace)
    own = os.open("/proc/self/ns/net", os.O_RDONLY)
    there = os.open(f"/var/run/netns/{namespace}", os.O_RDONLY)
    os.setns(there, os.CLONE_NEWNET)
    tap = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tap, TUNSETIFF, struct.pack("16sH14x", b"wire", TAP_WITHOUT_HEADER))
    os.setns(own, os.CLONE_NEWNET)
    ip("-n", namespace, "addr", "add", f"{address}/24", "dev", "wire")
    for device in ("lo", "wire"):
        ip("-n", namespace, "link", "set", device, "up")
    ip("-n", namespace, "route", "add", "224.0.0.0/4", "dev", "wire")
    return tap


def main() -> None:
    names, delay_s, loss = sys.argv[1:3], float(sys.argv[3]), float(sys.argv[4])
    chance = random.Random(int(sys.argv[5]))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        taps = [end_of_wire(name, f"10.99.0.{number}") for number, name in enumerate(names, start=1)]
        print("ready", flush=True)
        pass_on({taps[0]: taps[1], taps[1]: taps[0]}, delay_s, loss, chance)
    finally:
        for name in names:
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True)


def pass_on(other_end: dict[int, int], delay_s: float, loss: float, chance: random.Random) -> None:
    waiting: list[tuple[float, int, int, bytes]] = []
    count = 0
    while True:
        wait_s = max(waiting[0][0] - time.monotonic(), 0.0) if waiting else None
        for tap in select.select(list(other_end), [], [], wait_s)[0]:
            frame = os.read(tap, LONGEST_FRAME)
            count += 1
            if chance.random() >= loss:
                heapq.heappush(waiting, (time.monotonic() + delay_s, count, other_end[tap], frame))
        while waiting and waiting[0][0] <= time.monotonic():
            _, _, tap, frame = heapq.heappop(waiting)
            os.write(tap, frame)


if __name__ == "__main__":
    main()
