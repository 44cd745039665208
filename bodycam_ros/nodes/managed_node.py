"""A managed node: configured, activated, deactivated and cleaned up by itself, or by whoever manages it."""

import gc
import traceback
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.service import Service

from bodycam_ros.errors import BodycamError
from bodycam_ros.messages.factory import Message

_ALWAYS = 0
"""The life of what is there before the node is configured, and stays."""


class ManagedNode(LifecycleNode):
    """What the transitions mean is said in ``prepare``, ``begin``, ``pause`` and ``finish``.

    All that ``prepare`` makes goes when the node is cleaned up: publishers, subscriptions, timers, services and the
    node's new attributes. Nobody has to list it, so nothing is forgotten.

    An error of the user's while the node is at work ends the process of a node that has started by itself, for whoever
    started the process starts it again. One that is managed becomes unconfigured, not finalized: what was wrong is a
    file or a topic, and once that is mended it can be configured again.

    Args:
        name: of the node, unless it is remapped.
        arguments: of this node alone, as on a command line ("--ros-args", "-r", ...), where others share the process.

    Attributes:
        autostart: whether the node configures and activates itself.
        is_active: whether it is at work.
        failure: the user's error that ends the work.
        why: why the latest transition failed, or what the node became unconfigured by; None if nothing is wrong.
        is_over: whether the process, or what the node has of it, may go.
    """

    is_managed: ClassVar[bool] = True
    """Whether others may manage it: a node that serves nobody while it works cannot be asked."""

    def __init__(self, name: str, arguments: Sequence[str] = ()) -> None:
        super().__init__(
            name,
            enable_communication_interface=self.is_managed,
            cli_args=list(arguments),
            automatically_declare_parameters_from_overrides=True,
            enable_logger_service=True,
        )
        self.autostart = True
        self.is_active = self.is_over = False
        self.failure: BodycamError | None = None
        self.why: Exception | None = None
        self._life = _ALWAYS
        self._is_configured = self._brings_itself_up = False
        self._names_before: set[str] = set()
        self._entities_before: set[Any] = set()
        if self.is_managed:
            self._refuse_wrong_transitions()

    def prepare(self) -> None:
        """Configure: check and load everything, listen and advertise; may raise a BodycamError."""

    def begin(self) -> None:
        """Activate: what comes is worked on from now on; may raise a BodycamError."""

    def pause(self) -> None:
        """Deactivate: publish what is due, and keep what is known."""

    def finish(self) -> None:
        """Last words before what was prepared goes; publishing still works. May raise a BodycamError."""

    def bring_up(self) -> None:
        """Configure and activate the node, unless somebody else is to do so.

        Raises:
            BodycamError: why that is not possible.
        """
        if not self.autostart:
            self.get_logger().info("unconfigured; waits for whoever manages it (ros2 lifecycle set)")
            return
        self._brings_itself_up = True
        for transition in (self.trigger_configure, self.trigger_activate):
            if transition() != TransitionCallbackReturn.SUCCESS and self.why is not None:
                raise self.why
        self._brings_itself_up = False

    def leave(self) -> None:
        """Say the last words, if there is something to be said; for who ends the process.

        Raises:
            BodycamError: of ``finish``.
        """
        if self._is_configured:
            self.finish()

    def guarded(self, callback: Callable[..., None], even_inactive: bool = False) -> Callable[..., None]:
        """The callback, except that it does nothing while the node is not active, and a BodycamError ends the work.

        Args:
            callback: works.
            even_inactive: it is about what is kept while the node is inactive.
        """
        life = self._life

        def guarded(*arguments: Any) -> None:
            if self.failure is None and life in (_ALWAYS, self._life) and (even_inactive or self.is_active):
                try:
                    callback(*arguments)
                except BodycamError as error:
                    self._fail(error)

        return guarded

    @property
    def state(self) -> str:
        """Name of the state, such as "inactive"."""
        label: str = self._state_machine.current_state[1]
        return label

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """For rclpy, as the others."""
        self._life += 1
        self._entities_before = set(self._entities())
        self._names_before = set(vars(self))
        result = self._attempt(self.prepare)
        self._is_configured = result == TransitionCallbackReturn.SUCCESS
        if not self._is_configured:
            self._free()
        return result

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin."""
        result = self._attempt(self.begin)
        self.is_active = result == TransitionCallbackReturn.SUCCESS
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Pause."""
        self.is_active = False
        result = self._attempt(self.pause)
        self.is_active = result == TransitionCallbackReturn.FAILURE
        return result

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Free everything; what cannot be said at the end, such as a map that cannot be saved, keeps it."""
        result = self._attempt(self.finish)
        if result == TransitionCallbackReturn.SUCCESS:
            self._free()
        return result

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End, whatever the last words are."""
        self.is_active = False
        if self._is_configured:
            self._attempt(self.finish)
        self._free()
        self.is_over = True
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Become unconfigured."""
        self.is_active = False
        failure, self.failure = self.failure or self.why, None
        if self._is_configured:
            self._attempt(self.finish)
        self._free()
        self.why = failure
        return TransitionCallbackReturn.SUCCESS

    def _attempt(self, step: Callable[[], None]) -> TransitionCallbackReturn:
        """What a transition raises is said here, for rclpy drops it."""
        if self.failure is not None:
            return TransitionCallbackReturn.ERROR
        try:
            step()
        except BodycamError as error:
            self._say(error, str(error))
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            self._say(error, traceback.format_exc())
            return TransitionCallbackReturn.ERROR
        self.why = None
        return TransitionCallbackReturn.SUCCESS

    def _say(self, why: Exception, text: str) -> None:
        self.why = why
        if not self._brings_itself_up:
            self.get_logger().error(text)

    def _fail(self, error: BodycamError) -> None:
        self.failure = error
        if self.autostart:
            self.is_over = True
        else:
            self._say(error, str(error))
            # Not here: what is called would be destroyed by that.
            assert self.executor is not None
            self.executor.create_task(self._process_failure)

    def _process_failure(self) -> None:
        """The only ways from a state at rest to the processing of errors are transitions that fail."""
        if self.failure is not None:
            (self.trigger_deactivate if self.is_active else self.trigger_cleanup)()

    def _free(self) -> None:
        self._is_configured = False
        # What was heard by now, but not called back yet, is of no use.
        self._life += 1
        for entity in set(self._entities()) - self._entities_before:
            if isinstance(entity, Service):
                _fall_silent(entity)
            self._destroyer(entity)(entity)
        for name in set(vars(self)) - self._names_before:
            delattr(self, name)
        # What listens refers to itself in circles, a map is large, and the executor lets go of it only after this.
        if self.executor is not None:
            self.executor.create_task(gc.collect)

    def _entities(self) -> list[Any]:
        return [*self.subscriptions, *self.publishers, *self.services, *self.clients, *self.timers]

    def _destroyer(self, entity: Any) -> Callable[[Any], object]:
        kinds: dict[Callable[[Any], object], Any] = {
            self.destroy_subscription: self.subscriptions,
            self.destroy_publisher: self.publishers,
            self.destroy_service: self.services,
            self.destroy_client: self.clients,
            self.destroy_timer: self.timers,
        }
        return next(destroy for destroy, entities in kinds.items() if entity in entities)

    def _refuse_wrong_transitions(self) -> None:
        """Answer to a transition that is not possible now: in rclpy 7.1.6 it ends the node with a traceback."""
        change_state = self._service_change_state.callback

        def change_if_possible(request: Message, response: Message) -> Message:
            before = self.state
            try:
                return change_state(request, response)
            except rclpy_implementation.RCLError:
                asked = request.transition.label or request.transition.id
                self.get_logger().warning(f"a transition '{asked}' is not possible while the node is {before}")
                response.success = False
                return response

        self._service_change_state.callback = change_if_possible


def _fall_silent(service: Service) -> None:
    """Let a request that was on its way when the service is destroyed be as one that came later: nobody answers it."""
    service.callback = lambda request, response: response
    service.send_response = lambda response, header: None  # type: ignore[method-assign]
