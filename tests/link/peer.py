"""A client of the OpenIGTLink server of Stylet that knows nothing of Stylet: pyigtl, as users of 3D Slicer and PLUS have it.

Arguments: port, and as JSON what the server shows (`matrix`, `axial_force_n`, `lateral_force_n`, `depth_mm`) and the matrix to
ask for (`wanted`). Ends with 0 once the needle is where it was asked to be. tests/link.rs starts it.
"""

import json
import sys
import time

import numpy as np
import pyigtl

PATIENCE_S = 60.0


def message_of(client, device):
    message = client.wait_for_message(device, timeout=PATIENCE_S)
    assert message is not None, f"no message of {device} within {PATIENCE_S} s"
    return message


def main():
    port, expected = int(sys.argv[1]), json.loads(sys.argv[2])
    client = pyigtl.OpenIGTLinkClient(host="127.0.0.1", port=port)

    transform = message_of(client, "Needle")
    assert transform.message_type == "TRANSFORM"
    # f32 on the way.
    np.testing.assert_allclose(transform.matrix, expected["matrix"], rtol=1e-6, atol=1e-6)
    assert abs(transform.timestamp - time.time()) < 2 * PATIENCE_S, "the timestamp is not of now"
    print("transform\n", transform.matrix)

    text = message_of(client, "NeedleState")
    assert text.message_type == "STRING"
    state = json.loads(text.string)
    for key in ("axial_force_n", "lateral_force_n", "depth_mm"):
        np.testing.assert_allclose(state[key], expected[key], rtol=1e-12)
    assert state["state"] == "running"
    print("state", state)

    client.send_message(pyigtl.TransformMessage(np.array(expected["wanted"]), device_name="NeedleControl"))
    end = time.time() + PATIENCE_S
    while not np.allclose(message_of(client, "Needle").matrix, expected["wanted"], rtol=1e-6, atol=1e-6):
        assert time.time() < end, "the needle does not go where it was asked to be"
    print("the needle is where it was asked to be")
    client.stop()


main()
