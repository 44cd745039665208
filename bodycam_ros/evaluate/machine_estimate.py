"""What another machine would make of the live graph, from what each process costs on this one.

The work of one instant is laid out on the cores: every camera's tracker is free at once, each registration takes its
cameras one after the other as their tracks come, the solver begins when all are there, and whoever can work takes the
core that is free first. Every core is taken to be as fast as one of this machine, and to do nothing else. Messages
cost processor time in the processes that send and hear them; that is in the costs, and no more is added for the way.
The solver's cost has all cameras' landmarks in it, most of which it hears before the last come: on the safe side.
"""

from dataclasses import dataclass

from bodycam_ros.evaluate.latency import ProcessorTime


@dataclass(frozen=True)
class MachineEstimate:
    """How a machine would fare.

    Attributes:
        latency_s: from the images of an instant to its joint state, at ``output_delay`` 0 and nothing queued before.
        chain_s: of these, what no number of cores could take away: one tracker, one registration, the solver.
        busy: share of all cores' time that is used.
        busiest: share of the time that the busiest process uses; each runs on one core at a time.
    """

    latency_s: float
    chain_s: float
    busy: float
    busiest: float

    @property
    def keeps_up(self) -> bool:
        """Whether images do not queue."""
        return self.busy < 1.0 and self.busiest < 1.0


def estimate_machine(
    cost: ProcessorTime, cores: int, cameras: int, registrations: int, rate_hz: float
) -> MachineEstimate:
    """Lay out the work of an instant on a machine's cores.

    Args:
        cost: of each kind of process.
        cores: of the machine.
        cameras: that trigger together.
        registrations: processes that share the cameras.
        rate_hz: instants a second.
    """
    registrations = min(registrations, cameras)
    free_s = [0.0] * cores
    process_free_s = [0.0] * registrations
    # (ready, camera): trackers first, for their images are there first.
    tracked = [(_work(free_s, 0.0, cost.tracker_s), camera) for camera in range(cameras)]
    done_s = 0.0
    for ready_s, camera in sorted(tracked):
        share = camera % registrations
        process_free_s[share] = _work(free_s, max(ready_s, process_free_s[share]), cost.registration_s)
        done_s = max(done_s, process_free_s[share])
    per_instant_s = cameras * (cost.tracker_s + cost.registration_s) + cost.solver_s
    most_registered = -(-cameras // registrations)
    return MachineEstimate(
        latency_s=done_s + cost.solver_s,
        chain_s=cost.tracker_s + cost.registration_s + cost.solver_s,
        busy=per_instant_s * rate_hz / cores,
        busiest=rate_hz * max(cost.tracker_s, most_registered * cost.registration_s, cost.solver_s),
    )


def _work(free_s: list[float], ready_s: float, seconds: float) -> float:
    """Give work to the core that can begin it first; when it is done."""
    core = min(range(len(free_s)), key=lambda each: free_s[each])
    free_s[core] = max(ready_s, free_s[core]) + seconds
    return free_s[core]
