"""A Zenoh subscriber to everything one vehicle sends: `python -m benchmarks.listener ENDPOINT read|never`.

`read` takes every message at once and throws it away. `never` declares a queue of one message and takes nothing out of
it, so that the whole way back to the vehicle fills up. It prints `ready`, and ends when its standard input does.
"""

import sys

import zenoh


def main() -> None:
    endpoint, manner = sys.argv[1:3]
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as session:
        if manner == "read":
            subscriber = session.declare_subscriber("yawsitter/**", lambda _sample: None)
        else:
            subscriber = session.declare_subscriber("yawsitter/**", zenoh.handlers.FifoChannel(1))
        print("ready", flush=True)
        sys.stdin.read()
        subscriber.undeclare()


if __name__ == "__main__":
    main()
