"""A browser's part without the drawing: `python -m benchmarks.page_listener PORT INSTANCE`.

It takes all that the viewer's page is sent, and each second prints how often the vehicle's position came in it. It runs
until it is killed.
"""

import sys
import time

import msgspec
import viser
import zstandard
from websockets.sync.client import connect

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (-2.0, 0.0, -1.0), "fov": 1.0,
    "near": 0.01, "far": 1000.0, "image_height": 720, "image_width": 1280, "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, -1.0),
}  # fmt: skip
HEAD = 16  # bytes: two lengths


def main() -> None:
    port, instance = sys.argv[1:3]
    node = f"/vehicle/{instance}/body"
    inflate = zstandard.ZstdDecompressor()
    with connect(
        f"ws://127.0.0.1:{port}", subprotocols=[f"viser-v{viser.__version__}"], max_size=None, compression=None
    ) as page:  # type: ignore[list-item]
        page.send(msgspec.msgpack.encode(CAMERA))
        updates, since_s = 0, time.monotonic()
        while True:
            frame = page.recv()
            assert isinstance(frame, bytes)
            size = int.from_bytes(frame[8:16], "little")
            told = msgspec.msgpack.decode(inflate.decompress(frame[HEAD : HEAD + size]))
            for message in told["messages"]:
                updates += message["type"] == "SetPositionMessage" and message["name"] == node
            now_s = time.monotonic()
            if now_s - since_s >= 1.0:
                print(f"{updates / (now_s - since_s):.2f}", flush=True)
                updates, since_s = 0, now_s


if __name__ == "__main__":
    main()
