"""A ground station at a swarm's shared port that counts: `python -m benchmarks.swarm_listener PORT MESSAGE`.

It prints `ready`, reads until a line comes to its standard input, and prints how many of this message each vehicle has
sent, and in how many seconds.
"""

import json
import select
import socket
import sys
import time
from collections import Counter

from sitl.mavlink import codec
from sitl.mavlink.codec import mav


def main() -> None:
    port, name = int(sys.argv[1]), sys.argv[2]
    wanted = codec.by_name(name).id.to_bytes(3, "little")
    hello = codec.Encoder(252, 190).encode(codec.message("HEARTBEAT", type=mav.MAV_TYPE_GCS, mavlink_version=3))
    counts: Counter[int] = Counter()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        print("ready", flush=True)
        begun_s = said_s = 0.0
        while True:
            now_s = time.monotonic()
            if now_s - said_s >= 1.0:
                said_s = now_s
                link.sendto(hello, ("127.0.0.1", port))
            readable, _, _ = select.select([link, sys.stdin], [], [], 0.1)
            if sys.stdin in readable:
                break
            if link in readable:
                data = link.recv(65535)
                begun_s = begun_s or now_s
                if data[7:10] == wanted:
                    counts[data[5]] += 1
    print(json.dumps({"counts": list(counts.values()), "seconds": time.monotonic() - begun_s}))


if __name__ == "__main__":
    main()
