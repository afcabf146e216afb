"""A first flight with plain cflib:  `make sil` in one terminal, `.venv/bin/python docs/first_flight.py` in another.

It flies once: after that the vehicle hangs from the ceiling, and `make sil` is to be started anew.
"""

import struct
import sys
import time

import cflib.crtp
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie

cflib.crtp.init_drivers()
with SyncCrazyflie(sys.argv[1] if len(sys.argv) > 1 else "udp://127.0.0.1:19850", cf=Crazyflie()) as scf:
    cf, seen, hover = scf.cf, {}, struct.pack("<fff", 0.0, 0.0, 1.0)
    number = int(time.time()) % 2**31  # of the policy: a new one, or an older landing would be taken for this
    scf.wait_for_params()
    print("parameters:", *sorted(cf.param.toc.toc["ivl"]), "\nlogs:", *sorted(cf.log.toc.toc["ivl"]))
    block = LogConfig("snapshot", period_in_ms=20)
    for name in ("phase", "policy_seq", "trg_seq", "trg_d", "trg_rrev", "trg_vz"):
        block.add_variable(f"ivl.{name}")
    block.data_received_cb.add_callback(lambda _, data, __: seen.update(data))
    cf.log.add_config(block)
    block.start()
    cf.param.set_value("ivl.commit", 1)  # the app's parameters as they are: checked, and put in force
    cf.supervisor.send_arming_request(True)
    time.sleep(0.5)
    cf.high_level_commander.takeoff(1.0, 2.0)
    time.sleep(3.0)
    cf.appchannel.send_packet(struct.pack("<BBLff", 1, 1, number, 4.8, 0.008))  # flip at RREV 4.8 1/s with 8 N mm
    for n, request in enumerate([1] * 30 + [2] * 50):  # 1: hover, 2: approach, upwards at 2.5 m/s; at least 10 a second
        cf.appchannel.send_packet(struct.pack("<BBHB", 2, 1, n, request) + hover + struct.pack("<ff", 2.5, 1.57))
        time.sleep(0.05)
    print("phase", seen.pop("ivl.phase"), "(5 attached, 6 done, 7 aborted)")
    print({name: round(value, 3) for name, value in seen.items()})
    if seen["ivl.trg_seq"] != number:
        sys.exit("no landing: the vehicle has to stand on its feet, with no other program flying it")
