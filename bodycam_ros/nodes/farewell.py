"""How nodes leave ROS: every one of them destroyed, and within a bounded time."""

import ctypes
import faulthandler
import os
from collections.abc import Iterable

import rclpy
from rclpy.node import Node

PATIENCE_S = 60.0
"""Leaving takes 0.03 s of processor time: who is not gone by then is stuck, however busy the machine is."""

_CALLBACKS_S = 5

_RMW = "librmw_fastrtps_cpp.so"
_NODE_TO_RMW = "rcl_node_get_rmw_handle"
_RMW_TO_PARTICIPANT = "_ZN16rmw_fastrtps_cpp22get_domain_participantEP10rmw_node_s"
_SET_LISTENER = (
    "_ZN8eprosima7fastdds3dds17DomainParticipant12set_listener"
    "EPNS1_25DomainParticipantListenerENSt6chrono8durationIlSt5ratioILl1ELl1EEEE"
)
"""ReturnCode_t DomainParticipant::set_listener(DomainParticipantListener*, std::chrono::seconds timeout)"""


def leave_ros(nodes: Iterable[Node]) -> None:
    """Destroy the nodes and end ROS in this process.

    What is still not over after ``PATIENCE_S`` is ended with exit code 1 and a look at where it is stuck.
    """
    # No thread of ours could do that: rclpy keeps the interpreter to itself while it destroys a node.
    faulthandler.dump_traceback_later(PATIENCE_S, exit=True)
    for node in nodes:
        ignore_discovery(node)
        node.destroy_node()
    rclpy.try_shutdown()


def ignore_discovery(node: Node) -> bool:
    """Let a node hear no more of who comes and goes; whether that was possible.

    Fast DDS destroys a participant only when none of its discovery callbacks runs, and waits for that with no time
    limit, which overflows where libstdc++ was built for a glibc before 2.30, as in the wheels: then it spins for ever
    and keeps the lock that the callback needs (eProsima/Fast-DDS issue 6513). It met 1 node in 500 of those that leave
    together, because then everybody hears of everybody's leaving. With a time limit the same call waits properly, and
    once it has succeeded there are no more callbacks to wait for.
    """
    try:
        # The one that is in use; where another middleware is, there is nothing to do.
        rmw = ctypes.CDLL(_RMW, mode=os.RTLD_NOW | os.RTLD_NOLOAD)
        rcl = ctypes.CDLL("librcl.so", mode=os.RTLD_NOW | os.RTLD_NOLOAD)
        rmw_node_of, participant_of, set_listener = rcl[_NODE_TO_RMW], rmw[_RMW_TO_PARTICIPANT], rmw[_SET_LISTENER]
    except (OSError, AttributeError):
        return False
    rmw_node_of.restype = participant_of.restype = ctypes.c_void_p
    rmw_node_of.argtypes = participant_of.argtypes = [ctypes.c_void_p]
    set_listener.restype = ctypes.c_uint32
    set_listener.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64]
    with node.handle:
        participant = participant_of(rmw_node_of(node.handle.pointer))
    return bool(participant) and set_listener(participant, None, _CALLBACKS_S) == 0
