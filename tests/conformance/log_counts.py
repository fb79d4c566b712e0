"""How many messages of each id pymavlink reads in the logs named on the command line: one line of JSON.

{log: {id: messages}}; messages whose id it does not know are counted under -2.
"""

import collections
import json
import sys

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega


def messages(path):
    if path.endswith(".tlog"):
        log = mavutil.mavlink_connection(path, dialect="ardupilotmega")
        return iter(log.recv_msg, None)
    parser = ardupilotmega.MAVLink(None)
    parser.robust_parsing = True
    with open(path, "rb") as stream:
        return parser.parse_buffer(stream.read())


counts = {}
for path in sys.argv[1:]:
    ids = (m.get_msgId() for m in messages(path) if m.get_type() != "BAD_DATA")
    counts[path] = collections.Counter(ids)
print(json.dumps(counts))
