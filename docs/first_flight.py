"""A first flight with plain cflib:  `make sil` in one terminal, `.venv/bin/python docs/first_flight.py` in another."""

import struct
import time
import zlib

import cflib.crtp
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
from cflib.crazyflie.syncLogger import SyncLogger
from cflib.utils.uri_helper import uri_from_env

cflib.crtp.init_drivers()
snapshot = LogConfig("snapshot", period_in_ms=20)
for name in ("phase", "trg_seq", "trg_d", "trg_rrev", "trg_vz"):
    snapshot.add_variable(f"ivl.{name}")
with SyncCrazyflie(uri_from_env(default="udp://127.0.0.1:19850")) as scf:
    cf, number = scf.cf, int(time.time())  # of the policy: a new one, so that no older landing is taken for this
    print("parameters:", *cf.param.toc.toc["ivl"], "\nlogs:", *cf.log.toc.toc["ivl"])
    if "sil" in cf.param.toc.toc:
        cf.param.set_value("sil.place", 1)  # on the floor, by the hand of an operator that only a simulated vehicle has
        time.sleep(0.5)
        cf.supervisor.send_crash_recovery_request()  # what hung from the ceiling counts as crashed
    cf.param.set_value("ivl.commit", 1)  # the app's parameters as they are: checked, and put in force
    for n in range(20):  # 0: idle, in the place of the last request of a flight before this one; at least 10 a second
        cf.appchannel.send_packet(struct.pack("<BBHBfffff", 2, 2, n, 0, 0.0, 0.0, 0.0, 0.0, 0.0))
        time.sleep(0.05)
    cf.supervisor.send_arming_request(True)
    time.sleep(0.5)
    cf.high_level_commander.takeoff(1.0, 2.0)
    time.sleep(3.0)
    theta = struct.pack("<ff", 3.9, 0.0065)  # flip at RREV 3.9 1/s with 6.5 N mm
    head = struct.pack("<BBLLBBB", 1, 2, number, zlib.crc32(b"constant" + theta), 0, 2, 0)  # form 0, 2 numbers, part 0
    cf.appchannel.send_packet(head + theta + bytes(8))
    for n, request in enumerate([1] * 30 + [2] * 50):  # 1: hover, 2: approach, upwards at 2.5 m/s
        cf.appchannel.send_packet(struct.pack("<BBHBfffff", 2, 2, 100 + n, request, 0.0, 0.0, 1.0, 2.5, 1.57))
        time.sleep(0.05)
    with SyncLogger(scf, snapshot) as log:
        _, seen, _ = next(log)
    print(seen)  # phase 5: attached, 6: done, 7: aborted
    assert seen["ivl.trg_seq"] == number, "no landing: reboot the vehicle, and fly it with nothing else"
