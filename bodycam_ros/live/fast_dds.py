"""A fault of Fast DDS at the end of a process, and the way around it."""

import ctypes
import os

_CALLBACKS_S = 5
_RMW = "librmw_fastrtps_cpp.so"
_NODE_TO_RMW = "rcl_node_get_rmw_handle"
_RMW_TO_PARTICIPANT = "_ZN16rmw_fastrtps_cpp22get_domain_participantEP10rmw_node_s"
_SET_LISTENER = (
    "_ZN8eprosima7fastdds3dds17DomainParticipant12set_listener"
    "EPNS1_25DomainParticipantListenerENSt6chrono8durationIlSt5ratioILl1ELl1EEEE"
)
"""ReturnCode_t DomainParticipant::set_listener(DomainParticipantListener*, std::chrono::seconds timeout)"""


def without_discovery_callbacks(node_handle: int) -> bool:
    """Let a node's participant in DDS be called no more when others come and go; whether that was possible.

    Fast DDS destroys a participant only when none of its discovery callbacks runs, and waits for that with no time
    limit, which overflows where libstdc++ was built for a glibc before 2.30, as in the wheels: then it spins for ever
    and keeps the lock that the callback needs (eProsima/Fast-DDS issue 6513). It met 1 node in 500 of those that leave
    together. With a time limit the same call waits properly. Neither rclpy nor a profile offers it: hence ctypes.

    Args:
        node_handle: pointer to the node of rcl.
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
    participant = participant_of(rmw_node_of(node_handle))
    return bool(participant) and set_listener(participant, None, _CALLBACKS_S) == 0
