"""A sensor on a CAN bus, as a federate of HELICS. Every 5 ms it sends the number of received frames, and the last one with its time.

can_federate.py BROKER COUNT: ends after it has sent COUNT frames.
"""

import sys

import helics as h

STEP = 0.001  # seconds
OWN = "0C1#"

info = h.helicsCreateFederateInfo()
h.helicsFederateInfoSetCoreTypeFromString(info, "zmq")
h.helicsFederateInfoSetCoreInitString(info, "--federates=1 --broker_address=" + sys.argv[1])
h.helicsFederateInfoSetTimeProperty(info, h.HELICS_PROPERTY_TIME_PERIOD, STEP)
sensor = h.helicsCreateMessageFederate("sensor", info)
can = h.helicsFederateRegisterGlobalEndpoint(sensor, "sensor/can", "")
h.helicsFederateEnterExecutingMode(sensor)

heard, said, step = 0, 0, 0
now = 0.0
while now < h.HELICS_TIME_MAXTIME and said < int(sys.argv[2]):
    while h.helicsEndpointHasMessage(can):
        time, bus, frame = h.helicsMessageGetString(h.helicsEndpointGetMessage(can)).split()
        if not frame.startswith(OWN):
            heard += 1
            print(time, bus, frame)
    if step % 5 == 0:
        h.helicsEndpointSendBytesTo(can, b"%s%02X" % (OWN.encode(), heard), "plant/open")
        said += 1
    step += 1
    now = h.helicsFederateRequestTime(sensor, now + STEP)
print("said", said, "heard", heard)
h.helicsFederateDisconnect(sensor)
