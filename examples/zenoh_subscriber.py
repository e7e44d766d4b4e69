"""A vehicle's pose from Zenoh, for viewers: `python examples/zenoh_subscriber.py [ENDPOINT [INSTANCE [COUNT]]]`."""

import json
import sys

import zenoh


def main(endpoint: str = "tcp/127.0.0.1:7447", instance: str = "0", count: str = "100") -> None:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as session:
        newest = {
            topic: session.declare_subscriber(f"yawsitter/{instance}/{topic}", zenoh.handlers.RingChannel(1))
            for topic in ("state", "attitude", "actuators")
        }
        for _ in range(int(count)):
            state, attitude, actuators = (json.loads(each.recv().payload.to_bytes()) for each in newest.values())
            n, e, d = state["position_N_m"]
            w, x, y, z = attitude["q_NB"]
            print(f"{state['now_us'] * 1e-6:9.3f} s  at {n:7.3f} {e:7.3f} {d:7.3f} m", end="  ")
            print(f"turned {w:6.3f} {x:6.3f} {y:6.3f} {z:6.3f}  rotors {actuators['rotor_left_rpm']:5.0f} rpm")


if __name__ == "__main__":
    main(*sys.argv[1:])
