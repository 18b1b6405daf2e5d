"""Receive what `automos live --send udp://127.0.0.1:9050` sends, with nothing but Python, until nothing comes any more.

python examples/live_receiver.py [PORT]
"""

import math
import socket
import struct
import sys
import zlib

HEADER = struct.Struct("<4sHHIIIId12d")
OBJECT = struct.Struct("<i10f")

port = int(sys.argv[1]) if len(sys.argv) > 1 else 9050
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
    receiver.bind(("127.0.0.1", port))
    receiver.settimeout(3.0)
    print(f"listening at 127.0.0.1:{port}")
    while True:
        try:
            data = receiver.recv(65536)
        except TimeoutError:
            break
        if len(data) < HEADER.size or not data.startswith(b"AMOS\x01\x00"):
            continue  # not ours, or of another version
        _, _, n_objects, index, n_points, n_moving, n_bytes, stamp, *pose = HEADER.unpack_from(data)
        print(f"scan {index} at {stamp:.3f} s: {n_moving} of {n_points} points move")
        for k in range(n_objects):
            track, x, y, z, length, width, height, yaw, vx, vy, vz = OBJECT.unpack_from(data, HEADER.size + 44 * k)
            print(f"  object {track} at ({x:.1f}, {y:.1f}, {z:.1f}) m, {math.hypot(vx, vy, vz):.1f} m/s")
        labels = zlib.decompress(data[HEADER.size + 44 * n_objects :]) if n_bytes else None  # 251: this point moves
